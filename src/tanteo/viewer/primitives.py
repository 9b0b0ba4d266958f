"""What a picture is made of: meshes, lines, dots, arrows and labels with a name. World frame, metres."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tanteo.typing import FloatArray, IntArray, Transforms, Vectors

Colour = tuple[int, int, int]
"""Red, green, blue, 0 to 255."""


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """A surface.

    Attributes:
        name: of the primitive, unique in a picture.
        vertices: ``(V, 3)`` in its own frame [m].
        triangles: ``(T, 3)``.
        colour: of it.
        opacity: 0 to 1.
        T: of its frame in the world ``(4, 4)``.
        layer: by which it can be hidden; empty for always shown.
    """

    name: str
    vertices: FloatArray
    triangles: IntArray
    colour: Colour
    opacity: float = 1.0
    T: Transforms = field(default_factory=lambda: np.eye(4))
    layer: str = ""

    def same_shape(self, other: Primitive) -> bool:
        """Whether the other is the same but for where it stands and how clear it is."""
        return (
            isinstance(other, Mesh)
            and self.vertices is other.vertices
            and self.triangles is other.triangles
            and self.colour == other.colour
        )


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """Straight lines.

    Attributes:
        name: of the primitive.
        segments: ``(n, 2, 3)`` in its own frame [m].
        colour: of them.
        width: in pixels.
        T: of its frame in the world ``(4, 4)``.
        layer: by which they can be hidden.
    """

    name: str
    segments: FloatArray
    colour: Colour
    width: float = 1.5
    T: Transforms = field(default_factory=lambda: np.eye(4))
    layer: str = ""

    def same_shape(self, other: Primitive) -> bool:
        """Whether the other is the same but for where it stands."""
        return isinstance(other, Lines) and self.segments is other.segments and self.colour == other.colour


@dataclass(frozen=True, slots=True, eq=False)
class Dots:
    """Points, all alike.

    Attributes:
        name: of the primitive.
        points: ``(n, 3)`` [m].
        colour: of them.
        size: of each [m].
        shape: ``circle`` or ``diamond``.
        layer: by which they can be hidden.
    """

    name: str
    points: Vectors
    colour: Colour
    size: float
    shape: str = "circle"
    layer: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Arrow:
    """An arrow.

    Attributes:
        name: of the primitive.
        start: where it begins ``(3,)`` [m].
        end: where its point is ``(3,)`` [m].
        colour: of it.
        radius: of its shaft [m].
        layer: by which it can be hidden.
    """

    name: str
    start: Vectors
    end: Vectors
    colour: Colour
    radius: float
    layer: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Label:
    """Words at a place.

    Attributes:
        name: of the primitive.
        text: the words.
        place: ``(3,)`` [m].
        layer: by which they can be hidden.
    """

    name: str
    text: str
    place: Vectors
    layer: str = ""


Primitive = Mesh | Lines | Dots | Arrow | Label
