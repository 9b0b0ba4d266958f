"""The cell judged by the part: tip offset, mountings, base, bias are states beside its pose, and readings tell of them.

For each error that readings share: what they say it is, how far that is from what was stated, and whether they can tell
it from the others; and the reading that would.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.defaults import SIGNIFICANCE
from tanteo.errors import InputError
from tanteo.features import shared_root
from tanteo.geometry import SE3, SO3
from tanteo.geometry.special import chi2_survival
from tanteo.geometry.typing import FloatArray, Vectors
from tanteo.planning.state import SensingState
from tanteo.posterior import point_moves
from tanteo.sensors import Column, PointMeasurements, Readings

Measured = Callable[[Readings], PointMeasurements]
"""How readings are made into measurements."""

_TOLD = 0.05
"""Share of an error's stated variance that readings must explain, for it to be judged at all."""
_ALIKE = 0.7
"""Correlation from which on readings do not tell two errors from each other."""
_PLACES, _TURNS = 60, 4
"""Places of the part, and turns of the hand about each approach, that are looked at for the next reading."""


@dataclass(frozen=True, slots=True, eq=False)
class CellError:
    """One shared error as the readings have it.

    Attributes:
        name: of the error.
        meaning: what it is, in words.
        stated: standard deviations that were stated ``(d,)`` [m, rad, or none of a scale].
        estimate: what the readings say it is ``(d,)``.
        sd: how well they do ``(d,)``.
        p_value: of so large an estimate, if what was stated is true; 1 where readings say nothing of it.
        told: the largest share of a component's variance that readings have explained.
    """

    name: str
    meaning: str
    stated: FloatArray
    estimate: FloatArray
    sd: FloatArray
    p_value: float
    told: float

    @property
    def contradicted(self) -> bool:
        """Whether the readings contradict what was stated."""
        return self.p_value < SIGNIFICANCE


@dataclass(frozen=True, slots=True, eq=False)
class NextForCell:
    """The reading that tells most of the shared errors.

    Attributes:
        point: place of the part, world ``(3,)`` [m].
        direction: in which to come ``(3,)``.
        face: of the part.
        turn: of the hand from how it was held [rad].
        axis: of that turn, world ``(3,)``.
        gain: what it tells of the errors [nats].
    """

    point: Vectors
    direction: Vectors
    face: str
    turn: float
    axis: Vectors
    gain: float


@dataclass(frozen=True, slots=True, eq=False)
class CellCheck:
    """What the readings of a part say of the cell.

    Attributes:
        errors: of the cell, in the order of the measurements.
        alike: pairs of errors that readings do not tell from each other, with their correlation.
        following: the reading that would tell most; None where none would tell anything.
    """

    errors: tuple[CellError, ...]
    alike: tuple[tuple[str, str, float], ...]
    following: NextForCell | None


def check_cell(state: SensingState, readings: Readings, measured: Measured) -> CellCheck:
    """Judge the cell by what is known of the part.

    Args:
        state: after the readings.
        readings: that were told.
        measured: how they are made into measurements, with the errors that they share.

    Raises:
        InputError: no part explains the readings, or they share no error.
    """
    points = measured(readings)
    if not state.modes:
        raise InputError(
            "check-cell: expected readings of the part, got some that it does not explain. Check them first."
        )
    if not points.shared:
        raise InputError(
            "check-cell: expected errors that readings share, got none. State what may be wrong: --tip-sd, --rig, "
            "--robot or --bias-sd."
        )
    mode, root = state.modes[0], shared_root(points.shared)
    D = len(root)
    z, C = mode.z[:D], np.asarray(np.linalg.pinv(mode.information, hermitian=True))[6 : 6 + D, 6 : 6 + D]
    errors, slices, start = list[CellError](), list[slice](), 0
    for error in points.shared:
        rows = slice(start, start + len(error.covariance))
        slices.append(rows)
        start = rows.stop
        block = root[rows, rows]
        p, told = _against(z[rows], C[rows, rows])
        sd = np.sqrt(np.diag(block @ C[rows, rows] @ block.T))
        errors.append(CellError(
            error.name, error.meaning or error.name, np.sqrt(np.diag(error.covariance)), block @ z[rows], sd, p, told
        ))  # fmt: skip
    return CellCheck(tuple(errors), _alike(errors, slices, C), _following(state, readings, points, measured))


def _against(z: FloatArray, C: FloatArray) -> tuple[float, float]:
    """P-value of an estimate whose prior is unit normal: its covariance is then what the readings explain of that."""
    explained, axes = np.linalg.eigh(np.eye(len(z)) - C)
    told = explained > _TOLD
    if not told.any():
        return 1.0, float(max(explained.max(), 0.0))
    along = axes[:, told].T @ z
    return chi2_survival(float(np.sum(along**2 / explained[told])), int(told.sum())), float(explained.max())


def _alike(errors: Sequence[CellError], slices: Sequence[slice], C: FloatArray) -> tuple[tuple[str, str, float], ...]:
    """Pairs whose errors go together: the largest canonical correlation after the readings."""
    found = []
    for i, a in enumerate(slices):
        for j in range(i + 1, len(slices)):
            b = slices[j]
            joint = _inverse_root(C[a, a]) @ C[a, b] @ _inverse_root(C[b, b])
            r = float(np.linalg.norm(joint, 2))
            if r > _ALIKE:
                found.append((errors[i].meaning, errors[j].meaning, r))
    return tuple(sorted(found, key=lambda row: -row[2]))


def _inverse_root(C: FloatArray) -> FloatArray:
    values, vectors = np.linalg.eigh(C)
    return np.asarray((vectors / np.sqrt(values.clip(1e-12))) @ vectors.T)


def _following(
    state: SensingState, readings: Readings, before: PointMeasurements, measured: Measured
) -> NextForCell | None:
    """Of readings at places of the part, with the hand as it was and turned, the one that tells most of the errors."""
    mode, target = state.modes[0], state.target(0)
    D = sum(len(e.covariance) for e in before.shared)
    C = np.asarray(np.linalg.pinv(mode.information, hermitian=True))[
        : 6 + D, : 6 + D
    ]  # behind it may be the noise scale
    step = max(1, len(target.samples) // _PLACES)
    places, outward, faces = target.samples[::step], target.normals[::step], target.sample_faces[::step]
    world, normals = SE3.apply(mode.T_peak, places), outward @ mode.T_peak[:3, :3].T
    best: NextForCell | None = None
    axes = SO3.frame_from_axis(-normals, 2)
    for column, turn in _turns(readings):
        made = measured(_made(readings, before, world, -normals, turn * axes[..., column]))
        J = _rows(made, before, world, places, normals, mode.T_peak)
        variances = np.einsum("ni,nij,nj->n", normals[made.rows], made.covs, normals[made.rows])
        gains = np.array([_told(C, h, v, D) for h, v in zip(J, variances, strict=True)])
        k = int(np.argmax(gains)) if len(gains) else 0
        if len(gains) and gains[k] > (1e-3 if best is None else best.gain):
            row = int(made.rows[k])
            face = target.part.faces[int(faces[row])].name
            best = NextForCell(world[row], -normals[row], face, turn, axes[row, :, column], float(gains[k]))
    return best


def _turns(readings: Readings) -> list[tuple[int, float]]:
    """Turns of the hand: about the approach, its third axis; of a touch, whose hand is free of it, across it too."""
    if not readings.Ts_world_hand.given.any():
        return [(2, 0.0)]
    columns = (2, 0, 1) if readings.points.given.any() else (2,)
    return [(2, 0.0), *((c, 2 * np.pi * k / _TURNS) for c in columns for k in range(1, _TURNS))]


def _told(C: FloatArray, h: FloatArray, variance: float, D: int) -> float:
    """By how much one reading narrows the shared errors, whatever the pose is [nats]."""
    before = C[6 : 6 + D, 6 : 6 + D]
    v = (C @ h)[6 : 6 + D]
    after = before - np.outer(v, v) / (variance + h @ C @ h)
    return float(0.5 * (np.linalg.slogdet(before)[1] - np.linalg.slogdet(after)[1]))


def _made(readings: Readings, before: PointMeasurements, world: Vectors, ways: Vectors, turn: Vectors) -> Readings:
    """Readings at these places: the hand of the one whose approach is nearest, brought there and turned ``(n, 3)``."""
    had = np.where(np.isnan(before.directions), -before.normals, before.directions)
    had = np.where(np.isnan(had), -np.eye(3)[2], had)
    near = np.argmax(ways @ had.T, axis=1)
    rows = before.rows[near]
    axes = np.cross(had[near], ways)
    sines = np.linalg.norm(axes, axis=1, keepdims=True)
    angles = np.arctan2(sines[:, 0], np.sum(had[near] * ways, axis=1))
    turns = SO3.exp(turn) @ SO3.exp(axes / np.maximum(sines, 1e-12) * angles[:, None])
    hands = readings.Ts_world_hand.take(rows)
    held, Ts = hands.given, hands.values
    arms = Ts[:, :3, 3] - before.points[near][held]
    moved = SE3.from_parts(turns[held] @ Ts[:, :3, :3], world[held] + np.einsum("nij,nj->ni", turns[held], arms))
    return Readings.from_columns(
        Column.from_rows(world, readings.points.given[rows]), ids=[f"place {k}" for k in range(len(rows))],
        directions=Column.from_rows(ways, readings.directions.given[rows]), sds=readings.sds.take(rows),
        across_sds=readings.across_sds.take(rows), radii=readings.radii[rows], Ts_world_hand=Column(held, moved),
        ranges=readings.ranges.take(rows),
        sensors=[readings.sensors[k] for k in rows],
    )  # fmt: skip


def _rows(
    made: PointMeasurements, before: PointMeasurements, world: Vectors, places: Vectors, normals: Vectors, T: FloatArray
) -> FloatArray:
    """How pose and shared errors move each reading along the normal ``(n, 6 + D)``; errors are matched by name."""
    n, p = normals[made.rows], places[made.rows]
    pose = -np.einsum("ni,nij->nj", n, T[:3, :3] @ point_moves(p))
    ends = np.cumsum([0, *(len(e.covariance) for e in before.shared)])
    place = {e.name: k for e, k in zip(before.shared, ends, strict=False)}
    gains, out = made.stacked()[0] @ shared_root(made.shared), np.zeros((len(p), int(ends[-1])))
    start = 0
    for error in made.shared:
        size = len(error.covariance)
        if error.name in place:
            to = place[error.name]
            out[:, to : to + size] = np.einsum("ni,nij->nj", n, gains[:, :, start : start + size])
        start += size
    return np.concatenate([pose, out], axis=1)
