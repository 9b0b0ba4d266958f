"""Maximum likelihood of a round feature from a start, over batches: damped Gauss-Newton on frame and size.

The points' true places on the feature are unknowns, too: each is the foot ``q - S G' W e`` of its measured point,
``W = (G S G')^-1``, with ``e`` the distance linearised there. Normals sensed beside the points add the two components
of the sensed across the predicted one. What a curved surface does to the mean of a distance is taken off
(``math.md`` section 8).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from tanteo.fitting.round_surface import Distance, Distances
from tanteo.lie import SO3
from tanteo.typing import BoolArray, Covariances, FloatArray, Rotations, Vectors

_FEET = 4
_PASSES = 60
_SETTLED = 1e-14
_NEAR = 1e-2
"""A step so small, squared and in standard deviations, is taken as it is: weights are held during one."""
_UPHILL = 1e-6
"""Share by which the sum of squares may grow in a step: the mean effect of the curvature is held during one."""


@dataclass(frozen=True, slots=True, eq=False)
class RoundProblem:
    """What is fitted to what; leading axes of points are batches.

    Attributes:
        distance: of points from the feature in its frame.
        rows: of the tangent that are unknown.
        points: ``(*batch, n, 3)`` in the world [m].
        covs: ``(*batch, n, 3, 3)``.
        slides: whether the origin may slide along z: it stays at the mean of the points.
        largest: of the size.
        known_size: standard deviation of a given size, 0 for an exact one; none if it is unknown.
        size: that size.
        normals: sensed normals out of the round body ``(*batch, n, 3)``; rows without are zero.
        normal_sds: of them ``(*batch, n)`` [rad]; infinite where there is none.
        isotropic: whether every point is as well known in all directions.
        known_frame: a frame that is known beforehand, ``(R, c)``, with its information ``(m, m)`` over ``rows``.
    """

    distance: Distance
    rows: tuple[int, ...]
    points: Vectors
    covs: Covariances
    slides: bool = False
    largest: float = np.inf
    known_size: float | None = None
    size: float = 0.0
    normals: Vectors | None = None
    normal_sds: FloatArray | None = None
    known_frame: tuple[Rotations, Vectors, FloatArray] | None = None
    isotropic: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class RoundState:
    """Where the iteration stands: rotation, origin and size over batches."""

    R: Rotations
    c: Vectors
    s: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Linear:
    """A problem at a state; ``m`` unknowns, the size last unless it is exact.

    Attributes:
        e: distances linearised at the feet, mean effect of the curvature taken off ``(*batch, n, k)``.
        G: of the points, in the world ``(*batch, n, k, 3)``.
        h: by the unknowns ``(*batch, n, k, m)``.
        W: inverse covariances of ``e`` ``(*batch, n, k, k)``.
        information: ``(*batch, m, m)``.
        gradient: ``(*batch, m)``.
        each: weighted square of each point's residuals, normals included ``(*batch, n)``.
        spent: information of each point in its own fit, to tell its degrees of freedom ``(*batch, n, m, m)``.
        chi2: of all, what is known beforehand included ``(*batch,)``.
    """

    e: FloatArray
    G: FloatArray
    h: FloatArray
    W: FloatArray
    information: FloatArray
    gradient: FloatArray
    each: FloatArray
    spent: FloatArray
    chi2: FloatArray


_Batch = TypeVar("_Batch", RoundState, Linear)


def linearize(problem: RoundProblem, at: RoundState) -> Linear:
    """Residuals, their derivatives and weights at a state."""
    R, s = at.R, at.s[..., None]
    q = (problem.points - at.c[..., None, :]) @ R
    S = problem.covs  # for equal spreads the same in every frame, and the normal at the point is that at its foot
    if not problem.isotropic:
        S = np.swapaxes(R, -1, -2)[..., None, :, :] @ problem.covs @ R[..., None, :, :]
    foot, found, e, W, SG = _feet(problem.distance, q, S, s, 1 if problem.isotropic else _FEET)
    GS = np.swapaxes(SG, -1, -2)
    along = S - SG @ W @ GS
    e = e.copy()
    e[..., -1] -= 0.5 * np.sum(found.H * along, axis=(-2, -1))
    h = _by_unknowns(problem, found.G, foot, found.by_size)
    hW = np.swapaxes(h, -1, -2) @ W
    spent, gradient = hW @ h, np.sum((hW @ e[..., None])[..., 0], axis=-2)
    each = np.sum(e * (W @ e[..., None])[..., 0], axis=-1)
    if problem.normals is not None:
        more, slope, off = _of_normals(problem, at, foot, found, along)
        spent, gradient, each = spent + more, gradient + slope, each + off
    information, chi2 = np.sum(spent, axis=-3), np.sum(each, axis=-1)
    information, gradient, chi2 = _add_known(problem, at, information, gradient, chi2)
    G = found.G @ np.swapaxes(R, -1, -2)[..., None, :, :]
    return Linear(e, G, h, W, information, gradient, each, spent, chi2)


def _feet(
    distance: Distance, q: Vectors, S: Covariances, s: FloatArray, passes: int
) -> tuple[Vectors, Distances, FloatArray, FloatArray, FloatArray]:
    """The most likely true places of the points, what is there, distances, weights and ``S G'``."""
    foot = q
    for _ in range(passes):
        found = distance(foot, s)
        SG = S @ np.swapaxes(found.G, -1, -2)
        W = _inverse(found.G @ SG)
        e = found.F + np.sum(found.G * (q - foot)[..., None, :], axis=-1)
        foot = q - (SG @ (W @ e[..., None]))[..., 0]
    return foot, found, e, W, SG


def _inverse(C: Covariances) -> FloatArray:
    """Inverses of 1 x 1 and 2 x 2 covariances."""
    if C.shape[-1] == 1:
        return np.asarray(1 / C)
    a, b, d = C[..., 0, 0], C[..., 0, 1], C[..., 1, 1]
    inverse = np.stack([d, -b, -b, a], axis=-1) / (a * d - b * b)[..., None]
    return np.asarray(inverse.reshape(C.shape))


def _by_unknowns(problem: RoundProblem, G: FloatArray, p: Vectors, by_size: FloatArray) -> FloatArray:
    """``dF`` by a motion of the frame, ``-[G, p x G]``, and by the size."""
    turn = SO3.cross(np.broadcast_to(p[..., None, :], G.shape), G)
    h = -np.concatenate([G, turn], axis=-1)[..., list(problem.rows)]
    return h if problem.known_size == 0 else np.concatenate([h, by_size[..., None]], axis=-1)


def _of_normals(
    problem: RoundProblem, at: RoundState, p: Vectors, found: Distances, along: Covariances
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """What sensed normals add to information ``(.., n, m, m)``, gradient ``(.., m)`` and squares ``(.., n)``."""
    assert problem.normals is not None
    assert problem.normal_sds is not None
    N = found.G[..., -1, :]
    E = SO3.frame_from_axis(N, 2)[..., :2]
    Et = np.swapaxes(E, -1, -2)
    n = problem.normals @ at.R
    r = (Et @ (n - N)[..., None])[..., 0]
    bent = Et @ found.H
    known = np.isfinite(problem.normal_sds)
    variance = np.where(known, problem.normal_sds, 1.0) ** 2
    C = variance[..., None, None] * np.eye(2) + bent @ along @ np.swapaxes(bent, -1, -2)
    W = _inverse(C) * known[..., None, None]
    moved, turned = bent, Et @ (SO3.hat(n) - found.H @ SO3.hat(p))
    h = np.concatenate([moved, turned], axis=-1)[..., list(problem.rows)]
    if problem.known_size != 0:
        h = np.concatenate([h, -(Et @ found.normal_by_size[..., None])], axis=-1)
    hW = np.swapaxes(h, -1, -2) @ W
    return hW @ h, np.sum((hW @ r[..., None])[..., 0], axis=-2), np.sum(r * (W @ r[..., None])[..., 0], axis=-1)


def _add_known(
    problem: RoundProblem, at: RoundState, information: FloatArray, gradient: FloatArray, chi2: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Add what is known beforehand of size and frame."""
    m = len(problem.rows)
    if problem.known_size:
        information, gradient = information.copy(), gradient.copy()
        off = (at.s - problem.size) / problem.known_size
        information[..., -1, -1] += 1 / problem.known_size**2
        gradient[..., -1] += off / problem.known_size
        chi2 = chi2 + off**2
    if problem.known_frame is not None:
        R, c, known = problem.known_frame
        xi = np.concatenate(
            [((at.c - c)[..., None, :] @ R)[..., 0, :], SO3.log(np.swapaxes(R, -1, -2) @ at.R)], axis=-1
        )
        off = xi[..., list(problem.rows)]
        information, gradient = information.copy(), gradient.copy()
        information[..., :m, :m] += known
        gradient[..., :m] += (known @ off[..., None])[..., 0]
        chi2 = chi2 + np.sum(off * (known @ off[..., None])[..., 0], axis=-1)
    return information, gradient, chi2


def settle(
    problem: RoundProblem, start: RoundState, passes: int = _PASSES, settled: float = _SETTLED
) -> tuple[RoundState, Linear, BoolArray]:
    """Iterate to the maximum of the likelihood; also whether each fit of the batch came to rest.

    A fit does where its step, squared and in standard deviations, is below ``settled``.
    """
    state, at = start, linearize(problem, start)
    damping = np.full(at.chi2.shape, 1e-4)
    rest = np.zeros(at.chi2.shape, dtype=bool)
    for _ in range(passes):
        step, size = _step(at, damping)
        trial = moved(problem, state, step)
        new = linearize(problem, trial)
        better = (new.chi2 <= at.chi2 + _UPHILL * (1 + at.chi2)) | (size < _NEAR)
        rest = np.where(better, size < settled, rest | (damping > 1e8))
        state, at = _choose(better, trial, state), _choose(better, new, at)
        damping = np.where(better, np.maximum(0.1 * damping * (damping > 1e-9), 0.0), np.maximum(10 * damping, 1e-6))
        if rest.all():
            break
    return state, at, rest


def _step(at: Linear, damping: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The step and its squared length in standard deviations."""
    d = np.diagonal(at.information, axis1=-2, axis2=-1)
    unit = 1 / np.sqrt(np.where(d > 0, d, 1.0))
    scaled = at.information * unit[..., :, None] * unit[..., None, :]
    eye = np.eye(scaled.shape[-1])
    solved = np.linalg.solve(scaled + (damping + 1e-13)[..., None, None] * eye, (unit * at.gradient)[..., None])
    step = -unit * solved[..., 0]
    return step, np.abs(np.sum(step * at.gradient, axis=-1))


def moved(problem: RoundProblem, state: RoundState, step: FloatArray) -> RoundState:
    """The state after a step; the origin of a cylinder slides to the middle of its points."""
    xi, m = np.zeros((*step.shape[:-1], 6)), len(problem.rows)
    xi[..., list(problem.rows)] = step[..., :m]
    turn = np.linalg.norm(xi[..., 3:], axis=-1, keepdims=True)
    xi[..., 3:] *= np.minimum(1.0, 0.5 / np.maximum(turn, 1e-300))
    R = state.R @ SO3.exp(xi[..., 3:])
    c = state.c + (state.R @ xi[..., :3, None])[..., 0]
    if problem.slides:
        u = R[..., :, 2]
        c = c + u * np.mean(np.sum((problem.points - c[..., None, :]) * u[..., None, :], axis=-1), axis=-1)[..., None]
    s = state.s
    if problem.known_size != 0:
        s = np.clip(s + np.maximum(step[..., -1], -0.5 * s), None, np.minimum(problem.largest, 3 * s + 1e-300))
    return RoundState(R, c, s)


def _choose(better: BoolArray, new: _Batch, old: _Batch) -> _Batch:
    """Field by field, the new where it is better."""
    if better.all():
        return new
    fields = {}
    for field in dataclasses.fields(new):
        a, b = getattr(new, field.name), getattr(old, field.name)
        fields[field.name] = np.where(better.reshape(better.shape + (1,) * (a.ndim - better.ndim)), a, b)
    return dataclasses.replace(new, **fields)
