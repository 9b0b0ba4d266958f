"""Candidate readings: points on possible parts that the probe can reach by a clear approach."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors
from tanteo.planning.clearance import has_clearance
from tanteo.planning.predictions import predict
from tanteo.planning.probe import Probe, nearest_in_cone
from tanteo.planning.samples import draw
from tanteo.planning.state import SensingState
from tanteo.posterior import PreparedPart

_LIKELY = 0.01
"""Smallest probability of a mode at which candidates aim."""

_TRIED = 320
"""Smallest number of surface points of a mode that are tried."""

_SHARP = 1e-5
"""Distance of a sharp tip from its surface in the visibility check of the stylus [m]."""
_TILT_SDS = 3.0
"""Tilt of the part in the collision check of the stylus, as a multiple of its standard deviation."""

_TOO_NEAR, _SOME, _DRAWS = 0.01, 0.25, 64
"""Largest allowed probability that a reading is below the sensor's smallest range, smallest fraction of the candidates
that is kept in any case, and number of sampled poses for the estimate."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Candidate readings of a probe.

    Attributes:
        origins: starts of the beams or motions, world frame ``(C, 3)`` [m].
        directions: unit directions of the beams or motions, world frame ``(C, 3)``.
        mode: index of the posterior mode at which each candidate aims ``(C,)``.
        face: index of the aimed face of that mode's part ``(C,)``.
        ranges: distance from the start to the face if that mode is true ``(C,)`` [m].
    """

    origins: Vectors
    directions: Vectors
    mode: IntArray
    face: IntArray
    ranges: FloatArray

    def __len__(self) -> int:
        return len(self.origins)

    def take(self, rows: IntArray | BoolArray) -> Candidates:
        """Return some of the candidates.

        Args:
            rows: indices or flags of the candidates.
        """
        return Candidates(*(getattr(self, name)[rows] for name in self.__slots__))

    @property
    def aims(self) -> Vectors:
        """Points at which the candidates hit the part if their modes are true, world frame ``(C, 3)`` [m]."""
        return np.asarray(self.origins + self.ranges[:, None] * self.directions)


def propose(state: SensingState, probe: Probe, count: int = 500, seed: int = 0, *, anywhere: bool = True) -> Candidates:
    """Return candidate readings of the more probable modes whose approach is clear of the part at all modes.

    Args:
        state: posterior of the session.
        probe: sensor model with the limits of its approach.
        count: approximate number of candidates before the check of their approaches.
        seed: seed of the random surface points.
        anywhere: whether approaches must be clear of sampled poses of each mode, or only of its most probable pose.
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
    joint = joint.take(has_clearance(state, joint, probe, anywhere=anywhere))
    return joint.take(_far_enough(state, joint, probe)) if probe.min_range > 0 and len(joint) else joint


def _far_enough(state: SensingState, candidates: Candidates, probe: Probe) -> BoolArray:
    """Return flags of the candidates whose range is rarely below the sensor's smallest range ``(C,)``.

    At least a quarter of the candidates is kept: those with the smallest probability.
    """
    samples = draw(state, _DRAWS)
    near = (predict(samples, candidates.origins, candidates.directions).ranges < probe.min_range) @ samples.weights
    return np.asarray(near <= max(_TOO_NEAR, float(np.quantile(near, _SOME))))


def _on_mode(state: SensingState, k: int, probe: Probe, count: int, seed: int) -> Candidates:
    """Return candidates that hit random surface points of one mode at an allowed incidence, without obstruction."""
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
    if probe.stylus is not None or probe.stylus_along_motion:
        tilt = _TILT_SDS * float(np.sqrt(np.linalg.eigvalsh(state.covariances[k][3:, 3:])[-1]))
        contacts = world + max(probe.radius, _SHARP) * outward
        ok[ok] = _stylus_free(target, to_part, origins[ok], contacts[ok], directions[ok], probe, tilt)
    index = np.flatnonzero(ok)[:count]
    return Candidates(origins[index], directions[index], np.full(len(index), k), faces[index], ranges[index])


def _between_walls(
    target: PreparedPart, points: Vectors, back: Vectors, ranges: FloatArray, clearance: float
) -> FloatArray:
    """Return stand-offs that are at most half of the distance to an opposite wall, as in a bore ``(n,)`` [m].

    Args:
        target: the part.
        points: aimed points, part frame ``(n, 3)`` [m].
        back: unit directions from the points to the starts, part frame ``(n, 3)``.
        ranges: intended stand-offs ``(n,)`` [m].
        clearance: clearance of the start [m].
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
    """Return whether the stylus misses the part from start to contact, even if the part is tilted ``(n,)``.

    The stylus is modelled by five rays within half of the ball's radius, tilted by ``tilt``.

    Args:
        target: the part.
        to_part: pose ``T_part_world`` ``(4, 4)``.
        starts: starts of the ball's centre, world frame ``(n, 3)`` [m].
        contacts: ball's centre at contact, world frame ``(n, 3)`` [m].
        directions: unit directions of the motions, world frame ``(n, 3)``.
        probe: sensor model.
        tilt: largest tilt of the part [rad].
    """
    up = probe.holders(directions)
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
    """Return the unit directions in the probe's approach cone that are nearest to given ones ``(C, 3)``.

    Args:
        directions: unit directions, world frame ``(C, 3)``.
        probe: sensor model; without an approach cone all directions are allowed.
    """
    if probe.axis_parallel:
        return _along_axes(directions, probe)
    return directions if probe.approach is None else nearest_in_cone(directions, probe.approach, probe.cone)


def _along_axes(directions: Vectors, probe: Probe) -> Vectors:
    """Return the axes of the world, among those in the approach cone, that are nearest to given directions."""
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    if probe.approach is not None:
        axes = axes[axes @ probe.approach >= np.cos(probe.cone) - 1e-9]
    if not len(axes):
        return nearest_in_cone(directions, probe.approach, probe.cone) if probe.approach is not None else directions
    return np.asarray(axes[np.argmax(directions @ axes.T, axis=1)])
