"""Readings that the probe can really make: places on what may be there, from where it may come, with room to come."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors
from tanteo.planning.clearance import has_room
from tanteo.planning.predictions import predict
from tanteo.planning.probe import Probe
from tanteo.planning.samples import draw
from tanteo.planning.state import SensingState
from tanteo.posterior import PreparedPart

_LIKELY = 0.01
"""Modes of at least this probability are aimed at."""

_TRIED = 320
"""Places of a mode at least that are tried."""

_SHARP = 1e-5
"""A sharp tip ends so far before the surface that it touches, which then does not hide its stylus [m]."""
_TILT_SDS = 3.0
"""Standard deviations of the part's attitude by which it may lean on the stylus."""

_TOO_NEAR, _SOME, _DRAWS = 0.01, 0.25, 64
"""Probability that a reading is nearer than the sensor's least range, up to which it may be, by so many poses; that
share of the readings may be in any case."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Readings to choose from.

    Attributes:
        origins: where the probe starts, world ``(C, 3)`` [m].
        directions: in which it looks or moves, unit, world ``(C, 3)``.
        mode: mode of the belief that each is aimed at ``(C,)``.
        face: index of the face of that mode's part that is to be met ``(C,)``.
        ranges: after which it is, if that mode is true ``(C,)`` [m].
    """

    origins: Vectors
    directions: Vectors
    mode: IntArray
    face: IntArray
    ranges: FloatArray

    def __len__(self) -> int:
        return len(self.origins)

    def take(self, rows: IntArray | BoolArray) -> Candidates:
        """Some of them."""
        return Candidates(*(getattr(self, name)[rows] for name in self.__slots__))

    @property
    def aims(self) -> Vectors:
        """What each would meet if its mode is true, world ``(C, 3)`` [m]."""
        return np.asarray(self.origins + self.ranges[:, None] * self.directions)


def propose(state: SensingState, probe: Probe, count: int = 500, seed: int = 0, *, anywhere: bool = True) -> Candidates:
    """Readings on the likelier modes, about as many as asked for, that keep clear of every mode that is alive.

    Args:
        state: what is known.
        probe: what senses, and where it may come from.
        count: of readings.
        seed: which places of the surfaces are tried.
        anywhere: keep clear of the part wherever the belief says that it may be, not only at the pose of each mode.
    """
    w = state.weights
    likely = np.flatnonzero(w >= min(_LIKELY, w.max(initial=0.0)))
    likely = likely[np.argsort(-w[likely], kind="stable")][: max(1, count // 20)]
    share = np.sqrt(w[likely]) / max(np.sqrt(w[likely]).sum(), 1e-300)
    some = [_on_mode(state, int(k), probe, int(np.ceil(n)), seed) for k, n in zip(likely, count * share, strict=True)]
    if not some:
        none, nowhere = np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        return Candidates(nowhere, nowhere, none, none, np.zeros(0))
    joint = Candidates(*(np.concatenate([getattr(c, name) for c in some]) for name in Candidates.__slots__))
    joint = joint.take(has_room(state, joint, probe, anywhere=anywhere))
    return joint.take(_far_enough(state, joint, probe)) if probe.min_range > 0 and len(joint) else joint


def _far_enough(state: SensingState, candidates: Candidates, probe: Probe) -> BoolArray:
    """Readings that are improbably too near for the sensor ``(C,)``; those for which it is least, if it is for most."""
    samples = draw(state, _DRAWS)
    near = (predict(samples, candidates.origins, candidates.directions).ranges < probe.min_range) @ samples.weights
    return np.asarray(near <= max(_TOO_NEAR, float(np.quantile(near, _SOME))))


def _on_mode(state: SensingState, k: int, probe: Probe, count: int, seed: int) -> Candidates:
    """Readings that would meet evenly spread places of one mode first, at an incidence that the probe answers to."""
    target, T = state.target(k), state.poses[k]
    rows = np.random.default_rng((1991, seed, k)).permutation(len(target.samples))[: max(_TRIED, count)]
    points, normals, faces = target.samples[rows], target.normals[rows], target.sample_faces[rows]
    world, outward = SE3.apply(T, points), normals @ T[:3, :3].T
    directions, to_part = within_cone(-outward, probe), SE3.inverse(T)
    cosines = -np.sum(directions * outward, axis=1)
    ok = cosines > np.cos(0.95 * probe.max_incidence)
    ranges = np.resize(probe.standoffs, len(points))
    if probe.stylus is not None:
        ranges = _between_walls(target, points, -directions @ to_part[:3, :3].T, ranges, probe.clearance)
    origins = world - ranges[:, None] * directions
    first = target.surface.cast(SE3.apply(to_part, origins), directions @ to_part[:3, :3].T).distances
    ok &= np.abs(first - ranges) < 1e-6 + 1e-3 * ranges
    if probe.stylus is not None or probe.stylus_behind:
        tilt = _TILT_SDS * float(np.sqrt(np.linalg.eigvalsh(state.covariances[k][3:, 3:])[-1]))
        contacts = world + max(probe.radius, _SHARP) * outward
        ok[ok] = _stylus_free(target, to_part, origins[ok], contacts[ok], directions[ok], probe, tilt)
    index = np.flatnonzero(ok)[:count]
    return Candidates(origins[index], directions[index], np.full(len(index), k), faces[index], ranges[index])


def _between_walls(
    target: PreparedPart, points: Vectors, back: Vectors, ranges: FloatArray, clearance: float
) -> FloatArray:
    """Stand-offs ``(n,)`` [m], half of the way to the wall behind where there is no more: in a bore from its axis.

    Args:
        target: the part.
        points: to be met, in its frame ``(n, 3)``.
        back: from there to the start, likewise.
        ranges: stand-offs where there is room.
        clearance: that the start needs [m].
    """
    away = 1e-6 * target.part.diagonal
    free = target.surface.cast(points + away * back, back).distances + away
    return np.asarray(np.where(free < ranges + clearance, 0.5 * free, ranges))


def _stylus_free(
    target: PreparedPart,
    to_part: Transforms,
    starts: Vectors,
    contacts: Vectors,
    directions: Vectors,
    probe: Probe,
    tilt: float,
) -> BoolArray:
    """Whether the part leaves the stylus free from start to contact, also where it leans by ``tilt`` [rad] ``(n,)``.

    The stylus is taken as half as thick as the ball; the contacts are of the ball's centre.
    """
    up = -directions if probe.stylus is None else np.broadcast_to(probe.stylus, directions.shape)
    sides = SO3.frame_from_axis(up, 2)[..., :2]
    sides = np.concatenate([np.zeros((len(up), 3, 1)), sides, -sides], axis=-1).swapaxes(-1, -2)  # (n, 5, 3)
    rays = up[:, None] + np.tan(tilt) * sides
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    free = np.ones(len(up), dtype=bool)
    for share in (0.0, 0.5, 1.0):
        centres = starts + share * (contacts - starts)
        from_here = SE3.apply(to_part, centres[:, None] + 0.5 * probe.radius * sides)
        free &= np.isinf(target.surface.cast(from_here, rays @ to_part[:3, :3].T).distances).all(axis=1)
    return free


def within_cone(directions: Vectors, probe: Probe) -> Vectors:
    """The allowed directions nearest to these ``(C, 3)``."""
    if probe.approach is None:
        return directions
    a = probe.approach
    along = directions @ a
    across = directions - along[:, None] * a
    length = np.linalg.norm(across, axis=1, keepdims=True)
    beside = SO3.frame_from_axis(a, 2)[:, 0]  # straight against the cone's axis every direction of its edge is as near
    across = np.where(length > 1e-9, across, beside)
    length = np.where(length > 1e-9, length, 1.0)
    edge = np.cos(probe.cone) * a + np.sin(probe.cone) * across / length
    return np.where((along >= np.cos(probe.cone))[:, None], directions, edge)
