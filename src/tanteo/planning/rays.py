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
"""Half angle up to which a beam is modelled as one ray [rad], because its spot is small."""

_RAYS, _GOLDEN = 7, np.pi * (3 - np.sqrt(5))
"""Number of rays of a cone, and angle between successive rays about its axis [rad]."""

Axis = tuple[FloatArray, FloatArray, FloatArray]
"""Range, cosine and derivatives of the beam's axis."""


def has_cone(probe: Probe) -> bool:
    """Return whether a beam is so wide that its rays are modelled separately."""
    return not probe.contact and probe.beam_half_angle > _THIN


@dataclass(frozen=True, slots=True, eq=False)
class Met:
    """First intersections of rays with a part at poses.

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


def rays_met(target: PreparedPart, Ts: Transforms, origins: Vectors, directions: Vectors) -> Met:
    """Return the first intersections of rays with a part at poses.

    Args:
        target: the part.
        Ts: poses ``(S, 4, 4)``.
        origins: origins of the rays, world frame ``(C, 3)`` [m].
        directions: unit directions, world frame ``(C, S, 3)`` or ``(C, 1, 3)``.
    """
    poses, starts, along = (np.ascontiguousarray(values) for values in (Ts, origins, directions))
    distances, cosines, faces, derivatives = _core.beams(target.shape, poses, starts, along)
    return Met(distances, cosines, faces.astype(np.int64), derivatives)


def of_cone(
    target: PreparedPart, Ts: Transforms, origins: Vectors, directions: Vectors, axis: Axis, probe: Probe
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return averages over the answered rays of a cone: range, cosine, derivatives, fraction, and variance ``(C, S)``.

    The rays stand for equal areas of the cone's disc and include its axis. They rotate from sample to sample, so that
    all places of the disc have equal weight over many samples.
    """
    d, cosine, g = axis
    answers, g = probe.answers(d, cosine), g.copy()
    n, total, cosines = answers.astype(np.float64), np.where(answers, d, 0.0), np.where(answers, cosine, 0.0)
    squares, across = total**2, SO3.frame_from_axis(directions, 2)[:, None]
    for k in range(1, _RAYS):
        slope, turn = np.tan(probe.beam_half_angle) * np.sqrt((k + 0.5) / _RAYS), _GOLDEN * (k + np.arange(len(Ts)))
        aside = across[..., 0] * np.cos(turn)[:, None] + across[..., 1] * np.sin(turn)[:, None]
        length = np.sqrt(1 + slope**2)
        met = rays_met(target, Ts, origins, (directions[:, None] + slope * aside) / length)
        answers = probe.answers(met.distances, met.cosines)
        first = np.nonzero(answers & (n == 0))
        g[first] = met.derivatives[first]
        depth = np.where(answers, met.distances, 0.0) / length  # along the axis, to which the range refers
        n, total, squares = n + answers, total + depth, squares + depth**2
        cosines += np.where(answers, met.cosines, 0.0)
    none, some = n == 0, np.maximum(n, 1.0)
    mean, cosine = total / some, np.where(none, 1.0, cosines / some)
    scatter = np.maximum(squares / some - mean**2 - probe.cone_variance(mean, cosine), 0.0)
    return np.where(none, np.inf, mean), np.where(none, 0.0, cosine), g, n / _RAYS, scatter
