"""Is a patch of a mesh a cylinder, a cone or a sphere? Fits to the corners and normals of its facets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tanteo import _core
from tanteo.parts.elements import SurfaceKind
from tanteo.typing import BoolArray, FloatArray

NORMAL_TOLERANCE = 0.02
"""How far facet normals may lie off the ruling condition of a cylinder or cone [rad]."""

CORNER_TOLERANCE = 0.1
"""How far corners may lie off the fitted surface, relative to how far the facets' centres lie off it (the sagitta)."""


_ENOUGH = 200
"""Corners that tell a cone."""

_LEAST = 6
"""Corners that a surface is fitted to at least: three generators of a cylinder."""


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """Corners of a run of facets.

    Attributes:
        all: ``(N, 3)``, distinct [m].
        on: which of them are on the true surface, if there is one ``(N,)``; the others are within facets, its chords.
    """

    all: FloatArray
    on: BoolArray

    def pass_through(self, off: FloatArray, centres_off: FloatArray, precision: float) -> bool:
        """Whether they are where they should be, judged by how far the facets' centres lie off the surface ``(F,)``."""
        sagitta = float(np.abs(centres_off).max())
        slack = CORNER_TOLERANCE * sagitta + precision
        low, high = min(float(centres_off.min()), 0.0) - slack, max(float(centres_off.max()), 0.0) + slack
        others = off[~self.on]
        return bool(np.abs(off[self.on]).max() <= slack and np.all((others >= low) & (others <= high)))


def fit_curved(
    corners: FloatArray,
    between: BoolArray,
    centres: FloatArray,
    normals: FloatArray,
    areas: FloatArray,
    precision: float,
) -> tuple[SurfaceKind, dict[str, Any]]:
    """Name the surface that a run of facets was cut from.

    Where the facets themselves were cut by others, as solids of facets are when they are combined, some corners lie on
    chords of the surface. Only those between two facets are sure to be on it.

    Args:
        corners: ``(N, 3)``, distinct corners of the facets [m].
        between: which of them two facets of the run share ``(N,)``.
        centres: ``(F, 3)``, centroid of each facet [m].
        normals: ``(F, 3)``, outward unit normals of the facets.
        areas: ``(F,)`` [m^2].
        precision: how far file coordinates may be off [m].

    Returns:
        The kind and the fields of :class:`Face` that describe it; ``freeform`` and nothing where no simple
        surface passes through all corners.
    """
    for on in (np.ones(len(corners), dtype=bool), between):
        if np.count_nonzero(on) < _LEAST:
            break
        for fit in (_cylinder, _cone, _sphere):
            found = fit(Corners(corners, on), centres, normals, areas, precision)
            if found is not None:
                return found
    return "freeform", {}


def _cylinder(
    corners: Corners, centres: FloatArray, normals: FloatArray, areas: FloatArray, precision: float
) -> tuple[SurfaceKind, dict[str, Any]] | None:
    values, vectors = np.linalg.eigh((normals * areas[:, None]).T @ normals / areas.sum())
    axis = vectors[:, 0]
    if np.abs(normals @ axis).max() > NORMAL_TOLERANCE or values[1] < 1e-4:
        return None
    circle = _circle(corners.all[corners.on], axis)
    if circle is None:
        return None
    centre, radius = circle
    off, centres_off = _across(corners.all - centre, axis) - radius, _across(centres - centre, axis) - radius
    if not corners.pass_through(off, centres_off, precision):
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
    corners: Corners, centres: FloatArray, normals: FloatArray, areas: FloatArray, precision: float
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
    true = corners.all[corners.on]
    if ((true - apex) @ axis).mean() < 0.0:
        axis = -axis
    along, across = (true - apex) @ axis, _across(true - apex, axis)
    cone = _Cone(apex, axis, float(np.arctan2(across.sum(), along.sum())))
    if along.min() < -precision:
        return None
    if not corners.pass_through(cone.off(corners.all), cone.off(centres), precision):
        cone = _through(true, cone, float(np.abs(cone.off(centres)).max()) + precision)
        if not corners.pass_through(cone.off(corners.all), cone.off(centres), precision):
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
    corners: Corners, centres: FloatArray, normals: FloatArray, areas: FloatArray, precision: float
) -> tuple[SurfaceKind, dict[str, Any]] | None:
    true = corners.all[corners.on]
    if len(true) < 8:
        return None
    origin = true.mean(axis=0)
    local = true - origin
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
    fits = corners.pass_through(np.linalg.norm(corners.all - centre, axis=1) - radius, reach - radius, precision)
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


def _outward(radial: FloatArray, normals: FloatArray, axis: FloatArray) -> bool:
    """Whether the normals point away from the axis: a boss and not a bore."""
    across = radial - (radial @ axis)[:, None] * axis
    return bool(np.einsum("ni,ni->n", across, normals).sum() > 0.0)
