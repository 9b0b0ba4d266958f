"""A part as the likelihood sees it: its compiled shape, and what its symmetry makes one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tanteo import _core
from tanteo.catalogue import SAMPLES, SHAPE, cache, compiled_shape, faces_of
from tanteo.geometry.typing import IntArray, Vectors
from tanteo.parts import DistanceField, Part, Surface, as_parts, distance_field


@dataclass(frozen=True, eq=False)
class PreparedPart:
    """What inference asks of a part; nothing is made, or opened, before it is asked for.

    Attributes:
        part: the part.
    """

    part: Part

    @cached_property
    def shape(self) -> _core.Shape:
        """The compiled shape; one that was made before is opened where it lies in the cache."""
        stored = cache.load_derived(self.part, SHAPE)
        if stored is not None:
            try:
                return _core.open_shape(stored)
            except ValueError:  # damaged, or of another version
                pass
        shape = compiled_shape(self.part)
        cache.store_derived(self.part, SHAPE, shape.bytes())
        return shape

    @cached_property
    def samples(self) -> Vectors:
        """Places even over the surface ``(K, 3)``, in the part frame [m]."""
        return self.shape.samples

    @cached_property
    def normals(self) -> Vectors:
        """Of the surface there, outward ``(K, 3)``."""
        return self.shape.normals

    @cached_property
    def sample_faces(self) -> IntArray:
        """Index of the face there ``(K,)``."""
        return self.part.triangle_face[self.surface.closest(self.samples).triangles]

    @cached_property
    def surface(self) -> Surface:
        """For distances and rays in batches."""
        return Surface(self.part.vertices, self.part.triangles)

    @cached_property
    def field(self) -> DistanceField:
        """For rough signed distances of very many points."""
        return distance_field(self.surface)

    @cached_property
    def faces(self) -> dict[str, np.ndarray]:
        """What sensed planes are compared with, as the tables of a catalogue have it."""
        return faces_of(self.part)

    def close(self) -> None:
        """Let go of what can be opened again in a moment: of very many parts not all can be open."""
        if "stored" in self.part.derived:
            self.__dict__.pop("shape", None)

    @property
    def centre(self) -> Vectors:
        """About which small motions turn the part: its centroid ``(3,)`` [m]."""
        return self.part.centroid

    @property
    def spacing(self) -> float:
        """Typical distance between samples [m]."""
        return float(np.sqrt(self.part.area / SAMPLES))


def prepare(part: Part | PreparedPart) -> PreparedPart:
    """Prepare a part; what is prepared is kept with the part."""
    if isinstance(part, PreparedPart):
        return part
    part = getattr(part, "part", part)
    if "prepared" not in part.derived:
        part.derived["prepared"] = PreparedPart(part)
    prepared: PreparedPart = part.derived["prepared"]
    return prepared


def prepare_all(name: str, parts: Any) -> tuple[PreparedPart, ...]:
    """Parts, or one, prepared.

    Raises:
        InputError: paths, or something else in the place of parts.
    """
    return tuple(part if isinstance(part, PreparedPart) else prepare(part) for part in as_parts(name, parts))
