"""Random scenes for the camera: a part as it may lie, light, paint, noise, and something in the way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rendered import rendered_slab, table_camera
from tanteo.geometry import SE3, SO3
from tanteo.parts import read_part
from tanteo.vision import Camera, View, find_edges, prepare_vision, render
from tanteo.vision.camera import on_plane
from tanteo.vision.edges import map_edges
from tanteo.vision.rendering import Appearance, Stage, rendered_part
from tanteo.vision.table import TableErrors

PARTS = Path(__file__).parents[1] / "examples" / "parts"

TABLE = 0.09
"""Half side of the square of the table in which parts lie [m]."""


@dataclass(frozen=True)
class Shot:
    """A picture with its truth: which part (None: not in the catalogue), how it lies, how much of it is hidden."""

    image: np.ndarray
    camera: object
    model: object
    rest: int
    T_world_part: np.ndarray
    hidden: float


def bracket():
    """Return the left bracket, prepared."""
    return prepare_vision(read_part(PARTS / "bracket_left.step"))


def seen_alone(model, yaw):
    """Camera, image, its edges, and the pose in the camera of a part that lies alone on the table."""
    camera = table_camera()
    T = SE3.from_parts(SO3.axis_rotation(2, yaw), np.array([0.02, 0.01, 0.0])) @ model.rests[0].T_table_part
    image, _ = render(Stage(camera, [rendered_part(model.part, T, 120)]), np.random.default_rng(2))
    return camera, image, map_edges(find_edges(image)), SE3.inverse(camera.T_world_camera) @ T


def random_rendering(rng):
    """Light from above, somewhere; a table brighter than most parts."""
    turn, tilt = rng.uniform(0, 2 * np.pi), rng.uniform(0.15, 0.6)
    light = (np.cos(turn) * tilt, np.sin(turn) * tilt, 1.0)
    slope = tuple(rng.uniform(-60, 60, 2))
    return Appearance(
        light, rng.uniform(0.35, 0.6), rng.uniform(170, 215), slope, rng.uniform(0.6, 1.0), rng.uniform(1, 4)
    )


def lying(model, rng, reach=TABLE):
    """Return a stable pose, drawn with its probability, at a random place and yaw."""
    k = int(rng.choice(len(model.rests), p=[rest.probability for rest in model.rests]))
    place = np.r_[rng.uniform(-reach, reach, 2), 0.0]
    return k, SE3.from_parts(SO3.axis_rotation(2, rng.uniform(-np.pi, np.pi)), place) @ model.rests[k].T_table_part


def plate_over(scene, share, rng, paint):
    """Return a plate with a random outline that hides about a share of the part, as a hand or a gripper does."""
    camera = scene.camera
    x0, x1, y0, y1 = scene.extent()
    pixels = np.stack(np.meshgrid(np.arange(x0, x1, 2), np.arange(y0, y1, 2)), axis=-1).reshape(-1, 2).astype(float)
    own = pixels[scene.shade(pixels)[2] == 0]
    z = float(scene.objects[0].vertices[:, 2].max()) + 0.006
    T_camera_plane = SE3.inverse(camera.T_world_camera) @ SE3.from_parts(np.eye(3), np.array([0.0, 0.0, z]))
    over = on_plane(camera, own, T_camera_plane)[:, :2]
    way = rng.uniform(0, 2 * np.pi)
    u = np.array([np.cos(way), np.sin(way)])
    v = np.array([-u[1], u[0]])
    edge, middle, span = np.quantile(over @ u, 1 - share), over.mean(axis=0) @ v, np.ptp(over @ v)
    R = np.array([[u[0], v[0], 0], [u[1], v[1], 0], [0, 0, 1]])
    T = SE3.from_parts(R, np.array([*(edge * u + middle * v), z]))
    depth = (over @ u).max() - edge + rng.uniform(0.005, 0.02)
    half = 0.5 * span + rng.uniform(0.005, 0.02)
    # the side over the part waves by a few millimetres, the others are as irregular as they come
    y = np.linspace(-half, half, 9)
    wave = rng.normal(0.0, 0.0025, 9)
    front = np.stack([wave - wave.mean(), y], axis=1)
    back = np.stack([depth + rng.uniform(0.0, 0.015, 5), np.linspace(half, -half, 5)], axis=1)
    return rendered_slab(np.concatenate([back, front]), 0.004, T, paint)


def random_shot(models, rng, hidden=0.0, other=None, noise=1.0):
    """Return a picture of one of the models or of another part, with a hidden share and a factor of the noise."""
    model = other or models[int(rng.integers(len(models)))]
    camera = table_camera(rng.uniform(0.5, 0.7), rng.uniform(5, 35), rng.uniform(-180, 180))
    camera = replace(camera, edge_sd=0.0)  # a rendered image has exactly the stated camera
    rest, T = lying(model, rng)
    rendering = random_rendering(rng)
    rendering = replace(rendering, noise=noise * rendering.noise)
    scene = Stage(camera, [rendered_part(model.part, T, rng.uniform(70, 150))], rendering)
    if hidden:
        plate = plate_over(scene, hidden, rng, rng.uniform(30, 235))
        scene = Stage(camera, [*scene.objects, plate], rendering)
    image, whose = render(scene, rng)
    covered = 0.0
    if hidden:
        alone = Stage(camera, scene.objects[:1], rendering)
        x0, x1, y0, y1 = scene.extent()
        pixels = np.stack(np.meshgrid(np.arange(x0, x1), np.arange(y0, y1)), axis=-1).reshape(-1, 2)
        before = (alone.shade(pixels.astype(float))[2] == 0).sum()
        covered = 1 - (whose == 0).sum() / max(before, 1)
    return Shot(image, camera, model if other is None else None, rest, T, float(covered))


def in_camera(shot):
    """Pose of the part in the camera's frame."""
    return SE3.inverse(shot.camera.T_world_camera) @ shot.T_world_part


def stated_table(shot, part, rng):
    """Return the stated pose of the table, with height and tilt errors about the part as stated."""
    errors = TableErrors()
    about = SE3.apply(shot.T_world_part, part.centroid) * [1, 1, 0]
    place = SE3.from_parts(np.eye(3), about)
    step = np.r_[0, 0, rng.normal(0, errors.height), rng.normal(0, errors.tilt, 2), 0]
    return place @ SE3.exp(step) @ SE3.inverse(place)


def looking(eye, target, roll=0.0):
    """Return the pose of a camera at ``eye`` whose optical axis meets ``target``, rolled by an angle."""
    z = (target - eye) / np.linalg.norm(target - eye)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    return SE3.from_parts(np.stack([x, np.cross(z, x), z], axis=1) @ SO3.axis_rotation(2, roll), eye)


def hand_views(part, T, mounting, error, rng):
    """Return three images of a floating part by a camera on a hand whose mounting is off by an error ``(6,)``."""
    K = np.array([[1000.0, 0, 319.5], [0, 1000.0, 239.5], [0, 0, 1]])
    middle = SE3.apply(T, part.centroid)
    out = []
    for turn in (0.0, 2.1, 4.2):
        way = np.array([0.5 * np.cos(turn), 0.5 * np.sin(turn), 1.0])
        camera = Camera(K, (640, 480), T_world_camera=looking(middle + 0.5 * way / np.linalg.norm(way), middle))
        pixels, _ = render(Stage(camera, [rendered_part(part, T, 120)]), rng)
        hand = camera.T_world_camera @ SE3.inverse(mounting.T_hand_camera @ SE3.exp(error))
        out.append(View(pixels, mounting.camera_at(camera, hand), on_table=False))
    return out
