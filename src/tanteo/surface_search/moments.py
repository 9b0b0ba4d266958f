"""Mean, covariance and mass of the posterior about a maximum, where its curvature there does not tell them.

With few readings a face can end, or a reading change its face, within the uncertainty of the pose. The posterior is
then skewed, cut or flat, and the inverse of the curvature at its highest point is not its covariance. Points along
and between the axes of the supposed ellipsoid tell whether that is so. If a normal density with other moments fits
them, it is taken; else the moments come from weighted draws (adaptive importance sampling with a heavy-tailed
proposal, Ionides' truncated weights while it adapts).

Where readings near edges alone resist a motion, the highest point may be a peak on a plain: a bar that was touched
around its side is held along its axis by the last touch, to a tenth of a millimetre at the peak and by nothing for many
millimetres beyond, a nat or two lower. Along such motions the density is followed as far as it goes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from tanteo.lie import SE3
from tanteo.surface_search.adapted_draws import Proposal, sampled
from tanteo.typing import BoolArray, Covariances, FloatArray, Tangents, Transforms

LogDensity = Callable[[Transforms, FloatArray], FloatArray]
"""Log posterior density, up to a constant, at poses ``(S, 4, 4)`` and whitened shared errors ``(S, D)``."""

_PROBED = 2.0
"""The density is looked at this far along each axis of the ellipsoid, and at draws from it."""

_NORMAL = 0.2
"""There its logarithm may differ by this from a normal one, root mean square; by twice that along an axis."""

_ALIKE = 1.7
"""No variance may be larger than supposed by more than this if a normal density is to be believed beyond there."""

_BRITTLE = 0.9
"""Share of the information along a motion that readings near edges may have before it is followed to its end."""

_FAR = 2.0 ** np.arange(1, 11)
"""So far it is followed both ways, in standard deviations of the peak."""

_BEYOND, _FAINT = 0.05, np.exp(-6.0)
"""Mass beyond the second place over that of the peak from which the peak is not all; density where the plain ends."""


@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """The posterior about one maximum.

    Attributes:
        mean: of the pose, as a right perturbation of the maximum ``(6,)`` [m, rad].
        covariance: of the pose about the maximum, which is not its mean: mean squares and products ``(6, 6)``.
        covariance_given_shared: the same if the shared errors were known ``(6, 6)``.
        log_mass: log of its integral over that of the normal density with the curvature of the maximum.
        share: of the posterior that a box left, of which alone all this is; 1 if it was not looked at.
    """

    mean: Tangents
    covariance: Covariances
    covariance_given_shared: Covariances
    log_mass: float
    share: float = 1.0


def posterior_moments(
    log_density: LogDensity,
    T: Transforms,
    z: FloatArray,
    information: FloatArray,
    brittle: FloatArray | None = None,
    within: Callable[[Transforms], BoolArray] | None = None,
) -> Moments | None:
    """Moments about a maximum; None if the normal approximation holds there.

    Args:
        log_density: of the posterior.
        T: the maximum ``(4, 4)``.
        z: whitened shared errors there ``(D,)``.
        information: over pose and shared errors ``(6 + D, 6 + D)``; directions without any are left alone.
        brittle: what of it, on the pose, is of readings near edges alone ``(6, 6)``; None for nothing.
        within: which poses are in a box, of which alone draws count, if enough are.

    Raises:
        TooFewDrawsError: it does not hold, and no other single density was found to be like the posterior.
    """
    d = np.diag(information)
    scale = 1 / np.sqrt(np.r_[np.full(3, d[:3].max()), np.full(3, d[3:6].max()), d[6:]])
    unit = information * np.outer(scale, scale)
    values, vectors = np.linalg.eigh(unit)
    held = values > 1e-10 * values[-1]
    if held.all():  # axes whose product is the covariance; unlike eigenvectors they change as little as it does
        axes = scale[:, None] * np.linalg.inv(np.linalg.cholesky(unit)).T
    else:
        axes = (scale[:, None] * vectors[:, held]) / np.sqrt(values[held])

    def at(u: FloatArray) -> FloatArray:
        x = u @ axes.T
        return log_density(T @ SE3.exp(x[:, :6]), z + x[:, 6:])

    def inside(u: FloatArray) -> BoolArray:
        return np.ones(len(u), dtype=bool) if within is None else within(T @ SE3.exp(u @ axes[:6].T))

    d = axes.shape[1]
    u = np.concatenate([np.zeros((1, d)), _PROBED * np.eye(d), -_PROBED * np.eye(d), _scattered(d)])
    log = at(u)
    if not np.isfinite(log[0]):
        return None
    plains = [] if brittle is None else _plains(at, axes[:6].T @ brittle @ axes[:6], float(log[0]))
    if not plains and _agree(u, log - log[0] + 0.5 * np.sum(u * u, axis=1)):
        return None
    found = (None if plains else _fitted(u, log - log[0])) or sampled(at, d, float(log[0]), plains, inside)
    return _as_moments(axes, *found)


def _plains(at: Callable[[FloatArray], FloatArray], brittle: FloatArray, peak: float) -> list[Proposal]:
    """Means and factors of the plains that the peak stands on, one for each motion that leads along one.

    Args:
        at: log density in the coordinates of the ellipsoid.
        brittle: share of the information there that is of readings near edges ``(d, d)``.
        peak: log density at the middle.
    """
    values, vectors = np.linalg.eigh(brittle)
    ways = vectors[:, values > _BRITTLE].T
    if not len(ways):
        return []
    t = np.concatenate([-_FAR[::-1], [0.0], _FAR])
    with np.errstate(over="ignore"):
        density = np.exp(np.minimum(at((ways[:, None] * t[:, None]).reshape(-1, len(brittle))) - peak, 50.0))
    out = []
    for way, f in zip(ways, density.reshape(len(ways), len(t)), strict=True):
        f = np.where(_one_run(f > _FAINT), f, 0.0)
        far = np.abs(t) > _PROBED
        if np.sum(np.abs(np.gradient(t))[far] * f[far]) < _BEYOND * np.sqrt(2 * np.pi):
            continue
        low, high = t[f > 0].min(), t[f > 0].max()
        C = np.eye(len(brittle)) + ((high - low) ** 2 / 12 - 1) * np.outer(way, way)
        out.append((0.5 * (low + high) * way, np.asarray(np.linalg.cholesky(C), dtype=np.float64)))
    return out


def _one_run(high: BoolArray) -> BoolArray:
    """Those that no gap parts from the middle one: behind a gap is another mode, or the same after a full turn."""
    middle = len(high) // 2
    below, above = high[: middle + 1][::-1], high[middle:]
    return np.concatenate([np.logical_and.accumulate(below)[:0:-1], np.logical_and.accumulate(above)])


def _agree(u: FloatArray, off: FloatArray) -> bool:
    """Whether what is left at the places looked at is small: at the middle, along the axes, and at the draws."""
    along = 2 * u.shape[1] + 1
    return bool(np.all(np.abs(off[:along]) <= 2 * _NORMAL) and np.sqrt(np.mean(off[along:] ** 2)) <= _NORMAL)


def _fitted(u: FloatArray, log: FloatArray) -> tuple[FloatArray, FloatArray, float, float] | None:
    """Mean, covariance and log mass of the normal density that fits best; None if none fits."""
    d = u.shape[1]
    if not np.isfinite(log).all():
        return None
    i, j = np.triu_indices(d)
    A = np.concatenate([np.ones((len(u), 1)), u, -0.5 * np.where(i == j, 1.0, 2.0) * u[:, i] * u[:, j]], axis=1)
    x = np.linalg.lstsq(A, log, rcond=None)[0]
    H = np.zeros((d, d))
    H[i, j] = H[j, i] = x[1 + d :]
    if not _agree(u, log - A @ x) or not (np.linalg.eigvalsh(H) > 1 / _ALIKE).all():
        return None
    C = np.asarray(np.linalg.inv(H), dtype=np.float64)
    mean = np.asarray(C @ x[1 : 1 + d])
    return mean, C, float(x[0] + 0.5 * mean @ H @ mean + 0.5 * np.linalg.slogdet(C)[1]), 1.0


@cache
def _scattered(d: int) -> FloatArray:
    """Draws from the ellipsoid, twice as many as a quadratic function has coefficients."""
    half = np.random.default_rng((1991, d)).normal(size=((d + 1) * (d + 2) // 2, d))
    return np.concatenate([half, -half])


def _as_moments(axes: FloatArray, mean: FloatArray, C: FloatArray, log_mass: float, share: float) -> Moments:
    joint = axes @ C @ axes.T
    pose = joint[:6, :6]
    given = pose
    if len(joint) > 6:
        given = pose - joint[:6, 6:] @ np.linalg.solve(joint[6:, 6:], joint[6:, :6])
    shift = (axes @ mean)[:6]
    about = np.outer(shift, shift)
    return Moments(shift, pose + about, given + about, log_mass, share)
