"""Sensed centres against the holes and bosses of very many parts: what they lack, then poses of few centres and planes.

Each centre needs a hole of its radius, each two a pair of axes that are as far apart as they can be. Three centres, or
fewer with planes or sensed axes, fix a pose, at which all centres and planes are compared with the part.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.inference.around import outlier_log_density
from tanteo.inference.candidates import Candidates
from tanteo.inference.hole_tuples import sensed_sizes
from tanteo.inference.plane_votes import BEHIND, LIMIT
from tanteo.inference.pose_seeds import Seeds, spread_out
from tanteo.inference.problem import Problem
from tanteo.inference.sensed_planes import SensedPlanes
from tanteo.measurements import ContactPoints
from tanteo.typing import BoolArray, FloatArray, Indices, IntArray, Transforms

_WIDER, _MADE = 0.6, 5e-5
"""Of the log of the factor to which the noise is known: so much larger it is taken to be; and holes are not made where
they are drawn [m]."""

_MOST, _LEAST, _HOLES = 13.0, 2.0, 20
"""Nats that a centre of no axis costs: what it does by the outlier rate on a part of so many holes, within limits."""

_COMPARED = 12
"""Centres that are compared, far from each other."""

_SDS, _TILT = 4.0, 0.004
"""Normals are parallel within so many standard deviations and so much more [rad]."""

_COLUMNS, _NONE = ("axes", "planes", "rounds"), np.zeros((0, 4, 4))
"""Columns of a catalogue that are read; poses of a part of which none are known."""

_FAR, _KEPT = 16.0, 8
"""Nats behind the best at which poses of a part are given up; poses of a part."""


@dataclass(frozen=True, slots=True, eq=False)
class SensedCentres:
    """Centres as the core compares them, and with which planes.

    Attributes:
        rows: place, axis or zero, sd of the place [m], of the axis [rad], radius [m] or half angle [rad] or 0, its sd,
            nats without an axis, side, kind of point ``(n, 13)``.
        planes: as the core compares them, counted after the centres ``(k, 12)``.
        seeds: of which poses are made, none of which needs what all others need ``(m, 3)``.
        more: others, without each two.
        certain: whether these fix poses.
    """

    rows: FloatArray
    planes: FloatArray
    seeds: Indices
    more: Indices
    certain: bool

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def _dearest(self) -> float:
        return float(np.max(np.r_[self.rows[:, 10], self.planes[:, 9]], initial=0.0))

    @property
    def doubtful(self) -> float:
        """Nats of the best part from which other seeds are tried: more than those of one outlier."""
        return 1.2 * self._dearest

    @property
    def hopeless(self) -> float:
        """Nats of the best part from which none of them is what was sensed: more than those of two outliers."""
        return 2.2 * self._dearest


def sensed_centres(problem: Problem, points: ContactPoints, planes: SensedPlanes) -> SensedCentres:
    """The centres among the points, with their noise as large as it may be."""
    own = points.take(np.flatnonzero(points.centres))
    own = own.take(spread_out(own.points, _COMPARED))
    factor = float(np.exp(_WIDER * problem.scale_sd))
    shared = float(np.sqrt(np.sum(points.shared_jacobian**2) / max(len(points), 1)))
    sizes, size_sds, sides = sensed_sizes(own)
    codes = _core.landmark_codes()
    kinds = np.array([codes[factor.core] for factor in own.factors], dtype=np.float64)
    rows = np.column_stack(
        [
            own.landmarks,
            own.normals,
            np.sqrt((factor * own.sd) ** 2 + shared**2 + _MADE**2),
            factor * own.normal_sds,
            sizes,
            np.where(sizes > 0, factor * size_sds, 1.0),
            _without_axis(problem, own, factor),
            sides,
            kinds,
        ]
    )
    seeds = Seeds(rows, planes.rows, ~_lonely(planes.rows)).chosen()
    return SensedCentres(np.ascontiguousarray(rows), planes.rows, *seeds)


def _lonely(planes: FloatArray) -> BoolArray:
    """Which are one sensed normal that no other one is parallel to ``(k,)``: it may be of a curved face."""
    sines = np.linalg.norm(np.cross(planes[:, None, :3], planes[:, :3]), axis=-1)
    near = sines < _SDS * np.hypot(planes[:, None, 7], planes[:, 7]) + _TILT
    return np.asarray((planes[:, 11] > 0) & (near.sum(axis=1) < 2))


def _without_axis(problem: Problem, own: ContactPoints, factor: float) -> FloatArray:
    """Nats that a centre costs if it is of no axis ``(n,)``."""
    rate, (sizes, size_sds, _) = problem.priors.outlier_rate, sensed_sizes(own)
    line = np.array([factor.codimension == 2 for factor in own.factors], dtype=bool)
    log_across = -0.5 * np.log(2 * np.pi) - np.log(factor * own.sd)
    peak = np.where(line, 2 * log_across - np.log(4 * problem.priors.radius), 3 * log_across) - np.log(_HOLES)
    peak += np.where(sizes > 0, -0.5 * np.log(2 * np.pi) - np.log(np.where(sizes > 0, size_sds, 1.0)), 0.0)
    elsewhere = outlier_log_density(own, problem.priors) + np.where(own.oriented, np.log(4 * np.pi), 0.0)
    return np.asarray((peak - elsewhere + np.log1p(-rate) - np.log(rate)).clip(_LEAST, _MOST))


def lacking(sensed: SensedCentres, candidates: Candidates, rows: IntArray) -> FloatArray:
    """Nats of some parts by the axes that each and each two centres need ``(m,)``."""
    costs = np.zeros(len(rows))
    for start, table in candidates.tables:
        here = np.flatnonzero((rows >= start) & (rows < start + len(table["numbers"])))
        local = (rows[here] - start).astype(np.int32)
        axes, starts = np.asarray(table["axes"]).ravel(), np.asarray(table["axes_start"])
        costs[here] = _core.axes_lack(axes, starts, local, sensed.rows)
    return costs


def on_axes(
    sensed: SensedCentres, candidates: Candidates, rows: IntArray, costs: FloatArray, hints: dict[int, Transforms]
) -> None:
    """Nats of some parts and poses of those where it is little, by centres and planes together.

    Args:
        sensed: centres and planes.
        candidates: all parts.
        rows: of them.
        costs: nats that each costs at least so far ``(m,)``; they become more.
        hints: poses so far, by row; they become better.
    """
    known = costs.copy()
    _by_seeds(sensed, sensed.seeds, candidates, rows, costs, hints)
    if costs.min(initial=LIMIT) > sensed.doubtful and len(sensed.more):
        costs[:] = known
        _by_seeds(sensed, np.concatenate([sensed.seeds, sensed.more]), candidates, rows, costs, hints)


def _by_seeds(
    sensed: SensedCentres, seeds: Indices, candidates: Candidates, rows: IntArray, costs: FloatArray,
    hints: dict[int, Transforms],
) -> None:  # fmt: skip
    """Poses are tried on those that lack least, then on all that are not far behind what these cost."""
    known = costs.copy()
    some = known <= known.min(initial=LIMIT) + 1.0
    lowest = _tried(sensed, seeds, candidates, rows, some, costs, hints)
    _tried(sensed, seeds, candidates, rows, ~some & (known < lowest + BEHIND), costs, hints)


def _tried(
    sensed: SensedCentres, seeds: Indices, candidates: Candidates, rows: IntArray, some: BoolArray, costs: FloatArray,
    hints: dict[int, Transforms],
) -> float:  # fmt: skip
    """Poses are tried on some parts, whose nats and hints are set; the least of all nats."""
    lowest = LIMIT
    for start, table in candidates.tables:
        here = np.flatnonzero(some & (rows >= start) & (rows < start + len(table["numbers"])))
        before = [hints.get(int(row), _NONE) for row in rows[here]]
        limit = min(LIMIT, lowest + _FAR)
        axes, planes, rounds = (np.asarray(table[name]).ravel() for name in _COLUMNS)
        starts = [np.asarray(table[f"{name}_start"]) for name in _COLUMNS]
        found, Ts, whole = _core.on_axes(
            axes, starts[0], planes, starts[1], rounds, starts[2], np.ascontiguousarray(table["numbers"][:, 16]),
            (rows[here] - start).astype(np.int32), sensed.rows, sensed.planes, seeds.ravel(),
            np.ascontiguousarray(np.concatenate([_NONE, *before])),
            np.cumsum([0, *map(len, before)]).astype(np.int32), limit, _FAR, _KEPT,
        )  # fmt: skip
        at_least = np.where(whole > 0, found[:, 0], 0.0)  # others may have poses that were not tried
        costs[here] = np.maximum(at_least, costs[here])
        lowest = min(lowest, float(found.min(initial=LIMIT)))
        for k in np.flatnonzero(found[:, 0] < limit):
            hints[int(rows[here[k]])] = Ts[k][found[k] < limit]
    return lowest
