"""Maxima of the likelihood of readings on a surface: hundreds of climbs at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.localization import motions_about, pose_information
from tanteo.matching.evidence import Priors, pose_volume
from tanteo.matching.freedom import pose_scale
from tanteo.matching.part_motions import without_spins
from tanteo.matching.prior import add_prior
from tanteo.surface_search.free_space import log_free_paths
from tanteo.surface_search.kin import log_density_of_kin
from tanteo.surface_search.likelihood import explain, log_beside_readings, normal_equations
from tanteo.surface_search.refine import moved, step_to
from tanteo.surface_search.shared_start import starts_of
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import FreePaths, Touches
from tanteo.surface_search.within import log_within
from tanteo.typing import FloatArray, IntArray, Transforms

HOPELESS = 30.0
"""Log odds below the best pose of the same part at which another is not looked at any further."""

_SETTLED = 1e-3
"""Change of log likelihood below which a climb ends."""

_BLUR = 4.0
"""Times the noise with which a climb begins from a maximum that leaves readings aside."""

_LEAST_DAMPING, _MOST_DAMPING = 1e-6, 10.0
"""Share of the information that is added to it; a pose that would need more is where it can get."""


@dataclass(frozen=True, slots=True, eq=False)
class Polished:
    """Local maxima of the likelihood of one part.

    Attributes:
        Ts: poses ``(S, 4, 4)``.
        z: whitened shared errors ``(S, D)``.
        information: over pose and shared errors ``(S, 6 + D, 6 + D)``, priors included.
        log_evidence: density of all readings, pose integrated out by Laplace's approximation, over a box if there is
            one, in which the maximum itself need not be ``(S,)``.
        belongs: probability that each reading is on the surface ``(S, n)``.
        residuals: distance from the surface in standard deviations ``(S, n)``; of readings near edges no more than
            their likelihood, which knows all faces there, makes of it.
        distances: the same in metres ``(S, n)``.
        tilts: of sensed normals against the surface's, in standard deviations ``(S, n)``, likewise; 0 where none was
            sensed.
        rows: derivative of the standardised residuals by the pose ``(S, n, 6)``.
        kin: log odds of an object that is only like the part, at this pose, before their priors ``(S,)``.
        groups: groups of readings whose first poses led here, a bit each ``(S,)``.
    """

    Ts: Transforms
    z: FloatArray
    information: FloatArray
    log_evidence: FloatArray
    belongs: FloatArray
    residuals: FloatArray
    distances: FloatArray
    tilts: FloatArray
    rows: FloatArray
    kin: FloatArray
    groups: IntArray

    def take(self, index: IntArray) -> Polished:
        """Some of the maxima."""
        return Polished(*(getattr(self, name)[index] for name in self.__slots__))

    def join(self, other: Polished) -> Polished:
        """These and others of the same part and readings."""
        return Polished(*(np.concatenate([getattr(self, n), getattr(other, n)]) for n in self.__slots__))


def polish(
    touches: Touches,
    free: FreePaths,
    Ts: Transforms,
    target: Target,
    priors: Priors,
    iterations: int = 12,
    groups: IntArray | None = None,
    z: FloatArray | None = None,
) -> Polished:
    """Climb to the nearest maximum of the likelihood from every pose.

    Args:
        touches: the readings.
        free: paths on which nothing was met.
        Ts: poses near maxima ``(S, 4, 4)``.
        target: the part.
        priors: rate of clutter, the size of the workspace, and what is known of the pose: of each, if it says so.
        iterations: of expectation and maximisation together.
        groups: groups of readings that each pose comes from, a bit each ``(S,)``; none if not given.
        z: whitened shared errors from which each is climbed ``(S, D)``; from where they settle if not given.
    """
    groups = np.zeros(len(Ts), dtype=np.int64) if groups is None else groups
    starts = starts_of(touches, Ts, target, priors) if z is None else [(Ts, z)]
    Ts, z = _climb(touches, free, starts, target, priors, iterations)
    at = explain(touches, Ts, z, target, priors)
    log = at.log + log_beside_readings(free, Ts, z, target, priors)
    A, b = normal_equations(touches, at, z)
    add_prior(priors.pose, target.part, Ts, A, b)
    if z.shape[1]:
        log = log - 0.5 * np.linalg.slogdet(A[:, 6:, 6:])[1]
    information = pose_information(A)
    if priors.pose is None or priors.pose.covariance is None:  # a rough pose resists the spin of a round part too
        information = without_spins(target.part, information)
    log = log + pose_volume(information, pose_scale(priors.radius, target.part.centroid))
    log = log + log_within(priors, target.part, Ts, A)
    n, tilts = len(touches), np.zeros(at.densities.distances.shape)
    tilts[:, touches.oriented] = np.linalg.norm(at.r[:, n:].reshape(len(Ts), (at.r.shape[1] - n) // 3, 3), axis=2)
    r, J = np.array(at.r[:, :n]), at.J[:, :n, :6]
    if at.edges is not None:
        there = at.edges.poses, at.edges.readings
        r[there], tilts[there] = np.clip(r[there], -at.edges.off, at.edges.off), at.edges.tilts
    kin = np.full(len(Ts), -np.inf)
    likely = np.flatnonzero(log >= log.max(initial=-np.inf) - HOPELESS)  # others are not looked at any further
    hopeful = at.densities.take(likely)
    kin[likely] = log_density_of_kin(hopeful, target.part, priors.clutter, touches.places) - at.log[likely]
    return Polished(Ts, z, A, log, at.belongs, r, at.densities.distances, tilts, J, kin, groups)


def from_blurred(touches: Touches, free: FreePaths, found: Polished, target: Target, priors: Priors) -> Polished:
    """The maxima beside those that leave readings aside: climbed to with more noise at first, then with what there is.

    A reading that is astray where a climb ends does not pull any more, and the climb stays, though a little farther
    on it may be on the surface as well.

    Args:
        touches: the readings.
        free: paths on which nothing was met.
        found: maxima.
        target: the part.
        priors: as of :func:`polish`.
    """
    rows = np.flatnonzero((found.belongs <= 0.5).any(axis=1))
    Ts, groups = found.Ts[rows], found.groups[rows]
    blurred = polish(touches.widened(_BLUR), free, Ts, target, priors) if len(rows) else found.take(rows)
    return polish(touches, free, blurred.Ts, target, priors, groups=groups) if len(rows) else blurred


def information_of_readings(
    touches: Touches, Ts: Transforms, z: FloatArray, target: Target, priors: Priors
) -> FloatArray:
    """What each reading adds to the information on the pose ``(S, n, 6, 6)``, the shared errors taken as known.

    Args:
        touches: the readings.
        Ts: poses ``(S, 4, 4)``.
        z: whitened shared errors there ``(S, D)``.
        target: the part.
        priors: rate of clutter and size of the workspace.
    """
    at, n = explain(touches, Ts, z, target, priors), len(touches)
    rows, J = np.flatnonzero(touches.oriented), at.J[..., :6]
    out = J[:, :n, :, None] * J[:, :n, None, :]
    if len(rows):
        turn = J[:, n:].reshape(len(Ts), len(rows), 3, 6)
        out[:, rows] += np.swapaxes(turn, -1, -2) @ turn
    if at.edges is not None:
        out[at.edges.poses, at.edges.readings] = at.edges.resistance[:, :6, :6]
    return np.asarray(out * at.belongs[..., None, None])


def _climb(
    touches: Touches,
    free: FreePaths,
    starts: list[tuple[Transforms, FloatArray]],
    target: Target,
    priors: Priors,
    iterations: int,
) -> tuple[Transforms, FloatArray]:
    """Expectation and Levenberg-Marquardt together, each pose with its own damping; no step makes a pose worse.

    Each pose is climbed from the likeliest of its starts.

    Across an edge of the part the gradient jumps, and full Gauss-Newton steps would swing from face to face.
    """

    def look(Ts: Transforms, z: FloatArray, rows: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        at = explain(touches, Ts, z, target, priors)
        A, b = normal_equations(touches, at, z)
        log = at.log - 0.5 * np.sum(z * z, axis=1)
        log += add_prior(priors.pose, target.part, Ts, A, b, rows)
        return log + log_free_paths(free, Ts, z, target, priors), A, b

    Ts, z = np.array(starts[0][0]), np.array(starts[0][1])
    active = np.arange(len(Ts))
    M = motions_about(target.part.centroid, 6 + z.shape[1])
    log, A, b = look(Ts, z, active)
    for start in starts[1:]:
        at = look(*start, active)
        likelier = at[0] > log
        for own, other in zip((Ts, z, log, A, b), (*start, *at), strict=True):
            own[likelier] = other[likelier]
    damping = np.full(len(Ts), _LEAST_DAMPING)
    for k in range(iterations):
        step = step_to(M.T @ A[active] @ M, b[active] @ M, damping[active])
        new = moved(Ts[active], step[:, :6], target.part.centroid), z[active] + step[:, 6:]
        new_log, new_A, new_b = look(*new, active)
        gain = new_log - log[active]
        rows = np.flatnonzero(gain > 0)
        better = active[rows]
        Ts[better], z[better], log[better] = new[0][rows], new[1][rows], new_log[rows]
        A[better], b[better] = new_A[rows], new_b[rows]
        damping[active] = np.where(gain > 0, 0.1 * damping[active], 30 * damping[active]).clip(_LEAST_DAMPING)
        hopeful = log[active] > log.max(initial=-np.inf) - (HOPELESS if k > 1 else np.inf)
        active = active[hopeful & (np.abs(gain) > _SETTLED) & (damping[active] < _MOST_DAMPING)]
        if not len(active):
            break
    return Ts, z
