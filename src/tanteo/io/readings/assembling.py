"""Build readings from the columns of a file and the options that the user states: radius, direction, tool, normals."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

from tanteo.errors import ReadingsError, UnitError
from tanteo.geometry.typing import FloatArray, Vectors
from tanteo.io.poses.transforms import Track
from tanteo.io.readings.centres import find_centres, set_axis_sds
from tanteo.io.readings.profiles import place_profiles, spread
from tanteo.io.readings.range_codes import mark_outside, mark_reach
from tanteo.sensors import Readings, check_features, reading_kind

if TYPE_CHECKING:
    from tanteo.io.readings.stated import Stated

LARGEST = 100.0
"""Largest accepted coordinate or range [m]; larger values indicate a wrong unit."""

_DECIMALS = 6
"""Largest number of decimals of rounded coordinates; more are the full precision of a number."""

TIME = "time"
"""Column of the times of the rows [s], which only places the hand."""

_INWARD = -0.3
"""Mean cosine between I, J, K and the directions away from the centroid, below which the vectors point inwards."""


def assemble(
    columns: dict[str, Any],
    n: int,
    stated: Stated,
    source: str,
    notes: list[str],
    *,
    outward: Vectors | None = None,
    step: float = 0.0,
    profiled: bool = False,
) -> Readings:
    """Return readings built from file columns and the user's stated options.

    Args:
        columns: columns of :meth:`Readings.from_columns`, in SI units; None where the file has no such column.
        n: number of rows.
        stated: options for what the file does not contain.
        source: file name for messages.
        notes: notes collected so far.
        outward: outward normal vectors I, J, K of the file ``(n, 3)``; None if absent.
        step: step to which the file rounds coordinates [m]; 0 if unknown.
        profiled: whether the points are in the frame of a line scanner, which the rig and the hand's pose place.

    Returns:
        Checked readings, with the notes extended.

    Raises:
        ReadingsError: a stated option contradicts the file, or the rows do not form valid readings.
    """
    notes = list(notes)
    mark_reach(columns, n, stated, notes)
    kept = mark_outside(columns, n, stated, notes)
    if len(kept) < n:
        columns = {name: rows_of(values, kept) for name, values in columns.items()}
        outward, n = (None if outward is None else outward[kept]), len(kept)
    n = _place_in_time(columns, n, stated, source, notes)
    _place(columns, stated, source, notes)
    n = _place_profiles(columns, n, stated, notes) if profiled else n
    _give_radius(columns, n, stated, source)
    centres, outward = find_centres(columns, n, outward, source, notes)
    _give_directions(columns, n, outward, stated, source, notes)
    _give_normal_sds(columns, stated, source, notes)
    set_axis_sds(columns, centres, notes)
    _release_labels(columns, notes)
    n = _draw(columns, n, stated.max_points, notes)
    try:
        radii = columns["radii"]
        columns["radii"] = None if radii is None else np.nan_to_num(radii)
        readings = Readings.from_columns(**columns, n=n, source=source, notes=notes, step=step)
        check_features(readings)
    except ReadingsError as error:
        raise ReadingsError(f"{source}: {error}") from None
    return readings


def step_of(coordinates: FloatArray, unit: float) -> float:
    """Return the step to which coordinates are rounded by their number of decimals [m].

    It is 0 for whole numbers, which people type as exact ones, and for more than :data:`_DECIMALS` decimals.

    Args:
        coordinates: coordinates in the unit of the file, of any shape; NaN in empty cells.
        unit: unit of the file [m].
    """
    known = np.abs(coordinates[np.isfinite(coordinates)])
    for decimals in range(_DECIMALS + 1):
        scaled = known * 10.0**decimals
        if np.all(np.abs(scaled - np.round(scaled)) <= 1e-6 + 1e-15 * scaled):
            return unit * 10.0**-decimals if decimals else 0.0
    return 0.0


def _place_in_time(columns: dict[str, Any], n: int, stated: Stated, source: str, notes: list[str]) -> int:
    """Set the hand's poses at the times of the rows, without rows outside the known poses, and return their number."""
    times = columns.pop(TIME, None)
    track = stated.hand
    if not isinstance(track, Track):
        return n
    if times is None or columns.get("Ts_world_hand") is not None:
        raise ReadingsError(
            f"{source}: expected rows with a time and without a pose of their own for the poses of --hand, got "
            f"{'no times' if times is None else 'poses'}. Give a single pose, or drop --hand."
        )
    Ts, known = track.at(np.asarray(times))
    if not known.any():
        span = f"{track.times[0]:g} to {track.times[-1]:g} s"
        raise ReadingsError(
            f"{source}: expected times within those of --hand ({span}), got {np.min(times):g} to {np.max(times):g} s. "
            "Use one clock."
        )
    columns["Ts_world_hand"] = Ts
    if not known.all():
        notes.append(f"{int((~known).sum())} of {n} readings were excluded: no pose of --hand is known at their times.")
        for name, values in columns.items():
            columns[name] = rows_of(values, np.flatnonzero(known).tolist())
    return int(known.sum())


def _place_profiles(columns: dict[str, Any], n: int, stated: Stated, notes: list[str]) -> int:
    """Set points of profiles in the world with the optical axis as direction, and return the number of those kept."""
    points, axes, note = place_profiles(columns["points"], columns["Ts_world_hand"], stated)
    notes.append(note)
    columns["points"], columns["directions"] = points, axes
    sds = [] if stated.rig is None else [sensor.sd for sensor in stated.rig.sensors]
    if columns.get("sds") is None and np.isfinite(sds).any():
        columns["sds"] = np.full(n, sds[0])
    if stated.max_points is None or n <= stated.max_points:
        return n
    kept = spread(points, stated.max_points)
    notes.append(f"{len(kept)} of {n} points of profiles are used, spread evenly. --max-points sets their number.")
    columns["ids"] = columns["ids"] or [str(k + 1) for k in range(n)]
    for name, values in columns.items():
        columns[name] = rows_of(values, kept)
    return len(kept)


def rows_of(values: Any, kept: list[int]) -> Any:
    """Return some rows of a column; None for a column that is not there.

    Args:
        values: column as an array or a sequence.
        kept: indices of the rows.
    """
    if values is None:
        return None
    return values[kept] if isinstance(values, np.ndarray) else [values[k] for k in kept]


def _place(columns: dict[str, Any], stated: Stated, source: str, notes: list[str]) -> None:
    """Set the stated hand poses, and the tip positions where the file has poses but no points or ranges."""
    if stated.hand is not None and not isinstance(stated.hand, Track):
        if columns.get("Ts_world_hand") is not None:
            raise ReadingsError(
                f"{source}: expected one pose of the hand, got its own columns and --hand. Drop --hand."
            )
        count = next(len(columns[name]) for name in ("points", "ranges") if columns.get(name) is not None)
        columns["Ts_world_hand"] = np.broadcast_to(stated.hand, (count, 4, 4))
    Ts = columns.get("Ts_world_hand")
    needs_tip = columns.get("points") is None and columns.get("ranges") is None and columns.get("is_free") is None
    if stated.tool is not None and (Ts is None or not needs_tip):
        raise ReadingsError(f"{source}: expected --tool with poses of the hand and no points, got points. Drop --tool.")
    if Ts is not None and needs_tip:
        tool = np.eye(4) if stated.tool is None else stated.tool
        columns["points"] = (Ts @ tool)[:, :3, 3]
        if stated.tool is None:
            notes.append("The poses are taken as poses of the tip; use --tool X,Y,Z if they are poses of the flange.")
    points = columns.get("points")
    if points is not None and (far := np.nanmax(np.abs(points), initial=0.0)) > LARGEST:
        raise UnitError(
            f"{source}: expected points within {LARGEST:g} m of the origin, got one at {far:.6g} m: are these "
            "millimetres? Say --units mm."
        )


def _give_radius(columns: dict[str, Any], n: int, stated: Stated, source: str) -> None:
    if stated.radius is None:
        return
    own = columns["radii"]
    if own is not None and not np.allclose(own[np.isfinite(own)], stated.radius, rtol=0, atol=1e-9):
        raise ReadingsError(
            f"{source}: expected the radius once, got {np.nanmin(own) * 1e3:g} mm in the file and --radius. "
            "Drop --radius."
        )
    columns["radii"] = np.full(n, stated.radius)


def _give_directions(
    columns: dict[str, Any], n: int, outward: Vectors | None, stated: Stated, source: str, notes: list[str]
) -> None:
    """Set the directions from the file, else from the stated option, else opposite to the outward vectors I, J, K."""
    way = stated.direction
    own = columns["directions"]
    vectors = outward is not None and way is not None and way.kind in ("ijk", "-ijk")
    if way is not None and own is not None:
        raise ReadingsError(
            f"{source}: expected the direction once, got it in the file and --direction. Drop --direction."
        )
    if way is not None and way.kind in ("ijk", "-ijk") and not vectors:
        raise ReadingsError(f"{source}: expected vectors I J K for --direction {way.kind}, got none in the file.")
    if own is not None:
        if outward is not None:
            notes.append("I, J, K were not used: the file has directions of its own.")
        return
    if vectors and way is not None and outward is not None:
        columns["directions"] = outward if way.kind == "ijk" else -outward
    elif way is not None:
        columns["directions"] = _stated_directions(columns, n, stated, source)
    elif outward is not None:
        _refuse_inward(columns["points"], outward, source)
        columns["directions"] = -outward
        notes.append("I, J, K are taken as pointing out of the material; say --direction ijk if they point into it.")


def _stated_directions(columns: dict[str, Any], n: int, stated: Stated, source: str) -> FloatArray:
    way = stated.direction
    assert way is not None
    if way.kind == "fixed":
        return np.broadcast_to(np.array(way.vector, dtype=np.float64), (n, 3))
    if way.kind == "from":
        return np.asarray(columns["points"] - np.array(way.vector))
    Ts = columns.get("Ts_world_hand")
    if Ts is None:
        raise ReadingsError(f"{source}: expected poses of the hand for --direction tool, got none. Say another.")
    tool = np.eye(4) if stated.tool is None else stated.tool
    return np.asarray((Ts @ tool)[:, :3, 2])


def _refuse_inward(points: Vectors, outward: Vectors, source: str) -> None:
    """Refuse I, J, K vectors that point towards the centroid of the points, as approach directions do."""
    away = points - np.nanmean(points, axis=0)
    lengths = np.linalg.norm(away, axis=1) * np.linalg.norm(outward, axis=1)
    cosines = np.sum(away * outward, axis=1) / np.where(lengths > 0, lengths, np.nan)
    cosines = cosines[np.isfinite(cosines)]
    if len(cosines) and cosines.mean() < _INWARD:
        raise ReadingsError(
            f"{source}: expected I, J, K that point out of the material, got vectors that point to the middle of the "
            "points, as directions of approach do. If they are directions of approach, name them dx, dy, dz or use "
            "--direction ijk; otherwise use --direction -ijk."
        )


def _give_normal_sds(columns: dict[str, Any], stated: Stated, source: str, notes: list[str]) -> None:
    if columns["normals"] is None:
        if stated.normal_sd is not None:
            raise ReadingsError(f"{source}: expected normals for --normal-sd, got none in the file. Drop it.")
        return
    if stated.normal_sd is None:
        return
    if columns["normal_sds"] is not None:
        raise ReadingsError(f"{source}: expected the normals' standard deviation once, got it twice. Drop --normal-sd.")
    given = ~np.isnan(columns["normals"]).any(axis=1)
    columns["normal_sds"] = np.where(given, stated.normal_sd, np.nan)


def _release_labels(columns: dict[str, Any], notes: list[str]) -> None:
    """Turn rows of a plane with fewer than three rows into unlabelled points: they do not determine a plane."""
    features = columns["features"]
    kinds = columns["kinds"]
    if features is None or kinds is None:
        return
    own = [reading_kind(kind or "point") for kind in kinds]
    counts = Counter(zip(features, own, strict=True))
    several = Counter(f for f, _ in counts)  # labels of several kinds are refused later
    few = {f: n for (f, kind), n in counts.items() if f and kind.if_few and n < kind.least and several[f] == 1}
    if not few:
        return
    columns["features"] = ["" if f in few else f for f in features]
    columns["kinds"] = [kind.if_few if f in few else kind.name for f, kind in zip(features, own, strict=True)]
    named = ", ".join(f"'{f}' ({n})" for f, n in list(few.items())[:5])
    named += f" and {len(few) - 5} more" if len(few) > 5 else ""
    notes.append(f"Fewer than three rows of a plane are no plane: those of {named} are used as unlabelled points.")


def _draw(columns: dict[str, Any], n: int, most: int | None, notes: list[str]) -> int:
    """Keep at most ``most`` rows, drawn at random with a fixed seed; keep all rows if any is labelled."""
    if most is None or n <= most or any(columns.get("features") or ()):
        return n
    rows = np.sort(np.random.default_rng(0).choice(n, most, replace=False))
    columns["ids"] = columns["ids"] or range(1, n + 1)
    for name, values in columns.items():
        if isinstance(values, np.ndarray):
            columns[name] = values[rows]
        elif values is not None:
            columns[name] = [str(values[k]) for k in rows]
    notes.append(f"{most:,} of {n:,} readings are used, drawn at random; --max-points sets how many.")
    return most
