"""Modes of the posterior: regions of poses of one part, from samples about its maxima."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.geometry.limits import NOTABLE
from tanteo.geometry.special import chi2_quantile
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, IntArray, Transforms
from tanteo.posterior.answers.pose_prior import in_box
from tanteo.posterior.prepared import PreparedPart
from tanteo.posterior.sampling.control_variate import ControlVariate
from tanteo.posterior.sampling.peaks import Objective
from tanteo.posterior.sampling.ridges import VALLEY, Paths, follow, log_tops
from tanteo.posterior.sampling.sampler import Sampler
from tanteo.posterior.sampling.widths import roots
from tanteo.posterior.settings import POSE_DOF
from tanteo.posterior.symmetry import folded


@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """Region of poses of one part.

    Attributes:
        objective: the part and the problem, compiled.
        T_world_part: mean pose ``(4, 4)``; the best maximum if the region has several.
        covariance: covariance of the samples about it ``(6, 6)``, order x y z rx ry rz, part frame, right perturbation
            [m, rad].
        T_peak: the best maximum ``(4, 4)``.
        z: shared errors, and the noise scale if it is a state, at the best maximum ``(D,)``.
        information: information on pose and other states at the maximum, part frame ``(6 + D, 6 + D)``.
        log_mass: log-evidence, prior of the part included.
        probability: posterior probability.
        Ts: samples ``(N, 4, 4)``; the maximum alone if the mode was too improbable for sampling.
        weights: weights of the samples, which sum to one ``(N,)``.
        ess: effective sample size of the covariance.
        normal: whether the density of the region is normal with the curvature of its maximum.
        maxima: number of maxima in the region.
        sources: number of independent sources that led to one of them.
    """

    objective: Objective
    T_world_part: Transforms
    covariance: Covariances
    T_peak: Transforms
    z: FloatArray
    information: FloatArray
    log_mass: float
    probability: float
    Ts: Transforms
    weights: FloatArray
    ess: float
    normal: bool
    maxima: int = 1
    sources: int = 0

    @property
    def prepared(self) -> PreparedPart:
        """Return the part."""
        return self.objective.prepared


def modes_of(sampler: Sampler, least: float = -np.inf) -> list[Mode]:
    """Return the modes of one part; maxima that a path without a valley joins are one mode.

    Where the measurements are too few for a pose, so are maxima that share samples or lie in each other's region.

    Args:
        sampler: samples of the part.
        least: log mass below which a mode keeps the shape of its curvature: its samples give the mass alone.
    """
    mass, _ = sampler.masses()
    sampled = np.isfinite(mass)
    if not sampled.any():
        return []
    W = sampler.weights(float(sampler.log_weights.max()))[:, None] * sampler.shares
    sums = W.sum(axis=0)
    inside = _inside(sampler)
    together = np.zeros_like(inside) if sampler.fixes_pose else (common_samples(sampler) | inside) & sampled
    top, out = float(sampler.log_weights.max()), []
    curved = from_centre(sampler.objective, sampler.objective.of_pose(sampler.peaks.information))
    for rows in _without_valleys(
        sampler, np.flatnonzero(sampled), regions_of(sampler, together & sampled[:, None]), least
    ):
        if not sampled[rows].any():
            continue
        log_mass = float(mass[rows[0]]) if len(rows) == 1 else float(np.log(sums[rows].sum())) + top
        out.append(_mode(sampler, rows, W) if log_mass > least else _by_curvature(sampler, rows, log_mass, curved))
    apart = (sampler.counts() == 0) & ~inside[sampled].any(axis=0)  # maxima in a sampled region are part of that mode
    masses = sampler.peaks.evidence + sampler.log_constant
    return out + [_by_curvature(sampler, k, float(masses[k[0]]), curved) for k in np.flatnonzero(apart)[:, None]]


def common_samples(sampler: Sampler) -> BoolArray:
    """Return which maxima share a notable fraction of their weighted samples ``(m, m)``.

    First components along bent ridges are wide and reach other ridges, so those in pieces do not count if there are
    enough measurements for a pose.
    """
    W = sampler.weights(float(sampler.log_weights.max()))[:, None] * sampler.shares
    sums = W.sum(axis=0)
    common = np.stack([W[rows, k] @ sampler.shares[rows] for k, rows in enumerate(map(np.flatnonzero, W.T))])
    if sampler.fixes_pose:
        common[sampler.in_pieces], common[:, sampler.in_pieces] = 0.0, 0.0
    return np.asarray(common > sampler.settings.min_fraction * np.minimum(sums[:, None], sums))


def regions_of(sampler: Sampler, together: BoolArray) -> list[IntArray]:
    """Return the regions of the maxima of a part, in the order of their first members.

    Maxima that are together are one region. A maximum with a small fraction of the mass of each of two regions joins
    one of them, and does not unite them: by chance a search finds it, or not.

    Args:
        sampler: samples of the part.
        together: which maxima are one region ``(m, m)``.
    """
    mass, _ = sampler.masses()
    p = np.exp(mass - mass.max()) if np.isfinite(mass).any() else np.zeros(len(mass))
    either, regions = together | together.T, list[list[int]]()
    for k in np.argsort(-p, kind="stable"):
        near = sorted((one for one in regions if either[k, one].any()), key=lambda one: -float(p[one].sum()))
        own = near[0] if near else []
        for one in near[1:]:
            if p[k] > sampler.settings.min_fraction * p[one].sum():
                own.extend(one)
                regions = [other for other in regions if other is not one]
        own.append(int(k))
        regions = regions if near else [*regions, own]
    return sorted((np.sort(one) for one in regions), key=lambda one: int(one[0]))


def _without_valleys(sampler: Sampler, rows: IntArray, regions: Sequence[IntArray], mass: float) -> list[IntArray]:
    """Return the regions of the maxima of a part, those united that a path joins without a valley.

    A valley is outside of the 95 % region of the lower maximum if that were normal. Highest paths unite first, so a
    maximum beside a pass is part of one side and does not unite both (persistence of maxima: Chazal, Guibas, Oudot and
    Skraba 2013). A round face of facets has a maximum on each facet, but turns about it are one region. If there are
    enough measurements for a pose, paths follow ridges that are bent: of each two regions the shortest path between
    probable maxima, and that between the most probable ones. Samples in common do not unite maxima there, since their
    components are wide.

    Args:
        sampler: samples of the part.
        rows: the maxima that have samples ``(R,)``.
        regions: regions of the maxima by their samples.
        mass: log mass below which a maximum is not probable.
    """
    peaks, objective = sampler.peaks, sampler.objective
    region = np.zeros(len(peaks), dtype=np.int64)
    for k, one in enumerate(regions):
        region[one] = k
    first, second = (rows[k] for k in np.triu_indices(len(rows), 1))
    apart = region[first] != region[second]
    first, second = first[apart], second[apart]
    if not len(first):
        return list(regions)
    tops = np.full(len(peaks), -np.inf)
    tops[rows] = log_tops(objective, peaks.take(rows))

    def limits(pairs: IntArray) -> FloatArray:
        """Return below which log density a path of some pairs is in a valley."""
        top = np.full(len(regions), -np.inf)
        np.maximum.at(top, region, tops)
        return np.asarray(np.minimum(top[region[first[pairs]]], top[region[second[pairs]]]) - VALLEY)

    def unite(pairs: IntArray, lowest: FloatArray) -> None:
        """Unite the regions at the ends of some pairs, by the smallest log density between these."""
        heights = np.minimum(lowest, np.minimum(tops[first[pairs]], tops[second[pairs]]))
        for k in np.argsort(-lowest, kind="stable"):
            a, b = region[first[pairs[k]]], region[second[pairs[k]]]
            if a != b and heights[k] >= limits(pairs[k : k + 1])[0]:
                region[region == b] = a

    ends = [np.stack([values[first], values[second]], axis=1) for values in (peaks.Ts, peaks.zs)]
    straight = Paths(objective, *ends).halved().halved()
    unite(np.arange(len(first)), straight.lowest())
    if sampler.fixes_pose:
        masses, _ = sampler.masses()
        left = np.flatnonzero(np.minimum(masses[first], masses[second]) > mass)
        left = left[np.argsort(straight.take(left).length(), kind="stable")]
        sides = np.sort(np.stack([region[first[left]], region[second[left]]], axis=1), axis=1)
        best = np.argsort(-np.minimum(masses[first[left]], masses[second[left]]), kind="stable")
        ranks = [np.unique(one, axis=0, return_index=True)[1] for one in (sides, sides[best])]
        left = left[np.unique(np.concatenate([ranks[0], best[ranks[1]]]))]
        while len(left := left[region[first[left]] != region[second[left]]]):
            pairs = np.stack([region[first[left]], region[second[left]]])
            shortest = np.zeros(len(left), dtype=bool)  # of each region: most pairs are then in one, and need no path
            for one in np.unique(pairs):
                shortest[np.argmax((pairs == one).any(axis=0))] = True
            bent, left = left[shortest], left[~shortest]
            unite(bent, follow(straight.take(bent), limits(bent)))
    return [np.flatnonzero(region == k) for k in np.unique(region)]


def _inside(sampler: Sampler) -> np.ndarray:
    """Return whether the inner half of the normal region of one maximum reaches to another ``(m, m)``."""
    x = np.stack([sampler.offsets(k, sampler.peaks.Ts) for k in range(len(sampler.peaks))]) - sampler.means[:, None]
    z = x @ np.swapaxes(np.linalg.inv(roots(sampler.covariances)), 1, 2)
    return np.asarray(np.sum(z * z, axis=-1) < chi2_quantile(0.5, POSE_DOF))


def _by_curvature(sampler: Sampler, rows: IntArray, log_mass: float, covariances: Covariances) -> Mode:
    """Return the mode of some maxima that is too improbable for its samples, by the curvature of the best maximum.

    Args:
        sampler: samples of the part.
        rows: the maxima ``(R,)``.
        log_mass: log mass of all of them.
        covariances: covariances of all maxima of the part by their curvature ``(m, 6, 6)``.
    """
    objective, peaks = sampler.objective, sampler.peaks
    k = int(rows[np.argmax(peaks.evidence[rows])])
    T, information = peaks.Ts[k], to_origin(objective, peaks.information[k])
    return Mode(
        objective, T, covariances[k], T, peaks.zs[k], information, log_mass, 0.0, T[None], np.ones(1), 0.0, True,
        len(rows), int(np.bitwise_or.reduce(peaks.groups[rows])).bit_count(),
    )  # fmt: skip


def _mode(sampler: Sampler, rows: IntArray, W: FloatArray) -> Mode:
    """Return the mode of some maxima, from its samples.

    If there is one maximum, its normal density is a control variate: the samples only estimate how much the region
    differs from it.
    """
    objective, peaks = sampler.objective, sampler.peaks
    top = float(sampler.log_weights.max())
    found = rows[peaks.times[rows] > 0]  # others are points along a ridge, and no maxima
    which = found if len(found) else rows
    best = int(which[np.argmax(peaks.evidence[which])])
    T = T_peak = peaks.Ts[best]
    w = W[:, rows].sum(axis=1)
    alone = len(rows) == 1 and w.sum() > sampler.settings.region * W.sum()
    region = sampler.control_variate(best, w) if alone else ControlVariate.alone(w, sampler.settings)
    keep = w + region.normal > 1e-9 * w.max()
    Ts = folded(objective.prepared, np.ascontiguousarray(sampler.Ts[keep]), T_peak[None], named=objective.named)
    curved = from_centre(objective, objective.of_pose(peaks.information[best]))
    xi, w, rest = SE3.log(SE3.inverse(T_peak) @ Ts), w[keep], region.rest[keep]
    mean, mass = np.zeros(6), region.mass
    if not region.is_normal:
        rest = np.where(far_tail(xi, w), 0.0, rest)
        mass = rest.sum() + region.expected
    if len(rows) == 1 or not in_box(objective.problem.priors.pose, objective.prepared.part, T_peak[None])[0]:
        mean = rest @ xi / mass
        T = T_peak @ SE3.exp(mean)
        xi = SE3.log(SE3.inverse(T) @ Ts)
    expected = region.expected * (curved + np.outer(mean, mean))
    empirical = ((rest[:, None] * xi).T @ xi + expected) / mass
    covariance = covariance_of_samples(empirical, curved, region.ess, sampler.settings.min_fraction)
    if not region.is_normal or objective.problem.scale_sd > 0:
        covariance = covariance * beyond_normal(xi, w, covariance)
    return Mode(
        objective, T, covariance, T_peak, peaks.zs[best], to_origin(objective, peaks.information[best]),
        float(np.log(region.mass)) + top, 0.0, Ts,
        w / w.sum(), region.ess, region.is_normal, len(rows), int(np.bitwise_or.reduce(peaks.groups[rows])).bit_count(),
    )  # fmt: skip


_TAIL, _FAR = 0.5 * NOTABLE, 9.0
"""Definition: largest fraction of the samples in a tail that the covariance omits, and ratio of the variances with and
without it from which it is one; without the farthest fortieth, those of a normal density fall by a fifth."""

_TRIMS = 4
"""Numerical: number of times that the tail is chosen by the covariance without it."""


def far_tail(xi: FloatArray, weights: FloatArray) -> BoolArray:
    """Return which samples are a far tail of little probability ``(N,)``.

    One reading may be an outlier, and where few readings and a prior fix the pose, that hypothesis has the width of the
    prior. It would multiply the covariance although the 95 % region does not need it.

    Args:
        xi: samples about the maximum ``(N, 6)``.
        weights: their weights ``(N,)``.
    """
    w = weights / weights.sum()
    size = np.sqrt(w @ xi**2).clip(1e-300)
    unit = xi / size
    whole = inner = (w[:, None] * unit).T @ unit + 1e-12 * np.eye(6)
    tail = np.zeros(len(w), dtype=np.bool_)
    for _ in range(_TRIMS):
        order = np.argsort(-np.sum(np.linalg.solve(roots(inner[None])[0], unit.T) ** 2, axis=0))
        tail[:] = False
        tail[order[np.cumsum(w[order]) < _TAIL]] = True
        core = np.where(tail, 0.0, w)
        inner = (core[:, None] * unit).T @ unit / core.sum() + 1e-12 * np.eye(6)
    L = roots(whole[None])[0]
    least = np.linalg.eigvalsh(np.linalg.solve(L, np.linalg.solve(L, inner).T))[0]
    return tail if least < 1 / _FAR else np.zeros(len(w), dtype=np.bool_)


def covariance_of_samples(empirical: Covariances, curved: Covariances, ess: float, least: float) -> Covariances:
    """Return the covariance of a mode: a mean of those of its samples and of the curvature at its maximum.

    Few samples miss some of six directions. On average the inverse of their covariance is too large, so regions of a
    stated probability would hold less (Hartlap, Simon and Schneider 2007).

    Args:
        empirical: covariance of the weighted samples ``(6, 6)``.
        curved: covariance from the curvature at the maximum ``(6, 6)``.
        ess: effective number of samples; it weights the empirical covariance.
        least: smallest variance in any direction, as a fraction of the curved one.
    """
    trust = ess / (ess + POSE_DOF)
    L = roots(curved[None])[0]
    whitened = np.linalg.solve(L, np.linalg.solve(L, empirical).T)
    values, vectors = np.linalg.eigh(trust * whitened + (1 - trust) * np.eye(6))
    out = L @ (vectors * values.clip(least)) @ vectors.T @ L.T
    return np.asarray(out * (1 + (POSE_DOF + 2) / max(ess - POSE_DOF - 2, POSE_DOF + 2)), dtype=np.float64)


def beyond_normal(xi: FloatArray, weights: FloatArray, covariance: Covariances) -> float:
    """Return the factor on a covariance by which its 95 % region holds 95 % of the samples, at least 1."""
    z = np.linalg.solve(roots(covariance[None])[0], xi.T)
    gaps = np.sum(z * z, axis=0)
    order, level = np.argsort(gaps), 1 - NOTABLE
    share = np.cumsum(weights[order]) / weights.sum()
    reach = float(gaps[order[np.searchsorted(share, level).clip(0, len(gaps) - 1)]])
    return max(reach / chi2_quantile(level, POSE_DOF), 1.0)


def to_origin(objective: Objective, information: FloatArray) -> FloatArray:
    """Return information on motions about the part's centre as information on its frame ``(6 + D, 6 + D)``."""
    A = np.eye(len(information))
    A[:3, 3:6] = -SO3.hat(objective.prepared.centre)
    return np.asarray(A.T @ information @ A)


def from_centre(objective: Objective, information: FloatArray) -> Covariances:
    """Return the covariance of motions of the frame from the information about the centre ``(6, 6)``."""
    A = np.eye(6)
    A[:3, 3:] = SO3.hat(objective.prepared.centre)
    return np.asarray(A @ np.linalg.inv(information) @ A.T, dtype=np.float64)
