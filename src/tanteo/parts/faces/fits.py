"""Fit a cylinder, a cone or a sphere to the corners and normals of a run of facets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tanteo import _core
from tanteo.geometry.typing import BoolArray, FloatArray
from tanteo.parts.faces.elements import SurfaceKind

NORMAL_TOLERANCE = 0.02
"""Largest deviation of facet normals from the ruling condition of a cylinder or cone [rad]."""

CORNER_TOLERANCE = 0.1
"""Largest distance of corners from the fitted surface, relative to that of the facets' centres (the sagitta)."""


_ENOUGH = 200
"""Largest number of corners used to fit a cone."""

_MANY, _SOME, _LOOSER = 50_000, 5_000, 10.0
"""Number of facets above which a subset of about 5,000 is fitted first, to ten times the precision.

It rejects free forms of very many facets in milliseconds."""

_LEAST = 6
"""Smallest number of corners for a fit: three generators of a cylinder."""


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """Corners of a run of facets.

    Attributes:
        all: distinct corners ``(N, 3)`` [m].
        on: mask of corners that lie on the true surface, if there is one ``(N,)``; the others lie on its chords.
    """

    all: FloatArray
    on: BoolArray

    def pass_through(self, off: FloatArray, centres_off: FloatArray, precision: float) -> bool:
        """Return whether the corners agree with a surface, given the distances of the facets' centres from it.

        Args:
            off: signed distances of the corners from the surface ``(N,)`` [m].
            centres_off: signed distances of the facets' centres ``(F,)`` [m].
            precision: error of the file's coordinates [m].
        """
        sagitta = float(np.abs(centres_off).max())
        slack = CORNER_TOLERANCE * sagitta + precision
        low = min(float(centres_off.min()), 0.0) - slack
        high = max(float(centres_off.max()), 0.0) + slack
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
    """Return the surface from which a run of facets was made.

    If the facets themselves were cut by others, as in Boolean operations on faceted solids, some corners lie on chords
    of the surface. Only corners between two facets are certain to lie on it.

    Args:
        corners: distinct corners of the facets ``(N, 3)`` [m].
        between: mask of corners that two facets of the run share ``(N,)``.
        centres: centroid of each facet ``(F, 3)`` [m].
        normals: outward unit normals of the facets ``(F, 3)``.
        areas: areas of the facets ``(F,)`` [m^2].
        precision: error of the file's coordinates [m].

    Returns:
        Kind and fields of :class:`Face` that describe it; ``freeform`` without fields if no simple surface passes
        through all corners.
    """
    if len(centres) > _MANY:  # a surface that does not fit a sample of the facets does not fit all facets
        some, few = (np.arange(0, n, 1 + n // _SOME) for n in (len(corners), len(centres)))
        kind, _ = fit_curved(corners[some], between[some], centres[few], normals[few], areas[few], _LOOSER * precision)
        if kind == "freeform":
            return "freeform", {}
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
    off = _across(corners.all - centre, axis) - radius
    centres_off = _across(centres - centre, axis) - radius
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
    # the planes of all facets pass through the apex
    apex, *_ = np.linalg.lstsq(normals, np.einsum("ni,ni->n", normals, centres), rcond=1e-9)
    true = corners.all[corners.on]
    if ((true - apex) @ axis).mean() < 0.0:
        axis = -axis
    along = (true - apex) @ axis
    across = _across(true - apex, axis)
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
        """Return signed distances of points from the cone, positive away from the axis ``(N,)``."""
        reach = _across(points - self.apex, self.axis) * np.cos(self.half_angle)
        return np.asarray(reach - (points - self.apex) @ self.axis * np.sin(self.half_angle))


def _through(corners: FloatArray, cone: _Cone, near: float) -> _Cone:
    """Return the cone through the corners if it is near, because facets between rings of unlike corners are tilted."""
    if np.abs(cone.off(corners)).max() > near:
        return cone
    some = corners[np.linspace(0, len(corners) - 1, min(len(corners), _ENOUGH)).astype(int)]
    covs = np.tile((1e-3 * near) ** 2 * np.eye(3), (1, len(some), 1, 1))
    none = np.zeros(0)
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
        return None  # two rings of corners lie on a sphere although the strip between them does not
    radial = centres - centre
    reach = np.linalg.norm(radial, axis=1)
    cosines = np.einsum("ni,ni->n", radial, normals) / reach
    fits = corners.pass_through(np.linalg.norm(corners.all - centre, axis=1) - radius, reach - radius, precision)
    if not fits or np.abs(cosines).min() < 0.9:
        return None
    return "sphere", {"axis_point": centre, "radius": radius, "convex": bool(cosines.mean() > 0.0)}


def _circle(corners: FloatArray, axis: FloatArray) -> tuple[FloatArray, float] | None:
    """Fit a circle to the corners projected along the axis; None if they are collinear."""
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
    """Return distances from an axis through the origin."""
    return np.asarray(np.linalg.norm(radial - (radial @ axis)[:, None] * axis, axis=1))


def _outward(radial: FloatArray, normals: FloatArray, axis: FloatArray) -> bool:
    """Return whether the normals point away from the axis, as those of a boss do."""
    across = radial - (radial @ axis)[:, None] * axis
    return bool(np.einsum("ni,ni->n", across, normals).sum() > 0.0)
