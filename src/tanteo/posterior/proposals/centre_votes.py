"""Bounds and poses of very many parts from sensed centres: missing holes and bosses, then poses of seeds.

Each centre needs a hole of its radius, and each two centres a pair of axes at their distance. Three centres, or fewer
with planes or sensed axes, fix a pose. At this pose all centres and planes are compared with the part.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.factors import ContactPoints
from tanteo.geometry.typing import BoolArray, FloatArray, Indices, IntArray, Transforms
from tanteo.posterior.candidates import Candidates
from tanteo.posterior.furniture_points import outlier_log_density
from tanteo.posterior.problem import Problem
from tanteo.posterior.proposals.centre_triples import sensed_sizes
from tanteo.posterior.proposals.plane_votes import cost_margin
from tanteo.posterior.proposals.pose_seeds import Seeds
from tanteo.posterior.proposals.sensed_planes import SensedPlanes
from tanteo.posterior.sampling.peaks import spread_out
from tanteo.posterior.settings import DEFAULTS, SearchSettings, Settings

_COLUMNS = ("axes", "planes", "rounds")
"""Columns of a catalogue that are read."""


@dataclass(frozen=True, slots=True, eq=False)
class SensedCentres:
    """Sensed centres and planes as the core compares them.

    Attributes:
        rows: place, axis or zero, sd of the place [m], sd of the axis [rad], radius [m] or half angle [rad] or 0, its
            sd, cost without an axis [nats], side, and kind of each centre ``(n, 13)``.
        planes: planes as the core compares them, numbered after the centres ``(k, 12)``.
        seeds: tuples that fix poses; no centre or plane is in every tuple ``(m, 3)``.
        more: further tuples, so that no two centres or planes are in every tuple ``(q, 3)``.
        certain: whether the tuples fix poses.
        settings: settings of the inference.
    """

    rows: FloatArray
    planes: FloatArray
    seeds: Indices
    more: Indices
    certain: bool
    settings: Settings = DEFAULTS

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def _dearest(self) -> float:
        return float(np.max(np.r_[self.rows[:, 10], self.planes[:, 9]], initial=0.0))

    @property
    def doubtful(self) -> float:
        """Return the cost of the best part from which further seeds are tried [nats]: more than one outlier."""
        return 1.2 * self._dearest

    @property
    def hopeless(self) -> float:
        """Return the cost of the best part from which no seed is right [nats]: more than two outliers."""
        return 2.2 * self._dearest


def sensed_centres(problem: Problem, points: ContactPoints, planes: SensedPlanes) -> SensedCentres:
    """Return the sensed centres among the points, with the largest noise that is probable."""
    own = points.take(np.flatnonzero(points.centres))
    search = problem.settings.search
    own = own.take(spread_out(own.points, search.compared))
    factor = float(np.exp(search.noise_fraction * problem.scale_sd))
    shared = float(np.sqrt(np.sum(points.shared_jacobian**2) / max(len(points), 1)))
    sizes, size_sds, sides = sensed_sizes(own)
    codes = _core.landmark_codes()
    kinds = np.array([codes[factor.core] for factor in own.factors], dtype=np.float64)
    rows = np.column_stack(
        [
            own.landmarks,
            own.normals,
            np.sqrt((factor * own.sd) ** 2 + shared**2 + search.as_made**2),
            factor * own.normal_sds,
            sizes,
            np.where(sizes > 0, factor * size_sds, 1.0),
            _without_axis(problem, own, factor),
            sides,
            kinds,
        ]
    )
    seeds = Seeds(search, rows, planes.rows, ~_lonely(search, planes.rows)).chosen()
    return SensedCentres(np.ascontiguousarray(rows), planes.rows, *seeds, problem.settings)


def _lonely(own: SearchSettings, planes: FloatArray) -> BoolArray:
    """Return which planes are a single normal without a parallel one ``(k,)``; it may be on a curved face."""
    sines = np.linalg.norm(np.cross(planes[:, None, :3], planes[:, :3]), axis=-1)
    near = sines < own.gate * np.hypot(planes[:, None, 7], planes[:, 7]) + own.tilt_as_made
    return np.asarray((planes[:, 11] > 0) & (near.sum(axis=1) < 2))


def _without_axis(problem: Problem, own: ContactPoints, factor: float) -> FloatArray:
    """Return the cost of each centre if no axis of the part explains it ``(n,)`` [nats]."""
    rate, (sizes, size_sds, _) = problem.priors.outlier_rate, sensed_sizes(own)
    line = np.array([factor.codimension == 2 for factor in own.factors], dtype=bool)
    log_across = -0.5 * np.log(2 * np.pi) - np.log(factor * own.sd)
    peak = np.where(line, 2 * log_across - np.log(4 * problem.priors.radius), 3 * log_across) - np.log(
        problem.settings.search.holes
    )
    peak += np.where(sizes > 0, -0.5 * np.log(2 * np.pi) - np.log(np.where(sizes > 0, size_sds, 1.0)), 0.0)
    elsewhere = outlier_log_density(own, problem.priors) + np.where(own.oriented, np.log(4 * np.pi), 0.0)
    return np.asarray(
        (peak - elsewhere + np.log1p(-rate) - np.log(rate)).clip(
            problem.settings.search.cost_least, problem.settings.search.negligible
        )
    )


def lacking(sensed: SensedCentres, candidates: Candidates, rows: IntArray) -> FloatArray:
    """Return the cost of parts that lack axes for single centres or pairs of centres ``(m,)`` [nats]."""
    costs = np.zeros(len(rows))
    for start, table in candidates.tables:
        here = np.flatnonzero((rows >= start) & (rows < start + len(table["numbers"])))
        local = (rows[here] - start).astype(np.int32)
        axes, starts = np.asarray(table["axes"]).ravel(), np.asarray(table["axes_start"])
        costs[here] = _core.axes_lack(axes, starts, local, sensed.rows)
    return costs


def on_axes(
    sensed: SensedCentres, candidates: Candidates, rows: IntArray, costs: FloatArray, poses: dict[int, Transforms]
) -> None:
    """Raise the costs of parts by poses that fit centres and planes together, and store poses of cheap parts.

    Args:
        sensed: centres and planes.
        candidates: all parts.
        rows: rows of the parts ``(m,)``.
        costs: smallest cost of each part so far ``(m,)`` [nats]; raised in place.
        poses: poses of parts so far, by row; extended in place.
    """
    known = costs.copy()
    _by_seeds(sensed, sensed.seeds, candidates, rows, costs, poses)
    if costs.min(initial=sensed.settings.search.cost_limit) > sensed.doubtful and len(sensed.more):
        costs[:] = known
        _by_seeds(sensed, np.concatenate([sensed.seeds, sensed.more]), candidates, rows, costs, poses)


def _by_seeds(
    sensed: SensedCentres, seeds: Indices, candidates: Candidates, rows: IntArray, costs: FloatArray,
    poses: dict[int, Transforms],
) -> None:  # fmt: skip
    """Try poses on the cheapest parts, then on all parts within a margin of their cost."""
    known = costs.copy()
    some = known <= known.min(initial=sensed.settings.search.cost_limit) + 1.0
    lowest = _tried(sensed, seeds, candidates, rows, some, costs, poses)
    _tried(sensed, seeds, candidates, rows, ~some & (known < lowest + cost_margin(sensed.settings)), costs, poses)


def _tried(
    sensed: SensedCentres, seeds: Indices, candidates: Candidates, rows: IntArray, some: BoolArray, costs: FloatArray,
    poses: dict[int, Transforms],
) -> float:  # fmt: skip
    """Try poses on some parts, set their costs and poses, and return the least cost [nats]."""
    none, far, nowhere = sensed.settings.search.cost_limit, 2 * cost_margin(sensed.settings), np.zeros((0, 4, 4))
    lowest = none
    for start, table in candidates.tables:
        here = np.flatnonzero(some & (rows >= start) & (rows < start + len(table["numbers"])))
        before = [poses.get(int(row), nowhere) for row in rows[here]]
        limit = min(none, lowest + far)
        axes, planes, rounds = (np.asarray(table[name]).ravel() for name in _COLUMNS)
        starts = [np.asarray(table[f"{name}_start"]) for name in _COLUMNS]
        found, Ts, whole = _core.on_axes(
            axes, starts[0], planes, starts[1], rounds, starts[2], np.ascontiguousarray(table["numbers"][:, 16]),
            (rows[here] - start).astype(np.int32), sensed.rows, sensed.planes, seeds.ravel(),
            np.ascontiguousarray(np.concatenate([nowhere, *before])),
            np.cumsum([0, *map(len, before)]).astype(np.int32), limit, far, sensed.settings.search.kept,
        )  # fmt: skip
        at_least = np.where(whole > 0, found[:, 0], 0.0)  # others may have poses that were not tried
        costs[here] = np.maximum(at_least, costs[here])
        lowest = min(lowest, float(found.min(initial=none)))
        for k in np.flatnonzero(found[:, 0] < limit):
            poses[int(rows[here[k]])] = Ts[k][found[k] < limit]
    return lowest
