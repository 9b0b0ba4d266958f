"""Is a patch of a mesh a cylinder, a cone or a sphere? Fits to the corners and normals of its facets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tanteo import _core
from tanteo.parts.part import SurfaceKind
from tanteo.typing import FloatArray

NORMAL_TOLERANCE = 0.02
"""How far facet normals may lie off the ruling condition of a cylinder or cone [rad]."""

CORNER_TOLERANCE = 0.1
"""How far corners may lie off the fitted surface, relative to how far the facets' centres lie off it (the sagitta)."""


_ENOUGH = 200
"""Corners that tell a cone."""


def fit_curved(
    corners: FloatArray, centres: FloatArray, normals: FloatArray, areas: FloatArray, precision: float
) -> tuple[SurfaceKind, dict[str, Any]]:
    """Name the surface that a run of facets was cut from.

    Args:
        corners: ``(N, 3)``, distinct corners of the facets, all on the true surface where there is one [m].
        centres: ``(F, 3)``, centroid of each facet [m].
        normals: ``(F, 3)``, outward unit normals of the facets.
        areas: ``(F,)`` [m^2].
        precision: how far file coordinates may be off [m].

    Returns:
        The kind and the fields of :class:`Face` that describe it; ``freeform`` and nothing where no simple
        surface passes through all corners.
    """
    for fit in (_cylinder, _cone, _sphere):
        found = fit(corners, centres, normals, areas, precision)
        if found is not None:
            return found
    return "freeform", {}


def _cylinder(
    corners: FloatArray, centres: FloatArray, normals: FloatArray, areas: FloatArray, precision: float
) -> tuple[SurfaceKind, dict[str, Any]] | None:
    values, vectors = np.linalg.eigh((normals * areas[:, None]).T @ normals / areas.sum())
    axis = vectors[:, 0]
    if np.abs(normals @ axis).max() > NORMAL_TOLERANCE or values[1] < 1e-4:
        return None
    circle = _circle(corners, axis)
    if circle is None:
        return None
    centre, radius = circle
    if not _passes(_across(corners - centre, axis) - radius, _across(centres - centre, axis) - radius, precision):
        return None
    outward = _outward(centres - centre, normals, axis)
    middle = centre + axis * ((centres - centre) @ axis).mean()
    direction = axis * np.sign(axis[np.argmax(np.abs(axis))])
    return "cylinder", {
        "axis_point": middle,
        "axis_direction": direction,
        "radius": radius,
        "convex": outward,
    }


def _cone(
    corners: FloatArray, centres: FloatArray, normals: FloatArray, areas: FloatArray, precision: float
) -> tuple[SurfaceKind, dict[str, Any]] | None:
    mean = (normals * areas[:, None]).sum(axis=0) / areas.sum()
    spread = normals - mean
    values, vectors = np.linalg.eigh((spread * areas[:, None]).T @ spread / areas.sum())
    axis = vectors[:, 0]
    slopes = normals @ axis
    if np.abs(slopes - slopes.mean()).max() > NORMAL_TOLERANCE or values[1] < 1e-4:
        return None
    # Every facet's plane passes through the apex.
    apex, *_ = np.linalg.lstsq(normals, np.einsum("ni,ni->n", normals, centres), rcond=1e-9)
    if ((corners - apex) @ axis).mean() < 0.0:
        axis = -axis
    along, across = (corners - apex) @ axis, _across(corners - apex, axis)
    cone = _Cone(apex, axis, float(np.arctan2(across.sum(), along.sum())))
    if along.min() < -precision:
        return None
    if not _passes(cone.off(corners), cone.off(centres), precision):
        cone = _through(corners, cone, float(np.abs(cone.off(centres)).max()) + precision)
        if not _passes(cone.off(corners), cone.off(centres), precision):
            return None
    return "cone", {
        "axis_point": cone.apex,
        "axis_direction": cone.axis,
        "half_angle": cone.half_angle,
        "convex": _outward(centres - cone.apex, normals, cone.axis),
    }


@dataclass(frozen=True, slots=True, eq=False)
class _Cone:
    apex: FloatArray
    axis: FloatArray
    half_angle: float

    def off(self, points: FloatArray) -> FloatArray:
        """Distances of points ``(N, 3)``, positive away from the axis."""
        reach = _across(points - self.apex, self.axis) * np.cos(self.half_angle)
        return np.asarray(reach - (points - self.apex) @ self.axis * np.sin(self.half_angle))


def _through(corners: FloatArray, cone: _Cone, near: float) -> _Cone:
    """The cone through the corners, if that one is near: facets between rings of unlike corners are turned."""
    if np.abs(cone.off(corners)).max() > near:
        return cone
    some = corners[np.linspace(0, len(corners) - 1, min(len(corners), _ENOUGH)).astype(int)]
    covs, none = np.tile((1e-3 * near) ** 2 * np.eye(3), (1, len(some), 1, 1)), np.zeros(0)
    free = np.zeros((len(some), 3, 0))
    T, half_angle, *_ = _core.fit_rounds(
        2, 2, np.arange(5), np.ascontiguousarray(some[None]), covs, none, none, none, 0, free, 0.0, 0.0, none, none,
        none, 0.0,
    )  # fmt: skip
    return _Cone(T[0, :3, 3], T[0, :3, 2], float(half_angle[0]))


def _sphere(
    corners: FloatArray, centres: FloatArray, normals: FloatArray, areas: FloatArray, precision: float
) -> tuple[SurfaceKind, dict[str, Any]] | None:
    if len(corners) < 8:
        return None
    origin = corners.mean(axis=0)
    local = corners - origin
    system = np.column_stack([2.0 * local, np.ones(len(local))])
    solution, _, rank, _ = np.linalg.lstsq(system, (local**2).sum(axis=1), rcond=1e-9)
    if rank < 4:
        return None
    centre = origin + solution[:3]
    radius = float(np.sqrt(max(solution[3] + solution[:3] @ solution[:3], 0.0)))
    spread = normals - (normals * areas[:, None]).sum(axis=0) / areas.sum()
    if np.linalg.eigvalsh(spread.T @ spread / len(spread))[0] < 1e-4:
        return None  # Strips side by side: two rings of corners lie on a sphere, their surface does not.
    radial = centres - centre
    reach = np.linalg.norm(radial, axis=1)
    cosines = np.einsum("ni,ni->n", radial, normals) / reach
    fits = _passes(np.linalg.norm(corners - centre, axis=1) - radius, reach - radius, precision)
    if not fits or np.abs(cosines).min() < 0.9:
        return None
    return "sphere", {"axis_point": centre, "radius": radius, "convex": bool(cosines.mean() > 0.0)}


def _circle(corners: FloatArray, axis: FloatArray) -> tuple[FloatArray, float] | None:
    """Fit a circle to the corners seen along the axis; None where they are collinear."""
    _, _, frame = np.linalg.svd(axis[None, :])
    plane = frame[1:]
    origin = corners.mean(axis=0)
    flat = (corners - origin) @ plane.T
    solution, _, rank, _ = np.linalg.lstsq(
        np.column_stack([2.0 * flat, np.ones(len(flat))]), (flat**2).sum(axis=1), rcond=1e-9
    )
    if rank < 3:
        return None
    radius = float(np.sqrt(max(solution[2] + solution[:2] @ solution[:2], 0.0)))
    return origin + solution[:2] @ plane, radius


def _across(radial: FloatArray, axis: FloatArray) -> FloatArray:
    """Distances from an axis through the origin."""
    return np.asarray(np.linalg.norm(radial - (radial @ axis)[:, None] * axis, axis=1))


def _passes(corners_off: FloatArray, centres_off: FloatArray, precision: float) -> bool:
    """Whether corners lie on the surface, judged by how far the centres of the facets, chords of it, lie off."""
    sagitta = float(np.abs(centres_off).max())
    return bool(np.abs(corners_off).max() <= CORNER_TOLERANCE * sagitta + precision)


def _outward(radial: FloatArray, normals: FloatArray, axis: FloatArray) -> bool:
    """Whether the normals point away from the axis: a boss and not a bore."""
    across = radial - (radial @ axis)[:, None] * axis
    return bool(np.einsum("ni,ni->n", across, normals).sum() > 0.0)
