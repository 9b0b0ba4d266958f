"""Pictures of parts on a table, by rays: Lambert shading, cast shadows, blur, noise, things in the way.

A picture is drawn once a pixel, and again with sixteen rays a pixel where neighbours differ in what they show.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np

from tanteo.lie import SE3, SO3
from tanteo.shapes import Surface
from tanteo.vision.camera import Camera, project, rays

FINE = 4


@dataclass(frozen=True)
class Look:
    """Light, paint and lens.

    Attributes:
        light: direction to the light in the world.
        ambient: share of light that comes from everywhere.
        table: brightness of the table [grey levels].
        slope: change of the table's brightness across a metre, along x and y [grey levels/m].
        blur: standard deviation of the lens's spread [px].
        noise: standard deviation of a pixel [grey levels].
    """

    light: tuple[float, float, float] = (0.35, -0.25, 1.0)
    ambient: float = 0.45
    table: float = 200.0
    slope: tuple[float, float] = (60.0, -40.0)
    blur: float = 0.8
    noise: float = 2.0


@dataclass(frozen=True)
class Thing:
    """A mesh in the world: vertices, triangles, one label for each triangle, brightness."""

    vertices: np.ndarray
    triangles: np.ndarray
    labels: np.ndarray
    paint: float


def thing(part, T_world_part, paint=120.0):
    """A part at a pose."""
    return Thing(SE3.apply(T_world_part, part.vertices), part.triangles, part.triangle_face, paint)


def slab_thing(outline, height, T_world_slab, paint):
    """A slab over an outline that its middle sees whole, counter-clockwise ``(n, 2)``."""
    n = len(outline)
    flat = np.concatenate([outline, outline.mean(axis=0, keepdims=True)])
    vertices = np.concatenate([np.insert(flat, 2, z, axis=1) for z in (0.0, height)])
    i = np.arange(n)
    j = (i + 1) % n
    m = n + 1
    lids = [np.stack([j, i, np.full(n, n)], 1), np.stack([i + m, j + m, np.full(n, n + m)], 1)]
    sides = [np.stack([i, j, j + m], 1), np.stack([i, j + m, i + m], 1)]
    labels = np.concatenate([np.zeros(n), np.ones(n), 2 + i, 2 + i]).astype(int)
    return Thing(SE3.apply(T_world_slab, vertices), np.concatenate([*lids, *sides]), labels, paint)


@dataclass
class Scene:
    """Things on a table z = 0, seen by a camera that stands in the world."""

    camera: Camera
    things: list
    look: Look = field(default_factory=Look)

    def __post_init__(self):
        starts = np.cumsum([0, *[len(t.vertices) for t in self.things]])
        self.surface = Surface(
            np.concatenate([t.vertices for t in self.things]),
            np.concatenate([t.triangles + s for t, s in zip(self.things, starts, strict=False)]),
        )
        sizes = [t.labels.max() + 1 for t in self.things]
        first = np.cumsum([0, *sizes])
        self.labels = np.concatenate([t.labels + s for t, s in zip(self.things, first, strict=False)])
        self.owner = np.concatenate([np.full(len(t.triangles), k) for k, t in enumerate(self.things)])
        self.paints = np.concatenate([np.full(len(t.triangles), t.paint) for t in self.things])

    def extent(self):
        """Columns and rows that the things and their shadows are in."""
        light = np.array(self.look.light)
        vertices = self.surface.vertices
        shadows = vertices - vertices[:, 2:] / light[2] * light
        local = SE3.apply(SE3.inverse(self.camera.T_world_camera), np.concatenate([vertices, shadows]))
        seen = project(self.camera, local)
        low, high = np.floor(seen.min(axis=0)) - 4, np.ceil(seen.max(axis=0)) + 5
        (x0, y0), (x1, y1) = np.clip(low, 0, self.camera.size), np.clip(high, 0, self.camera.size)
        return int(x0), int(x1), int(y0), int(y1)

    def bare(self, pixels):
        """Brightness of the table without anything on it."""
        T = self.camera.T_world_camera
        way = rays(self.camera, pixels) @ T[:3, :3].T
        where = T[:3, 3] - T[2, 3] / np.minimum(way[..., 2:], -1e-9) * way
        return np.clip(self.look.table + where[..., :2] @ np.array(self.look.slope), 0, 255)

    def shade(self, pixels):
        """Brightness of pixels ``(n, 2)``, what they show (a label; -1 table, -2 table in shadow), and whose."""
        T = self.camera.T_world_camera
        eye, way = T[:3, 3], rays(self.camera, pixels) @ T[:3, :3].T
        way = way / np.linalg.norm(way, axis=-1, keepdims=True)
        hits = self.surface.cast(np.broadcast_to(eye, way.shape), way)
        met = hits.triangles >= 0
        light = np.array(self.look.light) / np.linalg.norm(self.look.light)
        table = np.where(way[:, 2] < 0, -eye[2] / np.minimum(way[:, 2], -1e-9), 50.0)
        where = eye + np.where(met, hits.distances, table)[:, None] * way
        normals = np.where(met[:, None], self.surface.normals[hits.triangles], [0.0, 0.0, 1.0])
        normals = np.where(np.sum(normals * way, axis=1, keepdims=True) > 0, -normals, normals)
        facing = np.maximum(normals @ light, 0.0)
        lit = facing > 0
        lit[lit] = (
            self.surface.cast(where[lit] + 1e-5 * normals[lit], np.broadcast_to(light, way[lit].shape)).triangles < 0
        )
        paint = np.where(met, self.paints[hits.triangles], self.look.table + where[:, :2] @ np.array(self.look.slope))
        share = self.look.ambient + (1 - self.look.ambient) * facing / light[2] * lit
        what = np.where(met, 2 * self.labels[hits.triangles] + lit, np.where(lit, -1, -2))
        return np.clip(paint * share, 0, 255), what, np.where(met, self.owner[hits.triangles], -1)


def render(scene, rng):
    """The picture, and which thing each pixel shows (-1 for the table)."""
    width, height = scene.camera.size
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    pixels = np.stack([x, y], axis=-1).astype(float)
    value, whose = scene.bare(pixels), np.full((height, width), -1)
    x0, x1, y0, y1 = scene.extent()
    inner = pixels[y0:y1, x0:x1]
    part, what, owner = (a.reshape(inner.shape[:2]) for a in scene.shade(inner.reshape(-1, 2)))
    value[y0:y1, x0:x1], whose[y0:y1, x0:x1] = part, owner
    differ = np.zeros(what.shape, dtype=np.uint8)
    differ[:, 1:] |= what[:, 1:] != what[:, :-1]
    differ[1:] |= what[1:] != what[:-1]
    border = cv2.dilate(differ, np.ones((3, 3), np.uint8)) > 0
    steps = (np.arange(FINE) + 0.5) / FINE - 0.5
    offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    fine, _, _ = scene.shade((inner[border][:, None] + offsets).reshape(-1, 2))
    value[y0:y1, x0:x1][border] = fine.reshape(-1, FINE * FINE).mean(axis=1)
    value = cv2.GaussianBlur(value, (0, 0), scene.look.blur, borderType=cv2.BORDER_REPLICATE)
    value = value + rng.normal(0.0, scene.look.noise, value.shape)
    return np.clip(np.rint(value), 0, 255), whose


def table_camera(
    distance=0.6, tilt=25.0, turn=30.0, size=(640, 480), focal=620.0, distortion=(-0.12, 0.05, 4e-4, -3e-4, 0.0)
):
    """A camera over the table, looking at its origin from ``tilt`` degrees off the vertical."""
    K = np.array([[focal, 0, size[0] / 2 - 3.2], [0, focal * 1.003, size[1] / 2 + 2.1], [0, 0, 1]])
    R = SO3.exp(np.radians([0, 0, turn])) @ SO3.exp(np.radians([180.0 - tilt, 0.0, 0.0]))
    return Camera(K, size, np.array(distortion), SE3.from_parts(R, -distance * R[:, 2]))
