"""Compute line drawings of features, at their estimate and displaced by multiples of their standard deviation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tanteo.features.feature import Feature, feature_covariance
from tanteo.features.kinds import CIRCLE, CONE, CYLINDER, EDGE, PLANE, SPHERE, VERTEX
from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray, Vectors

_SEGMENTS = 72
"""Number of segments of a circle."""

_RULINGS = 12
"""Number of lines along a cylinder or a cone."""

_LEAST = 0.003
"""Half the drawn extent of a feature sensed at one point [m]."""


def outline(feature: Feature) -> FloatArray:
    """Return line segments that draw a feature over its sensed extent, world frame ``(L, 2, 3)`` [m].

    A plane is a rectangle, an edge a line, a vertex a cross, a circle itself, a cylinder or cone two circles with lines
    between them, a sphere three circles. Kinds that are not in :data:`OUTLINES` are a cross.

    Args:
        feature: feature to draw.
    """
    T = feature.T_world_feature
    local = SE3.apply(SE3.inverse(T), feature.support) if len(feature.support) else np.zeros((1, 3))
    lines = OUTLINES.get(feature.kind.name, _cross)(local, 0.0 if feature.size is None else feature.size.value)
    return np.asarray(SE3.apply(T, lines.reshape(-1, 3)).reshape(-1, 2, 3))


def outlines_off(feature: Feature, sds: float) -> FloatArray:
    """Return the outlines displaced by several standard deviations to both sides ``(M, L, 2, 3)`` [m].

    The displacements are along the principal axes of the covariance of frame and size, with shared errors; the largest
    is last.

    Args:
        feature: feature to draw.
        sds: number of standard deviations; large numbers make small errors visible.
    """
    kind = feature.kind
    m = len(feature.kind.rows)
    C = np.zeros((m + 1, m + 1))
    C[:m, :m] = feature_covariance(feature)[np.ix_(kind.rows, kind.rows)]
    if feature.size is not None:
        C[m, m] = feature.size.variance + sum(float((gain @ gain.T)[0, 0]) for gain in feature.size.shared)
        if len(feature.size.covariance):
            C[m, :m] = C[:m, m] = feature.size.covariance
    values, vectors = np.linalg.eigh(C / np.outer(scale := _scale(feature, m), scale))
    steps = (vectors * np.sqrt(values.clip(0.0))).T * scale
    kept = steps[np.sqrt(values.clip(0.0)) > 1e-12 * np.sqrt(max(values[-1], 1e-300))]
    return np.array([outline(_moved(feature, side * sds * step)) for step in kept for side in (-1.0, 1.0)])


def _scale(feature: Feature, m: int) -> FloatArray:
    """Return units that make rotations and lengths comparable ``(m + 1,)``: rotations at the sensed extent."""
    size = max(float(np.ptp(feature.support, axis=0).max()) if len(feature.support) > 1 else 0.0, _LEAST)
    return np.array([1.0 if row < 3 else 1.0 / size for row in feature.kind.rows] + [1.0])


def _moved(feature: Feature, step: FloatArray) -> Feature:
    """Return the feature with perturbed frame and size."""
    xi = np.zeros(6)
    xi[list(feature.kind.rows)] = step[:-1]
    T = feature.T_world_feature
    move = SE3.exp(xi)
    size = None if feature.size is None else replace(feature.size, value=max(feature.size.value + step[-1], 1e-9))
    moved = T @ move @ SE3.inverse(T)
    support = SE3.apply(moved, feature.support) if len(feature.support) else feature.support
    return replace(feature, T_world_feature=T @ move, size=size, support=support)


def _circle(radius: float, height: float = 0.0) -> FloatArray:
    angles = np.linspace(0.0, 2 * np.pi, _SEGMENTS + 1)
    ring = np.stack([radius * np.cos(angles), radius * np.sin(angles), np.full(_SEGMENTS + 1, height)], axis=1)
    return np.stack([ring[:-1], ring[1:]], axis=1)


def _extent(values: FloatArray) -> tuple[float, float]:
    """Return the interval of the sensed positions, with a minimum length."""
    low = float(values.min())
    high = float(values.max())
    more = max(_LEAST - 0.5 * (high - low), 0.0)
    return low - more, high + more


def _plane(local: Vectors, size: float) -> FloatArray:
    (a, b), (c, d) = _extent(local[:, 0]), _extent(local[:, 1])
    corners = np.array([[a, c, 0.0], [b, c, 0.0], [b, d, 0.0], [a, d, 0.0]])
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def _edge(local: Vectors, size: float) -> FloatArray:
    low, high = _extent(local[:, 0])
    return np.array([[[low, 0.0, 0.0], [high, 0.0, 0.0]]])


def _cross(local: Vectors, size: float) -> FloatArray:
    arms = _LEAST * np.eye(3)
    return np.stack([-arms, arms], axis=1)


def _rim(local: Vectors, size: float) -> FloatArray:
    return _circle(size)


def _cylinder(local: Vectors, size: float) -> FloatArray:
    low, high = _extent(local[:, 2])
    return _wall((low, size), (high, size))


def _cone(local: Vectors, size: float) -> FloatArray:
    low, high = _extent(local[:, 2])
    return _wall(*((z, abs(z) * np.tan(size)) for z in (low, high)))


def _wall(*ends: tuple[float, float]) -> FloatArray:
    """Return circles at two heights with given radii, and lines between them."""
    rings = [_circle(radius, z) for z, radius in ends]
    rows = np.arange(0, _SEGMENTS, _SEGMENTS // _RULINGS)
    return np.concatenate([*rings, np.stack([ring[rows, 0] for ring in rings], axis=1)])


def _sphere(local: Vectors, size: float) -> FloatArray:
    ring = _circle(size)
    return np.concatenate([ring, np.roll(ring, 1, axis=-1), np.roll(ring, 2, axis=-1)])


OUTLINES: dict[str, Callable[[Vectors, float], FloatArray]] = {
    PLANE.name: _plane, EDGE.name: _edge, VERTEX.name: _cross, CIRCLE.name: _rim, CYLINDER.name: _cylinder,
    CONE.name: _cone, SPHERE.name: _sphere,
}  # fmt: skip
"""Functions that draw each kind in its own frame ``(L, 2, 3)`` from sensed points ``(n, 3)`` and size."""
