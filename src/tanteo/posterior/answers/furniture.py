"""Known surfaces near the part that a sensor may hit instead of it: a table, a vise, a fixture."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3, check_transforms
from tanteo.geometry.limits import LEAST_SD, check_length
from tanteo.geometry.typing import Covariances, FloatArray, IntArray, Transforms, Vectors
from tanteo.parts import Part, Surface
from tanteo.posterior.answers.pose_prior import Table

_ASPREAD = 4.0
"""Half side of a table over the radius of the workspace."""


@dataclass(frozen=True, slots=True, eq=False)
class Furniture:
    """Known surface in the world. It explains readings that end on it; their paths show where the part is not.

    Attributes:
        name: name in answers.
        vertices: vertices of its triangles in the world ``(V, 3)`` [m].
        triangles: rows of the vertices of each triangle ``(T, 3)``.
        sd: standard deviation of its surface along the normal [m].
        surface: the same surface, prepared for distance queries.

    Raises:
        InputError: ``sd`` is not a length, or the triangles are not a mesh.

    Example:
        >>> import numpy as np
        >>> T = np.eye(4)
        >>> T[:3, 3] = 0.2, 0.0, -0.05
        >>> vise = tanteo.Furniture.of_part(tanteo.read_part("parts/block.step"), T, sd=0.5e-3, name="vise")
        >>> priors = tanteo.Priors(furniture=(vise,))
    """

    name: str
    vertices: Vectors
    triangles: IntArray
    sd: float
    surface: Surface = field(init=False, repr=False)

    def __post_init__(self) -> None:
        check_length("furniture, sd", self.sd, LEAST_SD)
        object.__setattr__(self, "surface", Surface(np.asarray(self.vertices), np.asarray(self.triangles)))

    @classmethod
    def of_part(cls, shape: Part, T_world_shape: Transforms, sd: float, name: str = "") -> Furniture:
        """Return furniture with the shape of a CAD part at a fixed pose.

        Args:
            shape: part from a CAD file.
            T_world_shape: pose of this part in the world ``(4, 4)``.
            sd: standard deviation of its surface along the normal [m].
            name: name in answers; by default the name of the part.

        Raises:
            InputError: ``T_world_shape`` is not one rigid motion.
        """
        T = check_transforms("furniture, T_world_shape", np.asarray(T_world_shape))
        if T.shape != (4, 4):
            raise InputError(f"furniture, T_world_shape: expected one pose (4, 4), got {T.shape}.")
        return cls(name or shape.name, SE3.apply(T, shape.vertices), shape.triangles, sd)

    @classmethod
    def of_table(cls, table: Table, middle: Vectors, radius: float) -> Furniture:
        """Return a square of a table plane that covers the workspace.

        Args:
            table: the table.
            middle: middle of the workspace ``(3,)`` [m].
            radius: radius of the workspace [m].
        """
        n = table.normal
        foot = middle - n * float((middle - table.point) @ n)
        u = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
        u /= np.linalg.norm(u)
        v, reach = np.cross(n, u), _ASPREAD * radius
        corners = np.array([foot + reach * (a * u + b * v) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
        return cls("table", corners, np.array([[0, 1, 2], [0, 2, 3]]), table.sd)

    def log_density(self, points: Vectors, covs: Covariances, radii: FloatArray, directions: Vectors) -> FloatArray:
        """Return the log density of each reading if it ends on this surface ``(n,)``.

        The unit is 1/m along a known direction, and 1/m^3 for a point without a direction.

        Args:
            points: surface points, or centres of a ball ``(n, 3)`` [m].
            covs: covariance of each point ``(n, 3, 3)`` [m^2].
            radii: radius of the tip's ball ``(n,)`` [m].
            directions: directions into the material ``(n, 3)``; zero where unknown.
        """
        found = self.surface.closest(points)
        away = points - found.points
        size = np.linalg.norm(away, axis=1, keepdims=True)
        flat = self.surface.normals[found.triangles]
        n = np.where(size > 1e-12, away / np.maximum(size, 1e-300), flat)
        variance = np.einsum("ni,nij,nj->n", n, covs, n) + self.sd**2
        log = -0.5 * (size[:, 0] - radii) ** 2 / variance - 0.5 * np.log(2 * np.pi * variance)
        directed = np.any(directions != 0, axis=1)
        cosine = np.abs(np.sum(directions * flat, axis=1))
        corners = self.surface.vertices[self.surface.triangles]
        area = (
            0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
        )
        with np.errstate(divide="ignore"):
            return np.asarray(log + np.where(directed, np.log(cosine), -np.log(area)))
