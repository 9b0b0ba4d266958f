"""What stands in the cell: solids as triangle meshes in the world, and how near a hand is to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from tanteo.errors import InputError
from tanteo.frames import frozen_array
from tanteo.hand import Body
from tanteo.lie import SE3
from tanteo.shapes import Surface
from tanteo.typing import FloatArray, IntArray, Transforms


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """One closed mesh in the world.

    Attributes:
        name: Its own.
        vertices: ``(V, 3)`` in the world [m].
        triangles: ``(T, 3)``, corners counter-clockwise seen from outside.
    """

    name: str
    vertices: FloatArray
    triangles: IntArray

    @classmethod
    def at(cls, name: str, vertices: npt.ArrayLike, triangles: IntArray, T_world_solid: Transforms) -> Solid:
        """A mesh in its own frame, put at a pose."""
        return cls(name, frozen_array(SE3.apply(T_world_solid, np.asarray(vertices, dtype=np.float64))), triangles)


def box(name: str, low: npt.ArrayLike, high: npt.ArrayLike, T_world_box: Transforms | None = None) -> Solid:
    """A box between two corners of its own frame [m]: a table, a clamp, anything in the way.

    Raises:
        InputError: The corners are not in order.
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
    """Solids and one surface of them all, in the world.

    Attributes:
        solids: What stands there; names are unique.
        surface: All their triangles.
        owner: Number of the solid of every triangle.

    Raises:
        InputError: No solid, or two of one name.
    """

    solids: tuple[Solid, ...]
    surface: Surface = field(init=False)
    owner: IntArray = field(init=False)

    def __post_init__(self) -> None:
        names = [s.name for s in self.solids]
        if not names or len(set(names)) < len(names):
            raise InputError(f"scene: expected solids with names of their own, got {names}. Name each once.")
        starts = np.cumsum([0, *(len(s.vertices) for s in self.solids)])
        triangles = np.concatenate([s.triangles + k for s, k in zip(self.solids, starts, strict=False)])
        surface = Surface(np.concatenate([s.vertices for s in self.solids]), triangles)
        owner = np.repeat(np.arange(len(names)), [len(s.triangles) for s in self.solids])
        owner.setflags(write=False)
        object.__setattr__(self, "surface", surface)
        object.__setattr__(self, "owner", owner)

    @classmethod
    def of(cls, solids: Sequence[Solid]) -> Scene:
        """A scene of these solids."""
        return cls(tuple(solids))


def clearances(scene: Scene, body: Body, Ts_world_hand: Transforms) -> FloatArray:
    """Least distance of the hand's body from every solid of the scene, zero or less at contact.

    A sphere whose centre is in the material has a clearance below minus its radius; a path that is sampled finer
    than the smallest radius cannot get there without a contact before.

    Args:
        scene: What stands there.
        body: The hand's spheres.
        Ts_world_hand: True poses of the hand ``(*batch, 4, 4)``.

    Returns:
        ``(*batch,)`` [m].
    """
    centres = body.placed(np.asarray(Ts_world_hand))
    return np.asarray((scene.surface.closest(centres).distances - body.radii).min(axis=-1))
