"""Check of a robot cell by readings of a known part, which estimate its shared errors together with the pose.

Shared errors are those of tip offset, sensor mounting, robot base and bias. For each of them the result has an
estimate, a test of its stated standard deviation, and the errors that the readings cannot separate from it. It also
proposes the reading with the most information about the errors.
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
from tanteo.posterior.answers import point_moves
from tanteo.sensors import Column, PointMeasurements, Readings

Measured = Callable[[Readings], PointMeasurements]
"""Function that converts readings into measurements in the world frame."""

_EXPLAINED = 0.05
"""Smallest fraction of a component's stated variance that the readings must remove before the component is tested."""
_CORRELATED = 0.7
"""Canonical correlation above which the readings do not separate two errors."""
_PLACES, _TURNS = 60, 4
"""Numbers of surface points of the part, and of rotations of the hand, among which the next reading is chosen."""


@dataclass(frozen=True, slots=True, eq=False)
class CellError:
    """Estimate of one shared error.

    Attributes:
        name: name of the error.
        meaning: description of the error.
        stated: stated standard deviations ``(d,)`` [m, rad; a scale has no unit].
        estimate: posterior mean ``(d,)``.
        sd: posterior standard deviation ``(d,)``.
        p_value: p-value of the estimate under the stated standard deviations; 1 if the readings do not determine it.
        explained: largest fraction of a component's stated variance that the readings remove.
    """

    name: str
    meaning: str
    stated: FloatArray
    estimate: FloatArray
    sd: FloatArray
    p_value: float
    explained: float

    @property
    def contradicted(self) -> bool:
        """Whether the readings contradict the stated standard deviations."""
        return self.p_value < SIGNIFICANCE


@dataclass(frozen=True, slots=True, eq=False)
class NextForCell:
    """Reading with the most information about the shared errors.

    Attributes:
        point: point on the part to sense, world frame ``(3,)`` [m].
        direction: unit direction of the approach, world frame ``(3,)``.
        face: name of the face.
        turn: angle by which to rotate the hand from its earlier attitude [rad].
        axis: axis of that rotation, world frame ``(3,)``.
        gain: expected information about the errors [nats].
    """

    point: Vectors
    direction: Vectors
    face: str
    turn: float
    axis: Vectors
    gain: float


@dataclass(frozen=True, slots=True, eq=False)
class CellCheck:
    """Result of the check of a cell.

    Attributes:
        errors: estimate of each shared error, in the order of the measurements.
        correlated: pairs of errors that the readings do not separate, by their meaning, with their canonical
            correlation.
        following: reading with the most information about the errors; None if no reading has any.
    """

    errors: tuple[CellError, ...]
    correlated: tuple[tuple[str, str, float], ...]
    following: NextForCell | None


def check_cell(state: SensingState, readings: Readings, measured: Measured) -> CellCheck:
    """Estimate the shared errors of a robot cell from readings of a part, and test their stated deviations.

    Args:
        state: posterior of a session with these readings.
        readings: readings of the part.
        measured: function that converts readings into measurements with shared errors.

    Raises:
        InputError: no part explains the readings, or the measurements have no shared error.
    """
    points = measured(readings)
    if not state.modes:
        raise InputError(
            "check-cell: expected readings of the part, got readings that the part does not explain. Check them first."
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
        p, explained = _test_of_prior(z[rows], C[rows, rows])
        sd = np.sqrt(np.diag(block @ C[rows, rows] @ block.T))
        errors.append(CellError(
            error.name, error.meaning or error.name, np.sqrt(np.diag(error.covariance)), block @ z[rows], sd, p,
            explained,
        ))  # fmt: skip
    return CellCheck(tuple(errors), _correlated(errors, slices, C), _following(state, readings, points, measured))


def _test_of_prior(z: FloatArray, C: FloatArray) -> tuple[float, float]:
    """Return the p-value of an estimate under a unit normal prior, and the largest fraction of variance removed."""
    explained, axes = np.linalg.eigh(np.eye(len(z)) - C)
    enough = explained > _EXPLAINED
    if not enough.any():
        return 1.0, float(max(explained.max(), 0.0))
    along = axes[:, enough].T @ z
    return chi2_survival(float(np.sum(along**2 / explained[enough])), int(enough.sum())), float(explained.max())


def _correlated(
    errors: Sequence[CellError], slices: Sequence[slice], C: FloatArray
) -> tuple[tuple[str, str, float], ...]:
    """Return pairs of errors with a large canonical correlation after the readings, largest first."""
    found = []
    for i, a in enumerate(slices):
        for j in range(i + 1, len(slices)):
            b = slices[j]
            joint = _inverse_root(C[a, a]) @ C[a, b] @ _inverse_root(C[b, b])
            r = float(np.linalg.norm(joint, 2))
            if r > _CORRELATED:
                found.append((errors[i].meaning, errors[j].meaning, r))
    return tuple(sorted(found, key=lambda row: -row[2]))


def _inverse_root(C: FloatArray) -> FloatArray:
    values, vectors = np.linalg.eigh(C)
    return np.asarray((vectors / np.sqrt(values.clip(1e-12))) @ vectors.T)


def _following(
    state: SensingState, readings: Readings, before: PointMeasurements, measured: Measured
) -> NextForCell | None:
    """Return the reading with the most information about the errors, over places and rotations of the hand."""
    mode, target = state.modes[0], state.target(0)
    D = sum(len(e.covariance) for e in before.shared)
    C = np.asarray(np.linalg.pinv(mode.information, hermitian=True))[: 6 + D, : 6 + D]  # the noise scale may follow
    step = max(1, len(target.samples) // _PLACES)
    places, outward, faces = target.samples[::step], target.normals[::step], target.sample_faces[::step]
    world, normals = SE3.apply(mode.T_peak, places), outward @ mode.T_peak[:3, :3].T
    best: NextForCell | None = None
    axes = SO3.frame_from_axis(-normals, 2)
    for column, turn in _turns(readings):
        made = measured(_made(readings, before, world, -normals, turn * axes[..., column]))
        J = _rows(made, before, world, places, normals, mode.T_peak)
        variances = np.einsum("ni,nij,nj->n", normals[made.rows], made.covs, normals[made.rows])
        gains = np.array([_information(C, h, v, D) for h, v in zip(J, variances, strict=True)])
        k = int(np.argmax(gains)) if len(gains) else 0
        if len(gains) and gains[k] > (1e-3 if best is None else best.gain):
            row = int(made.rows[k])
            face = target.part.faces[int(faces[row])].name
            best = NextForCell(world[row], -normals[row], face, turn, axes[row, :, column], float(gains[k]))
    return best


def _turns(readings: Readings) -> list[tuple[int, float]]:
    """Return the axis and angle of each rotation of the hand to try: about the approach; for touches about all axes."""
    if not readings.Ts_world_hand.given.any():
        return [(2, 0.0)]
    columns = (2, 0, 1) if readings.points.given.any() else (2,)
    return [(2, 0.0), *((c, 2 * np.pi * k / _TURNS) for c in columns for k in range(1, _TURNS))]


def _information(C: FloatArray, h: FloatArray, variance: float, D: int) -> float:
    """Return the information of one reading about the shared errors with the pose marginalized [nats]."""
    before = C[6 : 6 + D, 6 : 6 + D]
    v = (C @ h)[6 : 6 + D]
    after = before - np.outer(v, v) / (variance + h @ C @ h)
    return float(0.5 * (np.linalg.slogdet(before)[1] - np.linalg.slogdet(after)[1]))


def _made(
    readings: Readings, before: PointMeasurements, world: Vectors, directions: Vectors, turn: Vectors
) -> Readings:
    """Return readings at given points, with the hand of the earlier reading whose approach is most similar.

    Args:
        readings: earlier readings.
        before: measurements of them.
        world: points, world frame ``(n, 3)`` [m].
        directions: unit directions of the approach, world frame ``(n, 3)``.
        turn: further rotation of the hand, rotation vectors in the world frame ``(n, 3)`` [rad].
    """
    earlier = np.where(np.isnan(before.directions), -before.normals, before.directions)
    earlier = np.where(np.isnan(earlier), -np.eye(3)[2], earlier)
    near = np.argmax(directions @ earlier.T, axis=1)
    rows = before.rows[near]
    axes = np.cross(earlier[near], directions)
    sines = np.linalg.norm(axes, axis=1, keepdims=True)
    angles = np.arctan2(sines[:, 0], np.sum(earlier[near] * directions, axis=1))
    turns = SO3.exp(turn) @ SO3.exp(axes / np.maximum(sines, 1e-12) * angles[:, None])
    hands = readings.Ts_world_hand.take(rows)
    has_hand, Ts = hands.given, hands.values
    arms = Ts[:, :3, 3] - before.points[near][has_hand]
    moved = SE3.from_parts(
        turns[has_hand] @ Ts[:, :3, :3], world[has_hand] + np.einsum("nij,nj->ni", turns[has_hand], arms)
    )
    return Readings.from_columns(
        Column.from_rows(world, readings.points.given[rows]), ids=[f"place {k}" for k in range(len(rows))],
        directions=Column.from_rows(directions, readings.directions.given[rows]), sds=readings.sds.take(rows),
        across_sds=readings.across_sds.take(rows), radii=readings.radii[rows], Ts_world_hand=Column(has_hand, moved),
        ranges=readings.ranges.take(rows),
        sensors=[readings.sensors[k] for k in rows],
    )  # fmt: skip


def _rows(
    made: PointMeasurements, before: PointMeasurements, world: Vectors, places: Vectors, normals: Vectors, T: FloatArray
) -> FloatArray:
    """Return the Jacobian of each reading along the normal over pose and shared errors ``(n, 6 + D)``."""
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
