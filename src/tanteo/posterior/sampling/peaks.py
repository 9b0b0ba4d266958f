"""Maxima of the posterior of one part: refined, maximized, and each counted once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tanteo import _core
from tanteo.factors import ContactPoints
from tanteo.geometry.special import log_sum, zeta_from_two
from tanteo.geometry.typing import Covariances, FloatArray, Indices, IntArray, Transforms, Vectors
from tanteo.posterior.prepared import PreparedPart
from tanteo.posterior.problem import Problem
from tanteo.posterior.settings import SearchSettings
from tanteo.posterior.symmetry import folded, gauge_information, is_gauge_fixed


def pair_tilt(problem: Problem) -> float:
    """Return the tolerance of a sensed normal against that of a surface place: one step of the spins [rad]."""
    return float(2 * np.pi / problem.settings.search.spins)


@dataclass(frozen=True, slots=True, eq=False)
class Scales:
    """Length scales of the search, from the part and the noise.

    Attributes:
        blur: error of a proposal: the spacing of surface places, or the noise [m].
        refine: scales of the refinement steps, from coarse to that of the first maximization [m].
        blurs: added noise of the maximizations before the last [m].
    """

    blur: float
    refine: FloatArray
    blurs: FloatArray


@dataclass(frozen=True, slots=True)
class PointScales:
    """Length scales of the measurements, equal for all parts.

    Attributes:
        sd: noise along the surface normal [m].
        shared: shift of a point by the shared errors [m].
        spread: size of the region of the points [m]; 0 without points.
        wide: noise of a point and shared errors together [m].
        settings: settings of the search.
    """

    sd: float
    shared: float
    spread: float
    wide: float
    settings: SearchSettings

    def on(self, prepared: PreparedPart) -> Scales:
        """Return the length scales of the search for one part."""
        if not self.spread > 0 and not self.wide > 0:  # free-space rays alone: nothing to refine
            return Scales(prepared.spacing, np.array([prepared.spacing]), np.zeros(0))
        own = self.settings
        blur = max(min(prepared.spacing, self.spread / 8), 1.5 * self.wide)
        end = max(2 * self.sd, self.shared, own.coarse_to_fine * blur)
        count = max(6, int(np.ceil(np.log(1.5 * blur / end) / own.scale_step)) + 1)
        blurs = own.coarse_to_fine * blur * 0.3 ** np.arange(8)
        refine = np.asarray(np.geomspace(1.5 * blur, min(end, blur), count), dtype=np.float64)
        return Scales(blur, refine, np.asarray(blurs[blurs > 2 * self.sd], dtype=np.float64))


def point_scales(problem: Problem) -> PointScales:
    """Return the length scales of the measurements."""
    points, own = problem.points, problem.settings.search
    if not len(points):
        return PointScales(0.0, 0.0, 0.0, 0.0, own)
    sd = float(np.median(points.residual_sd))
    shared = (
        float(np.sqrt(np.mean(np.sum(points.shared_jacobian**2, axis=(1, 2))))) if points.shared_jacobian.size else 0.0
    )
    off = np.linalg.norm(points.points - np.median(points.points, axis=0), axis=1)
    spread = 2 * float(np.quantile(off, 0.75))
    return PointScales(sd, shared, spread, float(np.hypot(np.median(points.sd), shared)), own)


def spread_rows(points: ContactPoints, count: int) -> Indices:
    """Return rows of points that are far from each other, the farthest from the middle first.

    They are chosen from twice as many evenly spaced points. Of all points the farthest would be outliers.
    """
    some = np.arange(min(2 * count, len(points)))
    some = some * len(points) // max(len(some), 1)
    p = points.points[some]
    return (some if len(p) <= count else some[spread_out(p, count)]).astype(np.int32)


def spread_out(p: Vectors, count: int) -> IntArray:
    """Return rows of points that are far from each other, the farthest from their middle first."""
    if not len(p):
        return np.zeros(0, dtype=np.int64)
    chosen = [int(np.argmax(np.linalg.norm(p - p.mean(axis=0), axis=1)))]
    nearest = np.linalg.norm(p - p[chosen[0]], axis=1)
    while len(chosen) < min(count, len(p)):
        nearest[chosen[-1]] = -1.0
        chosen.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.linalg.norm(p - p[chosen[-1]], axis=1))
    return np.array(chosen)


def prior_sds(covariances: Covariances, prepared: PreparedPart) -> FloatArray:
    """Return the principal standard deviations of priors, with turns as shifts at a quarter of the diagonal [m].

    Args:
        covariances: covariances of the pose ``(K, 6, 6)`` [m, rad].
        prepared: the part.
    """
    scale = np.r_[np.ones(3), np.full(3, 0.25 * prepared.part.diagonal)]
    return np.asarray(np.sqrt(np.linalg.eigvalsh(covariances * np.outer(scale, scale))))


def scores_of(
    problem: Problem, core: _core.Problem, prepared: PreparedPart, rows: Indices, Ts: Transforms, scales: Scales
) -> FloatArray:
    """Return a rough robust cost of the distances of some points from the surface at poses ``(S,)``."""
    return np.asarray(
        _core.scores(prepared.shape, core, rows, np.ascontiguousarray(Ts), scales.blur, pair_tilt(problem))
    )


_NO_COST = 1e300
"""Numerical: cost of no pose."""

_ROUNDING = 1e-11
"""Numerical: fraction of an information that is added to its diagonal, so that rounding loses no direction."""


@dataclass(frozen=True, slots=True, eq=False)
class Peaks:
    """Maxima of one part, best first.

    Attributes:
        Ts: poses ``(S, 4, 4)``.
        zs: whitened shared errors, and the noise scale if it is a state ``(S, D)``.
        logs: log densities ``(S,)``.
        information: information on the pose about the centre and on the other states ``(S, 6 + D, 6 + D)``.
        evidence: log of the integral about each maximum by its curvature ``(S,)``.
        groups: independent sources that led to each maximum, one bit each ``(S,)``.
    """

    Ts: Transforms
    zs: FloatArray
    logs: FloatArray
    information: FloatArray
    evidence: FloatArray
    groups: IntArray

    def __len__(self) -> int:
        return len(self.logs)

    @property
    def times(self) -> IntArray:
        """Return the number of sources that led to each maximum ``(S,)``."""
        return np.bitwise_count(self.groups).astype(np.int64)

    def take(self, rows: IntArray) -> Peaks:
        """Return some of the maxima."""
        return Peaks(*(getattr(self, name)[rows] for name in self.__slots__))

    def join(self, other: Peaks) -> Peaks:
        """Return these maxima followed by the other ones."""
        pairs = ((getattr(self, name), getattr(other, name)) for name in self.__slots__)
        return Peaks(*(np.concatenate(pair) for pair in pairs))

    @classmethod
    def none(cls, states: int) -> Peaks:
        """Return no maximum."""
        K = 6 + states
        empty = np.zeros(0)
        return cls(
            np.zeros((0, 4, 4)), np.zeros((0, states)), empty, np.zeros((0, K, K)), empty, np.zeros(0, dtype=np.int64)
        )


def log_missed(log_masses: FloatArray, sources: IntArray) -> float:
    """Return the log of the total mass of the maxima that a search is expected to have missed.

    If sources lead to a maximum at a Poisson rate with a flat prior, and ``c`` sources found it, then

        E[exp(-rate) / (1 - exp(-rate)) | c] = zeta(c + 1) - 1

    others of the same rate were missed (Horvitz and Thompson 1952). These numbers sum to 1 over ``c``. So the mean is
    that of the estimate by maxima with a single source (Good 1953), with less scatter.

    Args:
        log_masses: log masses of the maxima that were found ``(n,)``.
        sources: number of independent sources that led to each; a maximum without a source counts as one with a single
            source ``(n,)``.
    """
    if not len(log_masses):
        return -np.inf
    return float(log_sum(log_masses + np.log(zeta_from_two(np.maximum(sources, 1) + 1.0))))


@dataclass(frozen=True, slots=True, eq=False)
class Objective:
    """Posterior density of one part, and its maximization.

    Attributes:
        prepared: the part.
        core: problem of the part, compiled for the core.
        refining: the same for the refinement of initial poses; a prior pose that fixes no direction at the scale of the
            refinement is excluded, as it draws poses from the surface to its mean.
        problem: the problem.
        scales: length scales of the search.
        rows: rows of the points by which poses are refined.
    """

    prepared: PreparedPart
    core: _core.Problem
    refining: _core.Problem
    problem: Problem
    scales: Scales
    rows: Indices

    @classmethod
    def of(cls, problem: Problem, prepared: PreparedPart, scales: Scales, rows: Indices) -> Objective:
        """Return the objective of a part.

        Args:
            problem: the problem.
            prepared: the part.
            scales: length scales of the search.
            rows: rows of the points by which poses are refined.
        """
        core, known = problem.compiled(prepared), problem.mixture(prepared)
        is_wide = known is not None and prior_sds(known.covariances, prepared).min() > scales.refine[-1]
        refining = problem.compiled(prepared, with_prior=False) if is_wide else core
        return cls(prepared, core, refining, problem, scales, rows)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what copies and other processes need; the problems of the core are compiled again."""
        return Objective.of, (self.problem, self.prepared, self.scales, self.rows)

    @property
    def same(self) -> float:
        """Return the squared Mahalanobis distance within which two maxima are equal."""
        return self.problem.settings.search.notable_sds**2

    @property
    def named(self) -> bool:
        """Return whether a prior pose selects one of several symmetric poses."""
        return self.problem.mixture(self.prepared) is not None

    @property
    def _near(self) -> FloatArray:
        """Return one over the squared shifts and turns within which refined poses are one ``(6,)``."""
        end = float(self.scales.refine[-1])
        turn = end / (0.25 * self.prepared.shape.diagonal)
        return np.r_[np.full(3, end**-2.0), np.full(3, turn**-2.0)]

    def starts_at(self, T: Transforms, known: Transforms) -> bool:
        """Return whether a pose ``(1, 4, 4)`` is one of known ones ``(S, 4, 4)`` for the refinement."""
        Ts = folded(self.prepared, np.ascontiguousarray(known), T, named=self.named)
        x = _core.offsets(T[0], np.ascontiguousarray(Ts), self.prepared.shape.centre)
        return bool((x**2 @ self._near < 1).any())

    def refine(
        self, Ts: Transforms, groups: IntArray, keep: int, known: float = _NO_COST
    ) -> tuple[Transforms, IntArray]:
        """Refine poses on the surface, and return the best distinct ones with the sources that led to each.

        Args:
            Ts: poses ``(S, 4, 4)``.
            groups: sources of each pose, one bit each ``(S,)``.
            keep: largest number of poses that are returned.
            known: cost of a pose of another part; poses whose cost is that of four more outliers are dropped.
        """
        if not len(Ts):
            return Ts, groups
        shape, scales = self.prepared.shape, self.scales.refine
        Ts, costs, rows, *_ = _core.refine_poses(
            shape, self.refining, self.rows, scales, np.ascontiguousarray(Ts), known=known
        )
        order, groups = np.argsort(costs, kind="stable"), groups[rows]
        Ts = np.ascontiguousarray(Ts[order])
        near = np.ascontiguousarray(np.broadcast_to(np.diag(self._near), (len(Ts), 6, 6)))
        kept, who = _core.distinct(Ts, near, 1.0, keep, shape.centre)
        return np.ascontiguousarray(Ts[kept]), _united(groups[order], who.astype(np.int64), len(kept))

    def without_hopeless(
        self, Ts: Transforms, groups: IntArray, known: float = _NO_COST
    ) -> tuple[Transforms, IntArray]:
        """Return the poses near a maximum without those whose cost is that of four more outliers than a known one.

        Args:
            Ts: poses ``(S, 4, 4)``.
            groups: sources of each pose, one bit each ``(S,)``.
            known: cost of a pose of another part.
        """
        if not len(Ts) or known == _NO_COST:
            return np.ascontiguousarray(Ts), groups
        end = self.scales.refine[-1:]
        found = _core.refine_poses(
            self.prepared.shape, self.refining, self.rows, end, np.ascontiguousarray(Ts), known=known
        )
        return np.ascontiguousarray(Ts[found[2]]), groups[found[2]]

    def refined_cost(self, Ts: Transforms, like: Objective) -> float:
        """Return the least cost of poses after refinement by the points and at the last scale of another part.

        Args:
            Ts: poses of this part ``(S, 4, 4)``.
            like: objective of the other part.
        """
        end = like.scales.refine[-1:]
        costs = _core.refine_poses(self.prepared.shape, self.refining, like.rows, end, np.ascontiguousarray(Ts))[1]
        return max(float(costs.min(initial=_NO_COST)), 0.0)  # below zero by rounding

    def maximize(
        self, Ts: Transforms, zs: FloatArray | None = None, groups: IntArray | None = None, *, fine: bool = False
    ) -> Peaks:
        """Return the distinct maxima to which initial poses lead.

        Args:
            Ts: initial poses ``(S, 4, 4)``.
            zs: other states at these poses ``(S, D)``; None for zero.
            groups: sources of each pose, one bit each ``(S,)``; None for no source.
            fine: whether to omit the first maximizations with added noise, for poses near a maximum.
        """
        D, own = self.problem.states, self.problem.settings.search
        if not len(Ts):
            return Peaks.none(D)
        zs, Ts = np.zeros((len(Ts), D)) if zs is None else np.ascontiguousarray(zs), self._likely_images(Ts)
        blurs = np.zeros(0) if fine else self.scales.blurs
        Ts, zs, logs, information, who, _ = _core.maximize(
            self.prepared.shape, self.core, np.ascontiguousarray(Ts), zs, blurs, own.steps, own.step_gain,
            2 * own.drop_gap, self.same / 4,
        )  # fmt: skip
        evidence = logs + 3 * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(self.regular(information))[1]
        groups = np.zeros(len(who), dtype=np.int64) if groups is None else groups
        groups = _united(groups, who.astype(np.int64), len(Ts))
        return self.distinct(Peaks(Ts, zs, logs, information, evidence, groups))

    def regular(self, information: FloatArray) -> FloatArray:
        """Return information with a weak prior on shift and turn, so that free directions stay bounded."""
        out = np.array(information)
        size = 0.25 * self.prepared.part.diagonal
        out[..., range(3), range(3)] += size**-2.0
        out[..., range(3, 6), range(3, 6)] += 0.6**-2.0
        if is_gauge_fixed(self.prepared, named=self.named):
            out[..., :6, :6] += gauge_information(self.prepared)
        diagonal = np.arange(out.shape[-1])
        out[..., diagonal, diagonal] *= 1 + _ROUNDING
        return out

    def of_pose(self, information: FloatArray) -> FloatArray:
        """Return the information on the pose with the other states integrated out ``(S, 6, 6)``."""
        full = self.regular(information)
        if full.shape[-1] == 6:
            return full
        cross = full[..., :6, 6:]
        return np.asarray(full[..., :6, :6] - cross @ np.linalg.solve(full[..., 6:, 6:], np.swapaxes(cross, -1, -2)))

    def distinct(self, peaks: Peaks, count: int = 10**6) -> Peaks:
        """Return the best ``count`` distinct maxima, best first; equal and symmetric maxima unite their sources."""
        if not len(peaks) or (len(peaks) == 1 and not self.named):
            return peaks
        order = np.argsort(-peaks.evidence, kind="stable")
        order = order[peaks.evidence[order] >= peaks.evidence[order[0]] - self.problem.settings.search.drop_gap]
        peaks = peaks.take(order)
        peaks = self._folded(peaks)
        information = np.ascontiguousarray(self.of_pose(peaks.information))
        symmetry, centre = self.prepared.part.symmetry, self.prepared.shape.centre
        turns = np.ascontiguousarray(symmetry.Ts) if symmetry.order > 1 else None
        kept, who = _core.distinct(peaks.Ts, information, self.same, count, centre, turns)
        groups = _united(peaks.groups, who.astype(np.int64), len(kept))
        return replace(peaks.take(kept.astype(np.int64)), groups=groups)

    def _folded(self, peaks: Peaks) -> Peaks:
        """Return poses as the symmetric images nearest to the prior pose; without one, to the first pose."""
        symmetry = self.prepared.part.symmetry
        if symmetry.order == 1 and not is_gauge_fixed(self.prepared, named=self.named):
            return replace(peaks, Ts=np.ascontiguousarray(peaks.Ts))
        Ts = self._likely_images(peaks.Ts) if self.named else folded(self.prepared, peaks.Ts, peaks.Ts[:1], named=False)
        # the axes of the tangent have turned with the pose
        information, turned = np.array(peaks.information), (Ts != peaks.Ts).any(axis=(1, 2))
        information[turned] = _core.slopes(
            self.prepared.shape, self.core, np.ascontiguousarray(Ts[turned]), np.ascontiguousarray(peaks.zs[turned])
        )[2]
        return replace(peaks, Ts=Ts, information=information)

    def _likely_images(self, Ts: Transforms) -> Transforms:
        """Return each pose ``(S, 4, 4)`` as the symmetric image nearest to the prior pose, in its own metric."""
        known, turns = self.problem.mixture(self.prepared), self.prepared.part.symmetry.Ts
        if known is None or len(turns) == 1:
            return Ts
        images = Ts[:, None] @ turns
        nearest = known.squared_distances(images.reshape(-1, 4, 4)).reshape(len(Ts), -1).argmin(axis=1)
        return np.ascontiguousarray(images[np.arange(len(Ts)), nearest])

    def unlike(self, new: Peaks, known: Peaks) -> Peaks:
        """Return the maxima of ``new`` that differ from all of ``known``."""
        if not len(new):
            return new
        Ts = folded(self.prepared, new.Ts, known.Ts, named=self.named)
        information, centre = self.of_pose(known.information), self.prepared.shape.centre
        x = np.stack([_core.offsets(T, Ts, centre) for T in known.Ts])
        gaps = np.einsum("kni,kij,knj->kn", x, information, x)
        return new.take(np.flatnonzero(gaps.min(axis=0) > self.same))

    def merged(self, old: Peaks, new: Peaks, count: int) -> Peaks:
        """Return the best ``count`` distinct maxima of both sets, with the sources of both."""
        return self.distinct(old.join(new), count)


def _united(groups: IntArray, who: IntArray, count: int) -> IntArray:
    """Return the sources of all maxima that are equal ``(count,)``."""
    out = np.zeros(count, dtype=np.int64)
    known = who >= 0
    np.bitwise_or.at(out, who[known], groups[known])
    return out
