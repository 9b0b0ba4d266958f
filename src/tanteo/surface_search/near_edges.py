"""Readings near an edge of the part: how likely they are on each of the faces that meet there.

The density of a sensed point is the integral of its noise over the surface, ``p(x) = int w(q) N(x; q, C) dq``, with
``w`` one over the area if nobody knows how it was aimed, and the cosine of incidence if its direction is known. On a
plane that reaches beyond the noise this is a normal density of the distance. Near an edge two faces have a share
each, and each share is cut where its face ends: ``N(d; 0, s^2) Phi(b / t)``, ``d`` off the plane, ``b`` inside the
line. The distance to the nearest surface point instead says too much within a few standard deviations of every edge.
A sensed normal tells the faces apart: each share counts as the normal agrees with its face.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.lie import SO3
from tanteo.shapes import Junctions
from tanteo.surface_search.cover import covered, log_cover
from tanteo.surface_search.edge_faces import exact_planes, weights, with_others
from tanteo.surface_search.sensed_normals import Tilts, tilts
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import Touches
from tanteo.typing import FloatArray, IntArray, Transforms, Vectors

REACH = 4.0
"""Edges farther off than this many standard deviations do not matter."""

_BROAD = 2.0
"""Faces narrower than this many standard deviations are no faces to the noise: facets of a curve, rims of a sheet."""


@dataclass(frozen=True, slots=True, eq=False)
class NearEdges:
    """The ``k`` readings near edges, among all readings ``n`` at all poses ``S``.

    Attributes:
        poses: row of the pose ``(k,)``.
        readings: row of the reading ``(k,)``.
        log: log density if the reading is on the part ``(k,)``.
        slope: gradient of it by the reading's place in the part's frame ``(k, 3)``.
        stiffness: information of it on that place given the faces, never negative ``(k, 3, 3)``.
        moves: how the place moves with pose and shared errors ``(k, 3, 6 + D)``.
        turned: what sensed normals add to gradient and information; None if there are none.
        off: how far it is off all of the faces together, in standard deviations ``(k,)``: as a normal density would
            have to be to fall as much below that of a reading in the middle of the likeliest face.
        tilts: of its sensed normal against that of the likeliest face, likewise; 0 where none was sensed ``(k,)``.
    """

    poses: IntArray
    readings: IntArray
    log: FloatArray
    slope: FloatArray
    stiffness: FloatArray
    moves: FloatArray
    turned: _Turned | None
    off: FloatArray
    tilts: FloatArray

    @property
    def gradient(self) -> FloatArray:
        """Of :attr:`log` by pose and shared errors ``(k, 6 + D)``."""
        gradient = (self.slope[:, None] @ self.moves)[:, 0]
        if self.turned is not None:
            gradient[self.turned.which] += self.turned.gradient
        return np.asarray(gradient)

    @property
    def resistance(self) -> FloatArray:
        """Information on pose and shared errors given the faces, never negative ``(k, 6 + D, 6 + D)``."""
        resistance = np.swapaxes(self.moves, 1, 2) @ self.stiffness @ self.moves
        if self.turned is not None:
            resistance[self.turned.which] += self.turned.resistance
        return np.asarray(resistance)

    def add_to(self, A: FloatArray, b: FloatArray, share: FloatArray) -> None:
        """Add what all readings of a pose say, each with its share ``(k,)``, to information and gradient of the poses.

        Summed as places, which have three coordinates however many errors are shared, in one product a pose.
        """
        poses, first, counts = np.unique(self.poses, return_index=True, return_counts=True)  # they come in order
        shape = len(poses), int(counts.max()), 3
        row = np.repeat(np.arange(len(poses)), counts)
        slot = np.arange(len(self.poses)) - np.repeat(first, counts)
        moves, pushes = np.zeros((*shape, A.shape[-1])), np.zeros((*shape, A.shape[-1]))
        slopes = np.zeros(shape)
        moves[row, slot] = self.moves
        pushes[row, slot] = (share[:, None, None] * self.stiffness) @ self.moves
        slopes[row, slot] = share[:, None] * self.slope
        rows = shape[0], 3 * shape[1]
        turned = np.swapaxes(moves.reshape(*rows, -1), 1, 2)
        A[poses] += turned @ pushes.reshape(*rows, -1)
        b[poses] += (turned @ slopes.reshape(*rows, 1))[..., 0]
        if self.turned is not None:
            share, of = share[self.turned.which], self.poses[self.turned.which]
            np.add.at(A, of, share[:, None, None] * self.turned.resistance)
            np.add.at(b, of, share[:, None] * self.turned.gradient)


@dataclass(frozen=True, slots=True, eq=False)
class _Turned:
    """What sensed normals say of pose and shared errors, for some of the readings near edges.

    Attributes:
        which: of these ``(m,)``.
        gradient: ``(m, 6 + D)``.
        resistance: ``(m, 6 + D, 6 + D)``.
    """

    which: IntArray
    gradient: FloatArray
    resistance: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """Those readings in the part, with the faces each may have met and how each face is cut (all by face)."""

    poses: IntArray
    readings: IntArray
    at: Vectors
    faces: Junctions
    log: FloatArray
    d: FloatArray
    s2: FloatArray
    slant: FloatArray
    t: FloatArray
    beta: FloatArray
    beyond: FloatArray
    with_normal: IntArray
    tilts: Tilts | None


def near_edges(touches: Touches, target: Target, R: Transforms, p: Vectors, nearest: IntArray) -> NearEdges | None:
    """Look at the readings near edges; None if there are none.

    Readings of a ball that is large beside the noise are not concerned: its surface is round where the part's is sharp.

    Args:
        touches: the readings.
        target: the part.
        R: its attitudes ``(S, 3, 3)``.
        p: the readings in the part's frame ``(S, n, 3)`` [m].
        nearest: the triangle nearest to each ``(S, n)``.
    """
    seen = _seen(touches, target, R, p, nearest)
    if seen is None:
        return None
    log, share, slope, stiffness = _mixture(seen)
    moves = _moves(seen, touches, R)
    turned = None if seen.tilts is None else _turned(seen, seen.tilts, share, moves)
    off, own = np.sqrt(np.maximum(2 * (seen.log.max(axis=1) - log), 0.0)), np.zeros(len(log))
    if seen.tilts is not None:
        k = seen.with_normal
        own[k] = np.linalg.norm(seen.tilts.gap[np.arange(len(k)), share[k].argmax(axis=1)], axis=1)
    return NearEdges(seen.poses, seen.readings, log, slope, stiffness, moves, turned, off, own)


def log_near_edges(
    touches: Touches, target: Target, R: Transforms, p: Vectors, nearest: IntArray
) -> tuple[IntArray, IntArray, FloatArray] | None:
    """The first three of :func:`near_edges`, where no derivative is needed."""
    seen = _seen(touches, target, R, p, nearest)
    if seen is None:
        return None
    log = seen.log - 0.5 * seen.d * seen.d / seen.s2 + log_cover(seen.beta, seen.beyond, seen.faces.reflex)[0]
    return seen.poses, seen.readings, _log_sum(log)


def _seen(touches: Touches, target: Target, R: Transforms, p: Vectors, nearest: IntArray) -> _Seen | None:
    concerned = touches.radii < touches.sd
    if not concerned.any():
        return None
    reach = REACH * touches.sd
    s, n = np.nonzero(concerned & target.borders.near(p, np.broadcast_to(reach, p.shape[:2])))
    if not len(s):
        return None
    gaps, rows = target.borders.nearest(p[s, n], reach[n])
    concerns = (gaps < reach[n]) & (target.borders.narrowest[rows] >= _BROAD * touches.sd[n])
    if not concerns.any():
        return None
    s, n, rows = s[concerns], n[concerns], rows[concerns]
    at, along = p[s, n], (touches.directions[n, None] @ R[s])[:, 0]
    outward = np.where(touches.oriented[n, None], (touches.normals[n, None] @ R[s])[:, 0], -along)
    faces, past = with_others(touches, target, target.borders.junctions.take(rows), at, outward, n, nearest[s, n])
    log = weights(touches, target, faces, along, n) - past
    used = int(np.flatnonzero(faces.valid.any(axis=0)).max()) + 1
    faces, log = exact_planes(target, at, faces.first(used)), log[:, :used]
    k, tilt = np.flatnonzero(touches.oriented[n]), None
    if len(k):
        tilt = _tilts(touches, target, R[s[k]], n[k], at[k], faces.take(k))
        log[k] += tilt.log
    return _cut(touches, R, s, n, at, faces, log, k, tilt)


def _tilts(touches: Touches, target: Target, R: Transforms, n: IntArray, at: Vectors, faces: Junctions) -> Tilts:
    """The normals of readings ``n`` with each of the faces that they may have met ``(k, F)``."""
    shape, m = faces.offsets.shape, touches.normals[n, None] @ R
    turn, at = np.broadcast_to(R[:, None], (*shape, 3, 3)), np.broadcast_to(at[:, None], (*shape, 3))
    which, m = np.broadcast_to(n[:, None], shape), np.broadcast_to(m, (*shape, 3))
    return tilts(touches, target, turn, which, m, at, faces.normals, faces.triangles)


def _cut(
    touches: Touches,
    R: Transforms,
    s: IntArray,
    n: IntArray,
    at: Vectors,
    faces: Junctions,
    log: FloatArray,
    with_normal: IntArray,
    tilt: Tilts | None,
) -> _Seen:
    """How far each reading is off each face, and inside its lines, with the spread of its noise both ways."""
    normals, m = faces.normals, faces.inward
    lines = np.any(m != 0, axis=-1)
    d = np.where(faces.valid, (normals @ at[:, :, None])[..., 0] - faces.offsets, 0.0)
    inside = (m @ at[:, None, :, None])[..., 0] - faces.limits
    if not np.isnan(touches.variance):
        s2, slant = np.full(d.shape, touches.variance), np.zeros(inside.shape)
        t = np.where(lines, np.sqrt(touches.variance), 1.0)
    else:
        turn = R[s]
        C = np.swapaxes(turn, 1, 2) @ touches.covs[n] @ turn
        Cn = normals @ C
        s2 = np.where(faces.valid, np.sum(Cn * normals, axis=-1), 1.0)
        slant = np.sum(m * Cn[:, :, None], axis=-1) / s2[..., None]  # what the distance says of the place across
        t2 = np.sum((m @ C[:, None]) * m, axis=-1) - slant**2 * s2[..., None]
        t = np.sqrt(np.where(lines, np.maximum(t2, 1e-6 * s2[..., None]), 1.0))
        inside = inside - slant * d[..., None]
    beta = np.where(lines, inside / t, np.inf)
    beyond = np.where(lines, (inside - faces.widths) / t, -np.inf)
    return _Seen(s, n, at, faces, log - 0.5 * np.log(2 * np.pi * s2), d, s2, slant, t, beta, beyond, with_normal, tilt)


def _log_sum(log: FloatArray) -> FloatArray:
    """Log of the sum over the faces; one of them at least is finite or the reading is on none ``(k,)``."""
    top = log.max(axis=1)
    safe = np.where(np.isfinite(top), top, 0.0)
    with np.errstate(divide="ignore"):
        return np.asarray(safe + np.log(np.exp(log - safe[:, None]).sum(axis=1)))


def _mixture(seen: _Seen) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Log density ``(k,)``, shares of the faces ``(k, F)``, slope, and the stiffness if the faces were known."""
    faces, d, s2 = seen.faces, seen.d, seen.s2
    cover, pull, hold = covered(seen.beta, seen.beyond, faces.reflex)
    log = seen.log - 0.5 * d * d / s2 + cover
    total = _log_sum(log)
    share = np.exp(log - total[:, None])
    across = (faces.inward - seen.slant[..., None] * faces.normals[:, :, None]) / seen.t[..., None]
    slopes = np.sum(pull[..., None] * across, axis=2) - (d / s2)[..., None] * faces.normals
    ways = np.concatenate(
        [faces.normals[:, :, None] / np.sqrt(s2)[..., None, None], np.sqrt(hold)[..., None] * across], 2
    )
    ways = (np.sqrt(share)[..., None, None] * ways).reshape(len(share), -1, 3)
    return total, share, np.sum(share[..., None] * slopes, axis=1), np.swapaxes(ways, 1, 2) @ ways


def _turned(seen: _Seen, tilts: Tilts, share: FloatArray, moves: FloatArray) -> _Turned:
    """What the sensed normals add, each face with its share."""
    k, wide = seen.with_normal, (len(seen.with_normal), share.shape[1])
    gains = moves[k, None, :, 6:]
    turns = tilts.rows(*(np.broadcast_to(x, (*wide, *x.shape[2:])) for x in (seen.at[k, None], gains)))
    turns = np.sqrt(share[k])[..., None, None] * turns
    gradient = -np.einsum("kfij,kfi->kj", turns, np.sqrt(share[k])[..., None] * tilts.gap)
    rows = turns.reshape(len(k), -1, turns.shape[-1])
    return _Turned(k, gradient, np.swapaxes(rows, 1, 2) @ rows)


def _moves(seen: _Seen, touches: Touches, R: Transforms) -> FloatArray:
    """How the readings move in the part's frame with its pose and with shared errors ``(k, 3, 6 + D)``."""
    gains = np.swapaxes(R[seen.poses], 1, 2) @ touches.gains[seen.readings]
    still = np.broadcast_to(-np.eye(3), (len(seen.at), 3, 3))
    return np.concatenate([still, SO3.hat(seen.at), gains], axis=-1)
