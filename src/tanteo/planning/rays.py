"""Intersections of rays with a part at many poses, and averages over the rays of a beam's cone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.geometry import SO3
from tanteo.geometry.typing import FloatArray, IntArray, Transforms, Vectors
from tanteo.planning.probe import Probe
from tanteo.posterior import PreparedPart

_THIN = np.radians(0.5)
"""Half angle of a beam up to which it is modelled as one ray [rad], because its spot is small."""

_RAYS, _GOLDEN = 7, np.pi * (3 - np.sqrt(5))
"""Number of rays of a cone, and angle between successive rays about its axis [rad]."""

Axis = tuple[FloatArray, FloatArray, FloatArray]
"""Range, cosine of incidence and derivatives of the range over the pose, for the axis of each beam."""


def has_cone(probe: Probe) -> bool:
    """Return whether the beam of a sensor is so wide that several rays of its cone are modelled.

    Args:
        probe: sensor model.
    """
    return not probe.contact and probe.beam_half_angle > _THIN


@dataclass(frozen=True, slots=True, eq=False)
class RayHits:
    """First intersections of ``C`` rays with a part at ``S`` poses.

    Attributes:
        distances: ranges ``(C, S)`` [m]; infinite for a miss.
        cosines: cosines of the incidence ``(C, S)``; 0 for a miss.
        faces: indices of the faces ``(C, S)``; -1 for a miss.
        derivatives: derivatives of the ranges over the pose ``(C, S, 6)``; 0 for a miss.
    """

    distances: FloatArray
    cosines: FloatArray
    faces: IntArray
    derivatives: FloatArray


def cast_rays(target: PreparedPart, Ts: Transforms, origins: Vectors, directions: Vectors) -> RayHits:
    """Return the first intersection of each ray with a part at several poses.

    Args:
        target: the part.
        Ts: poses ``T_world_part`` ``(S, 4, 4)``.
        origins: origins of the rays, world frame ``(C, 3)`` [m].
        directions: unit directions, world frame ``(C, S, 3)`` or ``(C, 1, 3)``.
    """
    poses, starts, along = (np.ascontiguousarray(values) for values in (Ts, origins, directions))
    distances, cosines, faces, derivatives = _core.beams(target.shape, poses, starts, along)
    return RayHits(distances, cosines, faces.astype(np.int64), derivatives)


def of_cone(
    target: PreparedPart, Ts: Transforms, origins: Vectors, directions: Vectors, axis: Axis, probe: Probe
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return averages over the rays of each beam's cone that have an echo.

    The rays include the axis and represent equal areas of the cone's disc. They are rotated from sample to sample, so
    that over many samples the disc is covered evenly.

    Args:
        target: the part.
        Ts: poses ``T_world_part`` ``(S, 4, 4)``.
        origins: origins of the beams, world frame ``(C, 3)`` [m].
        directions: unit directions of the axes, world frame ``(C, 3)``.
        axis: intersections of the axes.
        probe: sensor model.

    Returns:
        Mean range [m] and cosine of incidence, derivatives of the range of the first ray with an echo over the pose,
        fraction of rays with an echo, and variance of the range between rays beyond that on a plane [m^2]. The shapes
        are ``(C, S)``, that of the derivatives ``(C, S, 6)``.
    """
    d, cosine, g = axis
    answers, g = probe.answers(d, cosine), g.copy()
    n, total, cosines = answers.astype(np.float64), np.where(answers, d, 0.0), np.where(answers, cosine, 0.0)
    squares, across = total**2, SO3.frame_from_axis(directions, 2)[:, None]
    for k in range(1, _RAYS):
        slope, turn = np.tan(probe.beam_half_angle) * np.sqrt((k + 0.5) / _RAYS), _GOLDEN * (k + np.arange(len(Ts)))
        radial = across[..., 0] * np.cos(turn)[:, None] + across[..., 1] * np.sin(turn)[:, None]
        length = np.sqrt(1 + slope**2)
        hits = cast_rays(target, Ts, origins, (directions[:, None] + slope * radial) / length)
        answers = probe.answers(hits.distances, hits.cosines)
        first = np.nonzero(answers & (n == 0))
        g[first] = hits.derivatives[first]
        depth = np.where(answers, hits.distances, 0.0) / length  # along the axis, to which the range refers
        n, total, squares = n + answers, total + depth, squares + depth**2
        cosines += np.where(answers, hits.cosines, 0.0)
    none, some = n == 0, np.maximum(n, 1.0)
    mean, cosine = total / some, np.where(none, 1.0, cosines / some)
    scatter = np.maximum(squares / some - mean**2 - probe.cone_variance(mean, cosine), 0.0)
    return np.where(none, np.inf, mean), np.where(none, 0.0, cosine), g, n / _RAYS, scatter
