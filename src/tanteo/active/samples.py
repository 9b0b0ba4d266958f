"""A belief as a few hundred small normal densities, for what is not linear: edges, misses, the wrong face."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from statistics import NormalDist

import numpy as np

from tanteo import _core
from tanteo.active.places import places_of
from tanteo.active.probe import Probe
from tanteo.active.rays import has_cone, of_cone, rays_met
from tanteo.active.shared import SharedAhead
from tanteo.active.state import SensingState
from tanteo.inference import PreparedPart
from tanteo.lie import SE3
from tanteo.localization import pose_information
from tanteo.typing import BoolArray, Covariances, FloatArray, IntArray, Transforms, Vectors

_KEPT = 0.3
"""Share of the covariance that stays with every sample; the rest is between the samples."""

_RMS = 1.6
"""A normal error in space stays within 1.6 times its root mean square with a probability of 95 %."""

_SEEN = 1e-12
"""Share of the largest mean square motion of the places below which a motion moves none of them."""

_PLASTIC = 1.1127756842787055
"""Root of x^7 = x + 1: multiples of its powers fill six dimensions evenly (Roberts 2018)."""

_FULL = 24
"""So many vectors have a covariance of full rank in six dimensions, well enough known to be made one."""

_LEAST = 1e-4
"""Modes of less probability are not asked about."""


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Poses that are possible, each with the small covariance of its own.

    Attributes:
        targets: the parts.
        part: index of the part of each ``(S,)``.
        mode: index of the mode of the belief that it is drawn from ``(S,)``.
        Ts: poses ``T_world_part`` ``(S, 4, 4)``.
        covariances: ``(S, 6, 6)``, part frame, right perturbation [m, rad].
        weights: ``(S,)``, summing to one.
        whole: covariance of the mode of each ``(S, 6, 6)``.
        useful: the part of it that is worth knowing ``(S, 6, 6)``: all of it, or what exceeds a tolerance.
    """

    targets: tuple[PreparedPart, ...]
    part: IntArray
    mode: IntArray
    Ts: Transforms
    covariances: Covariances
    weights: FloatArray
    whole: Covariances
    useful: Covariances

    def __len__(self) -> int:
        return len(self.part)


def draw(state: SensingState, count: int, tolerance: float | None = None, feature: str | None = None) -> Samples:
    """About so many samples of a belief, more of the likelier modes, spread evenly over each (Sobol).

    Args:
        state: what is known.
        count: of samples; every mode has one at least.
        tolerance: of the corners of the part [m], beyond which nothing more needs to be known; None for none.
        feature: name of one that has to keep it instead, see :class:`tanteo.active.Stop`.
    """
    alive = np.flatnonzero(state.weights > _LEAST * state.weights.max(initial=0.0))
    w = state.weights[alive] / state.weights[alive].sum()
    counts = np.maximum(1, np.round(count * w)).astype(np.int64)
    which = np.repeat(np.arange(len(alive)), counts)
    mode = alive[which]
    xi = np.concatenate([even_normals(n) for n in counts]) if len(counts) else np.zeros((0, 6))
    C = state.covariances[mode]
    values, vectors = np.linalg.eigh(state.covariances[alive])
    L = (vectors * np.sqrt(values.clip(0.0))[:, None, :])[which]
    many = counts[which] > 1  # a single sample has all of the covariance
    moved = np.where(many[:, None], np.sqrt(1 - _KEPT) * (L @ xi[..., None])[..., 0], 0.0)
    kept = np.where(many, _KEPT, 1.0)[:, None, None] * C
    Ts = state.poses[mode] @ SE3.exp(moved)
    kept, Ts = _from_draws(state, alive, counts, kept, Ts)
    useful = np.stack([_useful(state, int(k), tolerance, feature) for k in alive]) if len(alive) else C
    return Samples(state.start.targets, state.part[mode], mode, Ts, kept, (w / counts)[which], C, useful[which])


def _from_draws(
    state: SensingState, alive: IntArray, counts: IntArray, kept: Covariances, Ts: Transforms
) -> tuple[Covariances, Transforms]:
    """Where a mode is not normal, the samples of the belief, with a share of the curvature at its maximum."""
    first = np.cumsum(counts) - counts
    for k, n, at in zip(alive, counts, first, strict=True):
        if state.draws is None or state.modes[k].normal or n < 2:
            continue
        rows = np.flatnonzero(state.draws.mode == k)
        if not len(rows):
            continue
        w = np.cumsum(state.draws.weights[rows])
        chosen = rows[np.searchsorted(w, w[-1] * (np.arange(n) + 0.5) / n).clip(0, len(rows) - 1)]
        Ts[at : at + n] = state.draws.Ts[chosen]
        kept[at : at + n] = _KEPT * np.linalg.inv(pose_information(state.modes[k].information))
    return kept, Ts


def _useful(state: SensingState, k: int, tolerance: float | None, feature: str | None) -> Covariances:
    """``C - (C^-1 + W)^-1`` of mode ``k``, ``W`` the information that just keeps the places within the tolerance.

    Of motions that move none of them, nothing is worth knowing.
    """
    C = state.covariances[k]
    if tolerance is None:
        return C
    J = places_of(state.target(k).part, feature).moves
    values, vectors = np.linalg.eigh(np.mean(np.swapaxes(J, 1, 2) @ J, axis=0))
    some = values > _SEEN * values[-1]
    A = np.sqrt(some.sum() * values[some])[:, None] * (_RMS / tolerance) * vectors[:, some].T
    AC = A @ C
    return np.asarray(AC.T @ np.linalg.solve(np.eye(len(A)) + AC @ A.T, AC))


@cache
def even_normals(n: int) -> FloatArray:
    """Evenly spread standard normal vectors ``(n, 6)``, the first at the centre, the others with unit covariance."""
    if n == 1:
        return np.zeros((1, 6))
    half = _even(1 << (int(n) // 2 - 1).bit_length())[: n // 2]
    x = np.stack([half, -half], axis=1).reshape(-1, 6)[: n - 1]
    if n > _FULL:
        x -= x.mean(axis=0)
        x = np.linalg.solve(np.linalg.cholesky(np.cov(x.T)), x.T).T
    return np.concatenate([np.zeros((1, 6)), x])


@cache
def _even(n: int) -> FloatArray:
    """Evenly spread standard normal vectors ``(n, 6)`` on one side, as they come; fewer are the first of more."""
    u = (0.5 + np.arange(1, n + 1)[:, None] * _PLASTIC ** -np.arange(1.0, 7.0)) % 1.0
    return np.vectorize(NormalDist().inv_cdf)(np.clip(u, 1e-6, 1 - 1e-6))


@dataclass(frozen=True, slots=True, eq=False)
class Predictions:
    """What beams would meet under every sample.

    Attributes:
        ranges: ``(C, S)`` [m]; infinite where nothing is met.
        cosines: of the incidence ``(C, S)``; 0 where nothing is met.
        variances: of the range from the sample's own covariance ``(C, S)`` [m^2].
        spreads: from that of its mode ``(C, S)`` [m^2].
        useful: from the part of that which is worth knowing ``(C, S)`` [m^2].
        faces: index of the part's face that is met ``(C, S)``; -1 for none.
        shares: of the rays of the beam's cone, those that are answered ``(C, S)``; 1 for a thin beam.
        scatter: variance of the range from ray to ray beyond that on one plane ``(C, S)`` [m^2]; 0 for a thin beam.
        shared: variance from what the pose leaves open of the errors that readings share ``(C, S)`` [m^2]; NaN where
            only the probe says it.
    """

    ranges: FloatArray
    cosines: FloatArray
    variances: FloatArray
    spreads: FloatArray
    useful: FloatArray
    faces: IntArray
    shares: FloatArray
    scatter: FloatArray
    shared: FloatArray

    @property
    def met(self) -> BoolArray:
        """Whether anything is met ``(C, S)``."""
        return np.isfinite(self.ranges)


def predict(
    samples: Samples,
    origins: Vectors,
    directions: Vectors,
    probe: Probe | None = None,
    shared: SharedAhead | None = None,
) -> Predictions:
    """What beams would read, by rays on every sample; ``math.md`` section 7, end, for the variance.

    The echo of a cone comes from any one of its rays: some may meet the part, and others nothing or another face.

    Args:
        samples: where the parts may be.
        origins: of the beams, world ``(C, 3)`` [m].
        directions: unit, world ``(C, 3)``.
        probe: what senses, if its cone or ball is to count.
        shared: errors that the readings share, with those told before.
    """
    parts = np.unique(samples.part).tolist() or [0]
    rows = [np.flatnonzero(samples.part == k) for k in parts]
    found = [
        _of_part(samples, k, some, origins, directions, probe, shared) for k, some in zip(parts, rows, strict=True)
    ]
    if len(found) == 1:
        return Predictions(*found[0])
    order = np.argsort(np.concatenate(rows))
    return Predictions(*(np.concatenate(columns, axis=1)[:, order] for columns in zip(*found, strict=True)))


def _of_part(
    samples: Samples,
    k: int,
    some: IntArray,
    origins: Vectors,
    directions: Vectors,
    probe: Probe | None,
    shared: SharedAhead | None,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, IntArray, FloatArray, FloatArray, FloatArray]:
    """What :class:`Predictions` has, under the samples of part ``k``."""
    target, Ts = samples.targets[k], samples.Ts[some]
    d, cosine, face, g = beams(target, Ts, origins, directions)
    shares, scatter = np.ones(d.shape), np.zeros(d.shape)
    if probe is not None and has_cone(probe):
        d, cosine, g, shares, scatter = of_cone(target, Ts, origins, directions, (d, cosine, g), probe)
    if probe is not None:
        d = d - probe.short(cosine)
    rest = np.full(d.shape, np.nan)
    if shared is not None:
        off, g, rest = shared.moved(samples.mode[some], Ts, g)
        d = d + off
    forms = np.stack([A[some] for A in (samples.covariances, samples.whole, samples.useful)])
    variances, spreads, useful = _core.spreads(np.ascontiguousarray(g), forms)
    return d, cosine, variances, spreads, useful, face, shares, scatter, rest


def beams(
    target: PreparedPart, Ts: Transforms, origins: Vectors, directions: Vectors
) -> tuple[FloatArray, FloatArray, IntArray, FloatArray]:
    """What beams meet on a part at poses: range, cosine of incidence, face, and how the range moves with the pose.

    Args:
        target: the part.
        Ts: poses ``(S, 4, 4)``.
        origins: of the beams, world ``(C, 3)`` [m].
        directions: unit, world ``(C, 3)``.

    Returns:
        ``(C, S)`` three times (infinite, 0 and -1 for a miss), and the derivatives ``(C, S, 6)``, 0 for a miss.
    """
    met = rays_met(target, Ts, origins, directions[:, None])
    return met.distances, met.cosines, met.faces, met.derivatives
