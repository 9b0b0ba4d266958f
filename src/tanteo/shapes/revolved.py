"""Cylinders, cones, spheres and tori behind a mesh: where the surface is, how it is turned, and how it bends.

A mesh of a curved face lies off it by up to its sagitta, and its normals by up to half the turn from facet to facet:
far more than a touch is uncertain. The mesh is good for finding the nearest face; what a reading is compared with is
the surface itself. All four are surfaces of revolution, whose profile is a line or a circle.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.typing import FloatArray, IntArray, Vectors

_SLACK = 1.5
"""Times the turn from a facet to its surface: gradients that are turned farther are of the border of the face."""

_COARSE = 0.2
"""Facets that are turned farther from their surface may be a prism's, and are taken as they are [rad]."""

_NEARLY_ALL = 0.98
"""Share of a face's area whose facets are asked how far they are turned."""

_SAME = 1e-9
"""One less the cosine of gradients that are the same."""


@dataclass(frozen=True, slots=True, eq=False)
class Profiles:
    """Exact surfaces, in the frame of the mesh [m].

    Attributes:
        points: on the axis: of a cone its apex, of a ball or torus its centre ``(F, 3)``.
        axes: unit ``(F, 3)``.
        offsets: distance of the profile from the axis: radius of a cylinder, major radius of a torus, else 0 ``(F,)``.
        slopes: angle of a straight profile with the axis: of a cone ``(F,)`` [rad].
        radii: of a round profile: of a ball or a torus's tube; 0 for a straight one ``(F,)``.
        signs: 1 where the material is on the side of the axis or of the tube's centre, -1 for a bore ``(F,)``.
    """

    points: Vectors
    axes: Vectors
    offsets: FloatArray
    slopes: FloatArray
    radii: FloatArray
    signs: FloatArray

    def take(self, index: IntArray) -> Profiles:
        """One row for each index."""
        return Profiles(*(getattr(self, name)[index] for name in self.__slots__))

    def distance(self, points: Vectors) -> tuple[FloatArray, Vectors]:
        """Signed distance ``(F,)`` [m] of one point each ``(F, 3)``, and its unit gradient; zero on the axis."""
        phi, n, _, _ = self._at(points)
        return phi, n

    def bends(self, points: Vectors) -> tuple[FloatArray, Vectors, Vectors]:
        """How the gradient turns from place to place: its derivative is ``sum_i b_i e_i e_i'``.

        Returns:
            Both ``b`` ``(F, 2)`` [1/m], positive where the surface is convex, unit directions ``e`` ``(F, 2, 3)``, and
            the gradient ``(F, 3)``.
        """
        _, n, away, tube = self._at(points)
        out = np.sum(n * away[:, :3], axis=-1)
        round_axis = np.cross(self.axes, away[:, :3])
        with np.errstate(divide="ignore", invalid="ignore"):
            b = np.stack([out / away[:, 3], np.where(self.radii > 0, self.signs / tube, 0.0)], axis=-1)
        return np.where(np.isfinite(b), b, 0.0), np.stack([round_axis, np.cross(n, round_axis)], axis=1), n

    def _at(self, points: Vectors) -> tuple[FloatArray, Vectors, FloatArray, FloatArray]:
        """Distance, gradient, the unit way from the axis and its length ``(F, 4)``, distance from the tube's centre."""
        v = points - self.points
        height = np.sum(v * self.axes, axis=-1)
        across = v - height[:, None] * self.axes
        rho = np.linalg.norm(across, axis=-1)
        out = across / np.maximum(rho, 1e-300)[:, None]
        c, s, beyond = np.cos(self.slopes), np.sin(self.slopes), rho - self.offsets
        tube = np.hypot(beyond, height)
        straight, safe = self.radii == 0, np.maximum(tube, 1e-300)
        phi = np.where(straight, beyond * c - height * s, tube - self.radii)
        by_out, by_axis = np.where(straight, c, beyond / safe), np.where(straight, -s, height / safe)
        n = by_out[:, None] * out + by_axis[:, None] * self.axes
        return self.signs * phi, self.signs[:, None] * n, np.column_stack([out, rho]), tube


@dataclass(frozen=True, slots=True, eq=False)
class Revolved:
    """The exact surfaces behind the triangles of a mesh.

    Attributes:
        profiles: the surfaces.
        rows: of the surface of each triangle; -1 where there is only the mesh ``(T,)``.
        alike: least cosine of a gradient of the mesh with that of the surface, where one stands for the other ``(F,)``.
    """

    profiles: Profiles
    rows: IntArray
    alike: FloatArray

    def replace(self, points: Vectors, triangles: IntArray, phi: FloatArray, g: Vectors) -> None:
        """Put exact distances and gradients in the place of those from a mesh, where its nearest triangle has them.

        Beyond the border of a face, where the way from the mesh is not across the face, they stay.

        Args:
            points: ``(*batch, 3)`` in the frame of the mesh [m].
            triangles: the nearest to each ``(*batch,)``.
            phi: signed distances ``(*batch,)`` [m]; changed.
            g: unit gradients ``(*batch, 3)``; changed.
        """
        rows = self.rows[triangles]
        index = np.nonzero(rows >= 0)
        if not len(index[0]):
            return
        rows = rows[index]
        exact, n = self.profiles.take(rows).distance(points[index])
        ok = np.sum(n * g[index], axis=-1) > self.alike[rows]
        index = tuple(axis[ok] for axis in index)
        phi[index], g[index] = exact[ok], n[ok]

    def bends(
        self, points: Vectors, triangles: IntArray, g: Vectors
    ) -> tuple[tuple[IntArray, ...], FloatArray, Vectors]:
        """:meth:`Profiles.bends` where gradients are those of an exact surface.

        Args:
            points: ``(*batch, 3)`` in the frame of the mesh [m].
            triangles: of their faces ``(*batch,)``.
            g: gradients there ``(*batch, 3)``.

        Returns:
            Index into the batch of those ``c`` points, ``b`` ``(c, 2)`` and ``e`` ``(c, 2, 3)``.
        """
        rows = self.rows[triangles]
        index = np.nonzero(rows >= 0)
        b, e, n = self.profiles.take(rows[index]).bends(points[index])
        ok = np.sum(n * g[index], axis=-1) > 1 - _SAME
        return tuple(axis[ok] for axis in index), b[ok], e[ok]


def revolved(
    profiles: Profiles, rows: IntArray, corners: FloatArray, normals: Vectors, precision: FloatArray
) -> Revolved | None:
    """Check surfaces against their mesh, and leave out those that it does not show; None if none is left.

    Args:
        profiles: the surfaces, as convex ones; their signs are found here.
        rows: of the surface of each triangle, -1 for none ``(T,)``.
        corners: of the triangles ``(T, 3, 3)`` [m].
        normals: of the triangles ``(T, 3)``.
        precision: how far corners may be off their surface ``(F,)`` [m].
    """
    own = np.flatnonzero(rows >= 0)
    row, count = rows[own], len(profiles.signs)
    phi, n = profiles.take(np.repeat(row, 3)).distance(corners[own].reshape(-1, 3))
    off = np.abs(phi).reshape(-1, 3).max(axis=1, initial=0.0)
    n = n.reshape(-1, 3, 3)
    cosines = np.sum(n * normals[own, None], axis=-1)
    areas = np.linalg.norm(np.cross(corners[own, 1] - corners[own, 0], corners[own, 2] - corners[own, 0]), axis=1)
    inside = np.bincount(row, areas * cosines.sum(axis=1), minlength=count) < 0
    signs, worst = np.where(inside, -1.0, 1.0), np.zeros(count)
    np.maximum.at(worst, row, off)
    cosines = np.where(np.sum(n * n, axis=-1) > 1 - 1e-6, cosines * signs[row, None], 1.0)  # but at the apex of a cone
    turns = _mostly(np.arccos(np.clip(cosines.min(axis=1, initial=1.0), -1.0, 1.0)), areas, row, count)
    good = (worst <= precision) & (turns < _COARSE)
    kept = np.where((rows >= 0) & good[rows], rows, -1)
    alike = np.cos(np.minimum(_SLACK * turns + 1e-3, np.pi / 3))
    return Revolved(replace(profiles, signs=signs), kept, alike) if np.any(kept >= 0) else None


def _mostly(values: FloatArray, areas: FloatArray, row: IntArray, count: int) -> FloatArray:
    """The value that nearly all of the area of each face has at most ``(F,)``: normals of slivers say nothing."""
    out = np.zeros(count)
    order = np.lexsort((values, row))
    for mine in np.split(order, np.flatnonzero(np.diff(row[order])) + 1):
        share = np.cumsum(areas[mine])
        out[row[mine[0]]] = values[mine[np.searchsorted(share, _NEARLY_ALL * share[-1])]]
    return out
