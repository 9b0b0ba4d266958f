"""Compute exact distances, normals and curvatures of the cylinders, cones, spheres and tori that a mesh approximates.

A mesh of a curved face deviates from it by up to its sagitta, and its normals by up to half the angle between facets,
which is far more than the uncertainty of a contact reading. So the mesh finds the nearest face, and the exact surface
gives the distance. All four are surfaces of revolution, whose profile is a line or a circle.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.geometry.typing import FloatArray, IntArray, Vectors

_SLACK = 1.5
"""Factor on the angle between facet and surface, above which a gradient belongs to the border of the face."""

_COARSE = 0.2
"""Angle between facet and surface above which facets may be those of a prism, and the mesh is used [rad]."""

_NEARLY_ALL = 0.98
"""Fraction of a face's area that determines the angle between its facets and the surface."""

_SAME = 1e-9
"""One minus the cosine of gradients that count as equal."""


@dataclass(frozen=True, slots=True, eq=False)
class Profiles:
    """Exact surfaces of revolution in the mesh frame.

    Attributes:
        points: points on the axes ``(F, 3)`` [m]: apex of a cone, centre of a sphere or torus.
        axes: unit axes ``(F, 3)``.
        offsets: distances of the profiles from the axes ``(F,)`` [m]: radius of a cylinder, major radius of a torus,
            else 0.
        slopes: angles of straight profiles with the axis, nonzero for cones ``(F,)`` [rad].
        radii: radii of round profiles, of spheres and tubes of tori ``(F,)`` [m]; 0 for straight ones.
        signs: 1 where the material is on the side of the axis or of the tube's centre, -1 for a bore ``(F,)``.
    """

    points: Vectors
    axes: Vectors
    offsets: FloatArray
    slopes: FloatArray
    radii: FloatArray
    signs: FloatArray

    def take(self, index: IntArray) -> Profiles:
        """Return the surfaces at given rows.

        Args:
            index: row numbers.
        """
        return Profiles(*(getattr(self, name)[index] for name in self.__slots__))

    def distance(self, points: Vectors) -> tuple[FloatArray, Vectors]:
        """Return the signed distance ``(F,)`` [m] of one point per surface, and its unit gradient; zero on the axis.

        Args:
            points: points in the mesh frame ``(F, 3)`` [m].
        """
        phi, n, _, _ = self._at(points)
        return phi, n

    def curvatures(self, points: Vectors) -> tuple[FloatArray, Vectors, Vectors]:
        """Return the principal curvatures at points: the derivative of the gradient is ``sum_i b_i e_i e_i'``.

        Args:
            points: points in the mesh frame ``(F, 3)`` [m].

        Returns:
            Both curvatures ``b`` ``(F, 2)`` [1/m], positive where the surface is convex, unit directions ``e``
            ``(F, 2, 3)``, and the gradient ``(F, 3)``.
        """
        _, n, away, tube = self._at(points)
        out = np.sum(n * away[:, :3], axis=-1)
        round_axis = np.cross(self.axes, away[:, :3])
        with np.errstate(divide="ignore", invalid="ignore"):
            b = np.stack([out / away[:, 3], np.where(self.radii > 0, self.signs / tube, 0.0)], axis=-1)
        return np.where(np.isfinite(b), b, 0.0), np.stack([round_axis, np.cross(n, round_axis)], axis=1), n

    def _at(self, points: Vectors) -> tuple[FloatArray, Vectors, FloatArray, FloatArray]:
        """Return distance, gradient, unit radial direction and length ``(F, 4)``, and distance from the tube centre."""
        v = points - self.points
        height = np.sum(v * self.axes, axis=-1)
        across = v - height[:, None] * self.axes
        rho = np.linalg.norm(across, axis=-1)
        out = across / np.maximum(rho, 1e-300)[:, None]
        c = np.cos(self.slopes)
        s = np.sin(self.slopes)
        beyond = rho - self.offsets
        tube = np.hypot(beyond, height)
        straight = self.radii == 0
        safe = np.maximum(tube, 1e-300)
        phi = np.where(straight, beyond * c - height * s, tube - self.radii)
        by_out = np.where(straight, c, beyond / safe)
        by_axis = np.where(straight, -s, height / safe)
        n = by_out[:, None] * out + by_axis[:, None] * self.axes
        return self.signs * phi, self.signs[:, None] * n, np.column_stack([out, rho]), tube


@dataclass(frozen=True, slots=True, eq=False)
class Revolved:
    """Exact surfaces that the triangles of a mesh approximate.

    Attributes:
        profiles: exact surfaces.
        rows: surface of each triangle ``(T,)``; -1 where there is only the mesh.
        min_cosines: smallest cosine between the gradients of mesh and surface at which the surface is used ``(F,)``.
    """

    profiles: Profiles
    rows: IntArray
    min_cosines: FloatArray

    def replace(self, points: Vectors, triangles: IntArray, phi: FloatArray, g: Vectors) -> None:
        """Replace distances and gradients of a mesh by exact ones, in place, where the nearest triangle has a surface.

        Points beyond the border of a face, whose gradient is not perpendicular to the surface, keep the mesh's values.

        Args:
            points: points in the mesh frame ``(*batch, 3)`` [m].
            triangles: nearest triangles ``(*batch,)``.
            phi: signed distances ``(*batch,)`` [m]; updated.
            g: unit gradients ``(*batch, 3)``; updated.
        """
        rows = self.rows[triangles]
        index = np.nonzero(rows >= 0)
        if not len(index[0]):
            return
        rows = rows[index]
        exact, n = self.profiles.take(rows).distance(points[index])
        ok = np.sum(n * g[index], axis=-1) > self.min_cosines[rows]
        index = tuple(axis[ok] for axis in index)
        phi[index] = exact[ok]
        g[index] = n[ok]

    def curvatures(
        self, points: Vectors, triangles: IntArray, g: Vectors
    ) -> tuple[tuple[IntArray, ...], FloatArray, Vectors]:
        """Return :meth:`Profiles.curvatures` of the points whose gradients are those of an exact surface.

        Args:
            points: points in the mesh frame ``(*batch, 3)`` [m].
            triangles: nearest triangles ``(*batch,)``.
            g: unit gradients ``(*batch, 3)``.

        Returns:
            Index into the batch of these ``c`` points, curvatures ``b`` ``(c, 2)`` [1/m] and directions ``e``
            ``(c, 2, 3)``.
        """
        rows = self.rows[triangles]
        index = np.nonzero(rows >= 0)
        b, e, n = self.profiles.take(rows[index]).curvatures(points[index])
        ok = np.sum(n * g[index], axis=-1) > 1 - _SAME
        return tuple(axis[ok] for axis in index), b[ok], e[ok]


def revolved(
    profiles: Profiles, rows: IntArray, corners: FloatArray, normals: Vectors, precision: FloatArray
) -> Revolved | None:
    """Return the surfaces that agree with their mesh; None if there is none.

    Args:
        profiles: surfaces with sign 1; the signs are determined here.
        rows: surface of each triangle, -1 for none ``(T,)``.
        corners: vertices of the triangles ``(T, 3, 3)`` [m].
        normals: unit normals of the triangles ``(T, 3)``.
        precision: largest accepted distance of vertices from their surface ``(F,)`` [m].
    """
    own = np.flatnonzero(rows >= 0)
    row = rows[own]
    count = len(profiles.signs)
    phi, n = profiles.take(np.repeat(row, 3)).distance(corners[own].reshape(-1, 3))
    off = np.abs(phi).reshape(-1, 3).max(axis=1, initial=0.0)
    n = n.reshape(-1, 3, 3)
    cosines = np.sum(n * normals[own, None], axis=-1)
    areas = np.linalg.norm(np.cross(corners[own, 1] - corners[own, 0], corners[own, 2] - corners[own, 0]), axis=1)
    inside = np.bincount(row, areas * cosines.sum(axis=1), minlength=count) < 0
    signs = np.where(inside, -1.0, 1.0)
    worst = np.zeros(count)
    np.maximum.at(worst, row, off)
    cosines = np.where(np.sum(n * n, axis=-1) > 1 - 1e-6, cosines * signs[row, None], 1.0)  # but at the apex of a cone
    turns = _mostly(np.arccos(np.clip(cosines.min(axis=1, initial=1.0), -1.0, 1.0)), areas, row, count)
    good = (worst <= precision) & (turns < _COARSE)
    kept = np.where((rows >= 0) & good[rows], rows, -1)
    min_cosines = np.cos(np.minimum(_SLACK * turns + 1e-3, np.pi / 3))
    return Revolved(replace(profiles, signs=signs), kept, min_cosines) if np.any(kept >= 0) else None


def _mostly(values: FloatArray, areas: FloatArray, row: IntArray, count: int) -> FloatArray:
    """Return an area-weighted quantile for each face ``(F,)``, which ignores the unreliable normals of slivers."""
    out = np.zeros(count)
    order = np.lexsort((values, row))
    for mine in np.split(order, np.flatnonzero(np.diff(row[order])) + 1):
        share = np.cumsum(areas[mine])
        out[row[mine[0]]] = values[mine[np.searchsorted(share, _NEARLY_ALL * share[-1])]]
    return out
