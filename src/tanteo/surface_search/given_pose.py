"""What readings say of a pose: errors that they share are not drawn, but integrated out there.

At a given pose what a reading says of them is linear and normal, so two steps from where they are expected to be do.
What is left of the posterior has six dimensions, whatever the rig.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from tanteo.matching.priors import Priors, log_sum
from tanteo.surface_search.free_space import log_free_paths
from tanteo.surface_search.kin import log_density_of_kin
from tanteo.surface_search.likelihood import (
    Explained,
    densities_at,
    explain,
    log_beside_readings,
    normal_equations,
)
from tanteo.surface_search.strays import log_density
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import FreePaths, Touches
from tanteo.typing import FloatArray, Transforms

_STEPS = 2
"""Steps to the shared errors that are expected at a pose."""

_DRAWS = 16
"""Shared errors over which paths are averaged where readings at a pose leave open how far beside it the paths were."""


@dataclass(frozen=True, slots=True, eq=False)
class GivenPose:
    """The posterior at some poses.

    Attributes:
        log: density, the shared errors integrated out ``(S,)``.
        kin: log odds of an object that is only like the part, there, before their priors ``(S,)``.
        z: whitened shared errors that are expected there ``(S, D)``.
        spreads: covariances about them ``(S, D, D)``.
    """

    log: FloatArray
    kin: FloatArray
    z: FloatArray
    spreads: FloatArray

    def first(self, n: int) -> GivenPose:
        """At the first of the poses."""
        return GivenPose(*(getattr(self, name)[:n] for name in self.__slots__))

    def join(self, other: GivenPose) -> GivenPose:
        """These and others."""
        return GivenPose(*(np.concatenate([getattr(self, n), getattr(other, n)]) for n in self.__slots__))


Posterior = Callable[[Transforms, FloatArray], GivenPose]
"""The posterior of a part at poses ``(S, 4, 4)``, looked at from whitened shared errors ``(S, D)``."""


def given_pose(
    touches: Touches, free: FreePaths, target: Target, priors: Priors, Ts: Transforms, z: FloatArray
) -> GivenPose:
    """The posterior at poses, over "anywhere" as :func:`log_posterior`, errors that the readings share integrated out.

    Args:
        touches: all readings that met something.
        free: all paths on which nothing was met.
        target: the part.
        priors: rate of clutter, the size of the workspace, what is known of the pose.
        Ts: poses ``(S, 4, 4)``.
        z: whitened shared errors from which those that are expected are looked for ``(S, D)``.
    """
    spreads, log = np.zeros((len(Ts), z.shape[1], z.shape[1])), np.zeros(len(Ts))
    if z.shape[1]:
        z, spreads = _expected(touches, Ts, z, target, priors)
        log = 0.5 * np.linalg.slogdet(spreads)[1]
    at = densities_at(touches, Ts, z, target, priors)
    of_readings = log_density(at.log_hit, at.log_stray, priors.clutter)
    log = log + of_readings + log_beside_readings(FreePaths.none(), Ts, z, target, priors)
    log += _log_paths(touches, free, target, priors, Ts, z, spreads)
    kin = log_density_of_kin(at, target.part, priors.clutter, touches.places)
    return GivenPose(log, kin - of_readings, z, spreads)


def _log_paths(
    touches: Touches,
    free: FreePaths,
    target: Target,
    priors: Priors,
    Ts: Transforms,
    z: FloatArray,
    spreads: FloatArray,
) -> FloatArray:
    """Log probability of the free paths ``(S,)``, averaged over shared errors if these may move them beside a pose."""
    log = log_free_paths(free, Ts, z, target, priors)
    if not free.moved:
        return log
    root = np.linalg.cholesky(spreads)
    ends = free.gains + free.lengths[:, None, None] * free.turns
    off = [np.linalg.norm(J.reshape(-1, z.shape[1]) @ root, axis=2).max(axis=1) for J in (free.gains, ends)]
    noise = float(np.median(touches.sd)) if len(touches) else 0.0
    rows = np.flatnonzero(np.maximum(*off) > noise)
    if len(rows):
        drawn = z[rows] + np.einsum("kd,sed->kse", _chance(z.shape[1]), root[rows])
        each = [log_free_paths(free, Ts[rows], one, target, priors) for one in drawn]
        log[rows] = log_sum(each, axis=0) - np.log(len(each))
    return log


@cache
def _chance(D: int) -> FloatArray:
    """The same standard normal draws every time ``(K, D)``."""
    half = np.random.default_rng((1991, 12, D)).normal(size=(_DRAWS // 2, D))
    return np.concatenate([half, -half])


def _expected(
    touches: Touches, Ts: Transforms, z: FloatArray, target: Target, priors: Priors
) -> tuple[FloatArray, FloatArray]:
    """Shared errors that are expected at the poses, and their covariances."""
    bare = replace(touches, reach=np.zeros(len(touches)))  # what blocks a beam now may not when they move
    information = np.zeros((len(Ts), z.shape[1], z.shape[1]))
    for _ in range(_STEPS):
        at = _before_shared(explain(bare, Ts, z, target, priors))
        A, b = normal_equations(bare, at, z)
        information = A[:, 6:, 6:]
        z = z + np.linalg.solve(information, b[:, 6:, None])[..., 0]
    return z, np.asarray(np.linalg.inv(information))


def _before_shared(at: Explained) -> Explained:
    """The same with each reading as probable on the surface as it is while the shared errors are unknown.

    With the errors that are expected a reading may look astray that one of them explains.
    """
    n = at.densities.log_hit.shape[1]
    shared = np.sum(at.J[:, :n, 6:] ** 2, axis=2)
    wider = 0.5 * at.r[:, :n] ** 2 * shared / (1 + shared) - 0.5 * np.log1p(shared)
    return replace(at, densities=replace(at.densities, log_hit=at.densities.log_hit + wider))
