"""Solids of the cell as triangle meshes in the world frame, and the distance of a hand from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from tanteo.errors import InputError
from tanteo.geometry import SE3, frozen_array
from tanteo.geometry.typing import FloatArray, IntArray, Transforms
from tanteo.hand.robot import Body
from tanteo.parts import Surface


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """Closed triangle mesh in the world frame.

    Attributes:
        name: unique name of the solid in its scene.
        vertices: corner points ``(V, 3)``, world frame [m].
        triangles: vertex indices ``(T, 3)``, counter-clockwise seen from outside.
    """

    name: str
    vertices: FloatArray
    triangles: IntArray

    @classmethod
    def at(cls, name: str, vertices: npt.ArrayLike, triangles: IntArray, T_world_solid: Transforms) -> Solid:
        """Create a solid from a mesh in its own frame and its pose in the world.

        Args:
            name: unique name of the solid in its scene.
            vertices: corner points ``(V, 3)`` in the frame of the solid [m].
            triangles: vertex indices ``(T, 3)``, counter-clockwise seen from outside.
            T_world_solid: pose of the solid ``(4, 4)``.
        """
        return cls(name, frozen_array(SE3.apply(T_world_solid, np.asarray(vertices, dtype=np.float64))), triangles)


def box(name: str, low: npt.ArrayLike, high: npt.ArrayLike, T_world_box: Transforms | None = None) -> Solid:
    """Return a box as a solid, for example a table, a clamp or another obstacle.

    Args:
        name: unique name of the solid in its scene.
        low: smallest corner ``(3,)`` in the frame of the box [m].
        high: largest corner ``(3,)`` in the frame of the box [m].
        T_world_box: pose of the box ``(4, 4)``; the world frame by default.

    Raises:
        InputError: A coordinate of ``low`` is not below that of ``high``.
    """
    a, b = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    if a.shape != (3,) or b.shape != (3,) or not (a < b).all():
        raise InputError(f"{name}: expected a low and a high corner, got {a.tolist()} and {b.tolist()}. Swap them.")
    corners = np.array([[x, y, z] for x in (a[0], b[0]) for y in (a[1], b[1]) for z in (a[2], b[2])])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([t for i, j, k, m in quads for t in ((i, j, k), (i, k, m))], dtype=np.int64)
    return Solid.at(name, corners, triangles, np.eye(4) if T_world_box is None else T_world_box)


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Solids of the cell and their joint surface, in the world frame.

    Attributes:
        solids: solids with unique names.
        surface: triangles of all solids, for ray casts and distances.
        owner: index of the solid of every triangle ``(T,)``.

    Raises:
        InputError: There is no solid, or two have the same name.
    """

    solids: tuple[Solid, ...]
    surface: Surface = field(init=False)
    owner: IntArray = field(init=False)

    def __post_init__(self) -> None:
        names = [s.name for s in self.solids]
        if not names or len(set(names)) < len(names):
            raise InputError(f"scene: expected solids with unique names, got {names}. Rename the duplicates.")
        starts = np.cumsum([0, *(len(s.vertices) for s in self.solids)])
        triangles = np.concatenate([s.triangles + k for s, k in zip(self.solids, starts, strict=False)])
        surface = Surface(np.concatenate([s.vertices for s in self.solids]), triangles)
        owner = np.repeat(np.arange(len(names)), [len(s.triangles) for s in self.solids])
        owner.setflags(write=False)
        object.__setattr__(self, "surface", surface)
        object.__setattr__(self, "owner", owner)

    @classmethod
    def of(cls, solids: Sequence[Solid]) -> Scene:
        """Create a scene from a sequence of solids."""
        return cls(tuple(solids))


def clearances(scene: Scene, body: Body, Ts_world_hand: Transforms) -> FloatArray:
    """Return the smallest distance of the hand's body from the solids, zero or negative at contact.

    A sphere whose centre is inside a solid has a clearance below minus its radius. A path that is sampled more finely
    than the smallest radius therefore shows a contact before any sphere is fully inside.

    Args:
        scene: solids of the cell.
        body: spheres of the hand.
        Ts_world_hand: true poses of the hand ``(*batch, 4, 4)``.

    Returns:
        Smallest clearance over all spheres ``(*batch,)`` [m].
    """
    centres = body.placed(np.asarray(Ts_world_hand))
    return np.asarray((scene.surface.closest(centres).distances - body.radii).min(axis=-1))
