"""The likelihood of readings on a surface, and its maxima: mixture with clutter, shared errors as state.

A reading without correspondence is either on the surface, with its noise along the normal, or clutter. If nobody
knows how it was aimed, it may have met the surface anywhere, by area; if its direction is known, what it says is how
far it went, and material in front of the hit speaks against it (``math.md`` sections 7 and 10).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.lie import SO3
from tanteo.localization import pose_information
from tanteo.matching.evidence import Priors, pose_volume
from tanteo.matching.prior import prior_log_density, prior_rows
from tanteo.matching.verdict import without_spins
from tanteo.shapes import signed_distance
from tanteo.surface_search.near_edges import NearEdges, near_edges
from tanteo.surface_search.refine import moved
from tanteo.surface_search.sensed_face import AWAY, GRAZING, turn_to_beams, turn_to_normals
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import FreePaths, Touches
from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors

_IN_FRONT = 4.0
"""Material this many standard deviations before the hit contradicts a beam."""

HOPELESS = 30.0
"""Log odds below the best pose of the same part at which another is not looked at any further."""

_SETTLED = 1e-3
"""Change of log likelihood below which a climb ends."""

_LEAST_DAMPING, _MOST_DAMPING = 1e-6, 10.0
"""Share of the information that is added to it; a pose that would need more is where it can get."""


@dataclass(frozen=True, slots=True, eq=False)
class Polished:
    """Local maxima of the likelihood of one part.

    Attributes:
        Ts: poses ``(S, 4, 4)``.
        z: whitened shared errors ``(S, D)``.
        information: over pose and shared errors ``(S, 6 + D, 6 + D)``, priors included.
        log_evidence: density of all readings, pose integrated out by Laplace's approximation ``(S,)``.
        belongs: probability that each reading is on the surface ``(S, n)``.
        residuals: distance from the surface in standard deviations ``(S, n)``.
        distances: the same in metres ``(S, n)``.
        rows: derivative of the standardised residuals by the pose ``(S, n, 6)``.
    """

    Ts: Transforms
    z: FloatArray
    information: FloatArray
    log_evidence: FloatArray
    belongs: FloatArray
    residuals: FloatArray
    distances: FloatArray
    rows: FloatArray

    def take(self, index: IntArray) -> Polished:
        """Some of the maxima."""
        return Polished(*(getattr(self, name)[index] for name in self.__slots__))

    def join(self, other: Polished) -> Polished:
        """These and others of the same part and readings."""
        return Polished(*(np.concatenate([getattr(self, n), getattr(other, n)]) for n in self.__slots__))


@dataclass(frozen=True, slots=True, eq=False)
class _At:
    """Everything about the readings at some poses."""

    r: FloatArray
    J: FloatArray
    log_hit: FloatArray
    log_stray: FloatArray
    distances: FloatArray
    edges: NearEdges | None = None


def polish(
    touches: Touches, free: FreePaths, Ts: Transforms, target: Target, priors: Priors, iterations: int = 12
) -> Polished:
    """Climb to the nearest maximum of the likelihood from every pose.

    Args:
        touches: the readings.
        free: paths on which nothing was met.
        Ts: poses near maxima ``(S, 4, 4)``.
        target: the part.
        priors: rate of clutter, the size of the workspace, and what is known of the pose: of each, if it says so.
        iterations: of expectation and maximisation together.
    """
    Ts, z, at = _climb(touches, free, Ts, target, priors, iterations)
    log = _log_posterior(touches, free, Ts, z, target, priors, at)
    belongs = _responsibility(at)
    A, b = _normal_equations(touches, at, belongs, z)
    _add_prior(priors, target, Ts, A, b)
    if z.shape[1]:
        log = log - 0.5 * np.linalg.slogdet(A[:, 6:, 6:])[1]
    information = pose_information(A)
    if priors.pose is None or priors.pose.covariance is None:  # a rough pose resists the spin of a round part too
        information = without_spins(target.part, information)
    log = log + pose_volume(information, priors.radius)
    n = len(touches)
    return Polished(Ts, z, A, log, belongs, at.r[:, :n], at.distances, at.J[:, :n, :6])


def log_posterior(
    touches: Touches, free: FreePaths, Ts: Transforms, z: FloatArray, target: Target, priors: Priors
) -> FloatArray:
    """Log density of readings, pose and shared errors ``(S,)``, that of the pose over "anywhere".

    Args:
        touches: the readings.
        free: paths on which nothing was met.
        Ts: poses ``(S, 4, 4)``.
        z: whitened shared errors ``(S, D)``.
        target: the part.
        priors: rate of clutter, the size of the workspace, what is known of the pose.
    """
    return _log_posterior(touches, free, Ts, z, target, priors, _linearise(touches, Ts, z, target, priors))


def _log_posterior(
    touches: Touches, free: FreePaths, Ts: Transforms, z: FloatArray, target: Target, priors: Priors, at: _At
) -> FloatArray:
    log = np.logaddexp(at.log_hit, at.log_stray).sum(axis=1) - 0.5 * np.sum(z * z, axis=1)
    r = prior_rows(priors.pose, target.part, Ts)[0]
    log += prior_log_density(priors.pose, target.part, Ts, priors.radius) - 0.5 * np.sum(r * r, axis=1)
    return np.asarray(log + _free_paths(free, Ts, target, priors))


def _climb(
    touches: Touches, free: FreePaths, Ts: Transforms, target: Target, priors: Priors, iterations: int
) -> tuple[Transforms, FloatArray, _At]:
    """Expectation and Levenberg-Marquardt together, each pose with its own damping; no step makes a pose worse.

    Across an edge of the part the gradient jumps, and full Gauss-Newton steps would swing from face to face.
    """

    def look(Ts: Transforms, z: FloatArray, rows: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        some = priors if priors.pose is None else replace(priors, pose=priors.pose.take(rows))
        at = _linearise(touches, Ts, z, target, priors)
        A, b = _normal_equations(touches, at, _responsibility(at), z)
        log = np.logaddexp(at.log_hit, at.log_stray).sum(axis=1) - 0.5 * np.sum(z * z, axis=1)
        log += _add_prior(some, target, Ts, A, b)
        return log + _free_paths(free, Ts, target, priors), A, b

    Ts, z = np.array(Ts), np.zeros((len(Ts), touches.gains.shape[-1]))
    active = np.arange(len(Ts))
    log, A, b = look(Ts, z, active)
    damping = np.full(len(Ts), _LEAST_DAMPING)
    for k in range(iterations):
        step = _solve(A[active], b[active], damping[active])
        new = moved(Ts[active], step[:, :6]), z[active] + step[:, 6:]
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
    return Ts, z, _linearise(touches, Ts, z, target, priors)


def _add_prior(priors: Priors, target: Target, Ts: Transforms, A: FloatArray, b: FloatArray) -> FloatArray:
    """Add what is known of the pose beforehand to the normal equations, in place; its log likelihood ``(S,)``."""
    if priors.pose is None:
        return np.zeros(len(Ts))
    r, J = prior_rows(priors.pose, target.part, Ts)
    Jt = np.swapaxes(J, 1, 2)
    A[:, :6, :6] += Jt @ J
    b[:, :6] -= (Jt @ r[..., None])[..., 0]
    return np.asarray(-0.5 * np.sum(r * r, axis=1))


def _linearise(touches: Touches, Ts: Transforms, z: FloatArray, target: Target, priors: Priors) -> _At:
    """Residuals, derivatives over pose and shared errors, and log densities of both explanations."""
    R = Ts[:, :3, :3]
    shared = z.shape[1] > 0
    points = touches.points + (np.einsum("nid,sd->sni", touches.gains, z) if shared else 0.0)
    p = (points - Ts[:, None, :3, 3]) @ R
    phi, g = signed_distance(target.surface, p)
    beside = turn_to_beams(touches, target, R, p, phi, g) + turn_to_normals(touches, target, R, p, phi, g)
    normal = g @ np.swapaxes(R, 1, 2)
    s = 1 / np.sqrt(((normal[:, :, None] @ touches.covs)[:, :, 0] * normal).sum(axis=-1))
    distance = phi - touches.radii
    r = distance * s
    gains = [np.einsum("sni,nid->snd", normal, touches.gains)] if shared else []
    J = np.concatenate([-g, SO3.cross(g, p), *gains], axis=-1) * s[..., None]
    log = -0.5 * (r * r + beside + np.log(2 * np.pi)) + np.log(s)
    cosine = -np.einsum("sni,ni->sn", normal, touches.directions)
    directed = touches.directed
    aimed = np.where(cosine > 0, np.log(np.maximum(cosine, GRAZING)), AWAY)
    log += np.where(directed, aimed, -np.log(target.part.area))
    edges = near_edges(touches, target, R, p)
    if edges is not None:
        log[edges.poses, edges.readings] = edges.log
    log += np.log1p(-priors.clutter)
    log[_material_in_front(touches, Ts, z, target)] = -np.inf
    ball = np.log(4 / 3 * np.pi * priors.radius**3)
    stray = np.log(priors.clutter) - np.where(directed, np.log(2 * priors.radius), ball)
    stray = np.broadcast_to(stray, r.shape)
    if not touches.oriented.any():
        return _At(r, J, log, stray, distance, edges)
    return _with_normals(touches, R, g, _At(r, J, log, stray, distance, edges))


def _with_normals(touches: Touches, R: FloatArray, g: Vectors, at: _At) -> _At:
    """Add the rows of sensed normals: their tilt against the surface's."""
    rows = np.flatnonzero(touches.oriented)
    sd = touches.normal_sds[rows]
    m = np.einsum("sji,nj->sni", R, touches.normals[rows])
    u = g[:, rows]
    gap = SO3.cross(u, m) / sd[:, None]
    W = (m[..., :, None] * u[..., None, :] - np.sum(m * u, axis=-1)[..., None, None] * np.eye(3)) / sd[:, None, None]
    D = at.J.shape[-1] - 6
    turn = np.concatenate([np.zeros_like(W), W, np.zeros((*W.shape[:-1], D))], axis=-1)
    S = len(R)
    same_side = np.where(np.sum(m * u, axis=-1) > 0, 0.0, -50.0)
    log, stray = np.array(at.log_hit), np.array(at.log_stray)
    log[:, rows] += -0.5 * np.sum(gap * gap, axis=-1) - np.log(2 * np.pi * sd**2) + same_side
    stray[:, rows] -= np.log(4 * np.pi)
    k = 3 * len(rows)
    r = np.concatenate([at.r, gap.reshape(S, k)], axis=1)
    J = np.concatenate([at.J, turn.reshape(S, k, at.J.shape[-1])], axis=1)
    return _At(r, J, log, stray, at.distances, at.edges)


def _responsibility(at: _At) -> FloatArray:
    return np.asarray(1 / (1 + np.exp(np.clip(at.log_stray - at.log_hit, -700, 700))))


def _normal_equations(touches: Touches, at: _At, belongs: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Information and gradient with every reading weighted by the probability that it belongs.

    The faces of readings near edges are taken as known, each with its share.
    """
    rows, edges, all_ = np.flatnonzero(touches.oriented), at.edges, belongs
    if edges is not None:
        belongs = np.array(belongs)
        belongs[edges.poses, edges.readings] = 0.0
    w = belongs if not len(rows) else np.concatenate([belongs, np.repeat(belongs[:, rows], 3, axis=1)], axis=1)
    JtW = np.swapaxes(at.J, 1, 2) * w[:, None, :]
    A, b = JtW @ at.J, -(JtW @ at.r[..., None])[..., 0]
    if edges is not None:
        share = all_[edges.poses, edges.readings, None]
        np.add.at(A, edges.poses, share[..., None] * edges.resistance)
        np.add.at(b, edges.poses, share * edges.gradient)
    D = z.shape[1]
    A[:, 6:, 6:] += np.eye(D)
    b[:, 6:] -= z
    return A, b


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
    at, n = _linearise(touches, Ts, z, target, priors), len(touches)
    belongs, rows = _responsibility(at), np.flatnonzero(touches.oriented)
    J = at.J[..., :6]
    out = J[:, :n, :, None] * J[:, :n, None, :]
    if len(rows):
        turn = J[:, n:].reshape(len(Ts), len(rows), 3, 6)
        out[:, rows] += np.swapaxes(turn, -1, -2) @ turn
    if at.edges is not None:
        out[at.edges.poses, at.edges.readings] = 0.0
        np.add.at(out, (at.edges.poses, at.edges.readings), at.edges.resistance[:, :6, :6])
    return np.asarray(out * belongs[..., None, None])


def _solve(A: FloatArray, b: FloatArray, damping: FloatArray) -> FloatArray:
    """Damped steps, which stay put along directions that nothing resists."""
    d = np.array(np.einsum("sii->si", A))
    for block in (slice(0, 3), slice(3, 6)):  # what only rounding resists is not known a million million times worse
        d[:, block] = np.maximum(d[:, block], 1e-6 * d[:, block].max(axis=1, keepdims=True))
    scale = 1 / np.sqrt(np.where(d > 0, d, 1.0))
    unit = A * scale[:, :, None] * scale[:, None, :] + damping[:, None, None] * np.eye(A.shape[1])
    step = scale * np.linalg.solve(unit, (scale * b)[..., None])[..., 0]
    turn = np.linalg.norm(step[:, 3:6], axis=1)
    return step * np.minimum(1.0, 0.2 / np.maximum(turn, 1e-12))[:, None]


def _material_in_front(touches: Touches, Ts: Transforms, z: FloatArray, target: Target) -> BoolArray:
    """Readings whose free path runs through the part ``(S, n)``."""
    out = np.zeros((len(Ts), len(touches)), dtype=bool)
    rows = np.flatnonzero((touches.reach > 0) & touches.directed)
    if not len(rows):
        return out
    points = touches.points[rows] + np.einsum("nid,sd->sni", touches.gains[rows], z)
    start = points - touches.reach[rows, None] * touches.directions[rows]
    local = (start - Ts[:, None, :3, 3]) @ Ts[:, :3, :3]
    along = np.einsum("sji,nj->sni", Ts[:, :3, :3], touches.directions[rows])
    free = touches.reach[rows] - _IN_FRONT * touches.sd[rows] - 0.01 * target.part.diagonal
    s, n = np.nonzero(target.surface.cast(local, along).distances < free)
    if len(s):  # a path that only grazes the part may have passed beside it
        aside = _IN_FRONT * touches.sd[rows[n], None, None] * _across(along[s, n])
        hits = target.surface.cast(local[s, n, None] + aside, along[s, n, None]).distances
        out[s, rows[n]] = np.all(hits < free[n, None], axis=1)
    return out


def _across(directions: Vectors) -> FloatArray:
    """Four unit vectors across each direction ``(k, 4, 3)``."""
    least = np.eye(3)[np.argmin(np.abs(directions), axis=1)]
    u = SO3.cross(directions, least)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = SO3.cross(directions, u)
    return np.stack([u, v, -u, -v], axis=1)


def _free_paths(free: FreePaths, Ts: Transforms, target: Target, priors: Priors) -> FloatArray:
    """Log probability of the paths on which nothing was met ``(S,)``: clutter's, for each that the part blocks."""
    if not len(free.origins):
        return np.zeros(len(Ts))
    local = (free.origins - Ts[:, None, :3, 3]) @ Ts[:, :3, :3]
    along = np.einsum("sji,nj->sni", Ts[:, :3, :3], free.directions)
    hits = target.surface.cast(local, along).distances
    blocked: BoolArray = hits < free.lengths - free.margin - 0.01 * target.part.diagonal
    return np.asarray(np.sum(np.where(blocked, np.log(priors.clutter), np.log1p(-priors.clutter)), axis=1))
