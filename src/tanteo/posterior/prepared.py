"""A part with everything that the likelihood needs, computed on first use."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tanteo import _core
from tanteo.catalogue import SAMPLES, SHAPE, cache, compiled_shape
from tanteo.catalogue.copies import Resolution, copy_of
from tanteo.catalogue.signatures import faces_of
from tanteo.geometry import SE3
from tanteo.geometry.typing import IntArray, Transforms, Vectors
from tanteo.parts import Part, Surface, as_parts
from tanteo.parts.shapes import DistanceField, distance_field
from tanteo.sensors import PointMeasurements
from tanteo.values import Value


@dataclass(frozen=True, eq=False, repr=False)
class PreparedPart(Value):
    """A part with everything that the likelihood needs; each property is computed or opened on first use.

    Attributes:
        part: the part.
    """

    part: Part

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what copies and other processes need: the part, from which everything else is computed again."""
        return prepare, (self.part,)

    @cached_property
    def shape(self) -> _core.Shape:
        """Return the compiled shape, from the cache if it has one."""
        stored = cache.load_derived(self.part, SHAPE)
        if stored is not None:
            try:
                return _core.open_shape(stored)
            except ValueError:  # damaged, or of another version
                pass
        shape = compiled_shape(self.part)
        if cache.keeps(self.part):
            cache.store_derived(self.part, SHAPE, shape.bytes())
        return shape

    def compiled(self) -> _core.Shape:
        """Return the compiled shape."""
        return self.shape

    def at(self, resolution: Resolution) -> PreparedPart:
        """Return the coarsest copy of the part that the noise of readings allows, prepared; itself unless it is large.

        Args:
            resolution: noise of the readings.
        """
        copy = copy_of(self.part, resolution)
        return self if copy is self.part else prepare(copy)

    @cached_property
    def samples(self) -> Vectors:
        """Return uniform samples of the surface ``(K, 3)``, in the part frame [m]."""
        return self.shape.samples

    @cached_property
    def normals(self) -> Vectors:
        """Return the outward normals at the samples ``(K, 3)``."""
        return self.shape.normals

    @cached_property
    def sample_faces(self) -> IntArray:
        """Return the index of the face at each sample ``(K,)``."""
        return self.part.triangle_face[self.surface.closest(self.samples).triangles]

    @cached_property
    def surface(self) -> Surface:
        """Return the surface for distances and rays in batches."""
        return Surface(self.part.vertices, self.part.triangles)

    def faces_of_readings(self, measured: PointMeasurements, count: int, T_world_part: Transforms) -> tuple[int, ...]:
        """Return the index of the face nearest to each reading, -1 for readings without a point.

        Args:
            measured: the readings as points in the world frame.
            count: number of all readings, those without a point included.
            T_world_part: pose of the part ``(4, 4)``.
        """
        faces, points = np.full(count, -1), SE3.apply(SE3.inverse(T_world_part), measured.points)
        faces[measured.rows] = self.part.triangle_face[self.surface.closest(points).triangles]
        return tuple(map(int, faces))

    @cached_property
    def field(self) -> DistanceField:
        """Return a field of approximate signed distances, for very many points."""
        return distance_field(self.surface)

    @cached_property
    def faces(self) -> dict[str, np.ndarray]:
        """Return the faces with which sensed planes are compared, as in the tables of a catalogue."""
        return faces_of(self.part)

    def close(self) -> None:
        """Release the compiled shape of a catalogue part to save memory; it is opened again on its next use."""
        if "stored" in self.part.derived:
            self.__dict__.pop("shape", None)

    @property
    def centre(self) -> Vectors:
        """Return the point about which small motions turn the part: its centroid ``(3,)`` [m]."""
        return self.part.centroid

    @property
    def spacing(self) -> float:
        """Return the typical distance between samples [m]."""
        return float(np.sqrt(self.part.area / SAMPLES))


def prepare(part: Part | PreparedPart) -> PreparedPart:
    """Return the prepared part, which is made once and stored with the part."""
    if isinstance(part, PreparedPart):
        return part
    part = getattr(part, "part", part)
    if "prepared" not in part.derived:
        part.derived["prepared"] = PreparedPart(part)
    prepared: PreparedPart = part.derived["prepared"]
    return prepared


def prepare_all(name: str, parts: Any) -> tuple[PreparedPart, ...]:
    """Return one part or several, prepared.

    Args:
        name: name of the argument, for the error message.
        parts: one part, a sequence of parts, or a catalogue.

    Raises:
        InputError: ``parts`` are paths or objects of another type.
    """
    return tuple(part if isinstance(part, PreparedPart) else prepare(part) for part in as_parts(name, parts))
