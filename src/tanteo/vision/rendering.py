"""Rendered images of objects on a table, by ray casting: Lambert shading, cast shadows, blur, noise.

One ray is cast for each pixel, and sixteen rays where neighbouring pixels show different faces. The images are scenes
with known truth for :func:`see_table`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms
from tanteo.parts import Part, Surface
from tanteo.vision.camera import Camera, opencv, project, rays

FINE = 4
"""Numerical: rays along the side of a pixel where neighbours differ."""

_PLANE = 1e-5
"""Numerical: tolerance within which the planes of two triangles are one face [1, m]."""


@dataclass(frozen=True, slots=True)
class Appearance:
    """Light, paint and lens of a rendered image.

    Attributes:
        light: direction to the light in the world.
        ambient: share of ambient light.
        table: brightness of the table [grey levels].
        slope: change of the table's brightness across a metre, along x and y [grey levels/m].
        blur: standard deviation of the blur by the lens [px].
        noise: standard deviation of a pixel [grey levels].
    """

    light: tuple[float, float, float] = (0.35, -0.25, 1.0)
    ambient: float = 0.45
    table: float = 200.0
    slope: tuple[float, float] = (60.0, -40.0)
    blur: float = 0.8
    noise: float = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class RenderedObject:
    """A mesh in the world, with its paint.

    Attributes:
        vertices: vertices ``(V, 3)`` [m].
        triangles: indices of the vertices ``(T, 3)``, counter-clockwise from outside.
        labels: number of the face of each triangle ``(T,)``; more rays are cast at borders of faces.
        paint: brightness [grey levels].
    """

    vertices: FloatArray
    triangles: IntArray
    labels: IntArray
    paint: float

    @classmethod
    def of_mesh(cls, vertices: FloatArray, triangles: IntArray, paint: float = 120.0) -> RenderedObject:
        """Return a mesh without faces as an object: the triangles in one plane make a face."""
        a, b, c = np.moveaxis(vertices[triangles], 1, 0)
        n = np.cross(b - a, c - a)
        n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-300)
        planes = np.column_stack([n, np.sum(n * a, axis=1)])
        labels = np.unique(np.round(planes / _PLANE).astype(np.int64), axis=0, return_inverse=True)[1]
        return cls(vertices, triangles, labels.reshape(-1), paint)


def rendered_part(part: Part, T_world_part: Transforms, paint: float = 120.0) -> RenderedObject:
    """Return a part at a pose as an object."""
    return RenderedObject(SE3.apply(T_world_part, part.vertices), part.triangles, part.triangle_face, paint)


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """Objects on the table z = 0, and a camera with its pose.

    Attributes:
        camera: camera with its pose in the world.
        objects: one object or more.
        appearance: light, paint and lens.
        surface: surface of all objects.
        labels: number of the face of every triangle of all objects.
        owner: number of the object of every triangle.
        paints: brightness of every triangle.
    """

    camera: Camera
    objects: list[RenderedObject]
    appearance: Appearance = field(default_factory=Appearance)
    surface: Surface = field(init=False)
    labels: IntArray = field(init=False)
    owner: IntArray = field(init=False)
    paints: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        objects = self.objects
        starts = np.cumsum([0, *[len(t.vertices) for t in objects]])
        first = np.cumsum([0, *[t.labels.max() + 1 for t in objects]])
        values = {
            "surface": Surface(
                np.concatenate([t.vertices for t in objects]),
                np.concatenate([t.triangles + s for t, s in zip(objects, starts, strict=False)]),
            ),
            "labels": np.concatenate([t.labels + s for t, s in zip(objects, first, strict=False)]),
            "owner": np.concatenate([np.full(len(t.triangles), k) for k, t in enumerate(objects)]),
            "paints": np.concatenate([np.full(len(t.triangles), t.paint) for t in objects]),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @property
    def T_world_camera(self) -> Transforms:
        """Pose of the camera."""
        assert self.camera.T_world_camera is not None
        return self.camera.T_world_camera

    def extent(self) -> tuple[int, int, int, int]:
        """Return the first and last columns, and the first and last rows, of the objects and their shadows.

        It is the whole image if something is beside or behind the camera, where a lens has no image.
        """
        light = np.array(self.appearance.light)
        vertices = self.surface.vertices
        shadows = vertices - vertices[:, 2:] / light[2] * light
        local = SE3.apply(SE3.inverse(self.T_world_camera), np.concatenate([vertices, shadows]))
        seen, (width, height) = project(self.camera, local), self.camera.size
        if not np.isfinite(seen).all() or local[:, 2].min() <= 0:
            return 0, width, 0, height
        low, high = np.floor(seen.min(axis=0)) - 4, np.ceil(seen.max(axis=0)) + 5
        (x0, y0), (x1, y1) = np.clip(low, 0, self.camera.size), np.clip(high, 0, self.camera.size)
        return int(x0), int(x1), int(y0), int(y1)

    def bare(self, pixels: FloatArray) -> FloatArray:
        """Return the brightness of the bare table at pixels."""
        T = self.T_world_camera
        way = rays(self.camera, pixels) @ T[:3, :3].T
        where = T[:3, 3] - T[2, 3] / np.minimum(way[..., 2:], -1e-9) * way
        return np.asarray(np.clip(self.appearance.table + where[..., :2] @ np.array(self.appearance.slope), 0, 255))

    def shade(self, pixels: FloatArray) -> tuple[FloatArray, IntArray, IntArray]:
        """Return brightness, label (-1 for the table, -2 for its shadow) and object of pixels ``(n, 2)``."""
        T = self.T_world_camera
        eye, way = T[:3, 3], rays(self.camera, pixels) @ T[:3, :3].T
        way = way / np.linalg.norm(way, axis=-1, keepdims=True)
        hits = self.surface.cast(np.broadcast_to(eye, way.shape), way)
        hit = hits.triangles >= 0
        light = np.array(self.appearance.light) / np.linalg.norm(self.appearance.light)
        table = np.where(way[:, 2] < 0, -eye[2] / np.minimum(way[:, 2], -1e-9), 50.0)
        where = eye + np.where(hit, hits.distances, table)[:, None] * way
        normals = np.where(hit[:, None], self.surface.normals[hits.triangles], [0.0, 0.0, 1.0])
        normals = np.where(np.sum(normals * way, axis=1, keepdims=True) > 0, -normals, normals)
        facing = np.maximum(normals @ light, 0.0)
        lit: BoolArray = facing > 0
        lit[lit] = (
            self.surface.cast(where[lit] + 1e-5 * normals[lit], np.broadcast_to(light, way[lit].shape)).triangles < 0
        )
        paint = np.where(
            hit, self.paints[hits.triangles], self.appearance.table + where[:, :2] @ np.array(self.appearance.slope)
        )
        share = self.appearance.ambient + (1 - self.appearance.ambient) * facing / light[2] * lit
        what = np.where(hit, 2 * self.labels[hits.triangles] + lit, np.where(lit, -1, -2))
        return np.clip(paint * share, 0, 255), what, np.where(hit, self.owner[hits.triangles], -1)


def render(stage: Stage, rng: np.random.Generator) -> tuple[FloatArray, IntArray]:
    """Render an image ``(rows, columns)``, and the number of the object at each pixel (-1 for the table).

    Args:
        stage: objects and camera.
        rng: generator of the noise.

    Raises:
        MissingExtraError: OpenCV is not installed.
    """
    cv2 = opencv()
    width, height = stage.camera.size
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    pixels = np.stack([x, y], axis=-1).astype(float)
    value, whose = stage.bare(pixels), np.full((height, width), -1)
    x0, x1, y0, y1 = stage.extent()
    inner = pixels[y0:y1, x0:x1]
    if inner.size:
        part, what, owner = (a.reshape(inner.shape[:2]) for a in stage.shade(inner.reshape(-1, 2)))
        value[y0:y1, x0:x1], whose[y0:y1, x0:x1] = part, owner
        differ = np.zeros(what.shape, dtype=np.uint8)
        differ[:, 1:] |= what[:, 1:] != what[:, :-1]
        differ[1:] |= what[1:] != what[:-1]
        border = cv2.dilate(differ, np.ones((3, 3), np.uint8)) > 0
        steps = (np.arange(FINE) + 0.5) / FINE - 0.5
        offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        fine, _, _ = stage.shade((inner[border][:, None] + offsets).reshape(-1, 2))
        value[y0:y1, x0:x1][border] = fine.reshape(-1, FINE * FINE).mean(axis=1)
    value = cv2.GaussianBlur(value, (0, 0), stage.appearance.blur, borderType=cv2.BORDER_REPLICATE)
    value = value + rng.normal(0.0, stage.appearance.noise, value.shape)
    return np.clip(np.rint(value), 0, 255), whose
