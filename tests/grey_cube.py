"""The calibrated grey images of a cube: its part, camera, published first pose, and the pose followed through them."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np

from random_parts import write_off
from tanteo.geometry import SE3, SO3
from tanteo.parts import read_part
from tanteo.vision import Camera, find_edges
from tanteo.vision.edges import map_edges
from tanteo.vision.fit import meet

FOLDER = Path(__file__).resolve().parents[1].parent / "shared" / "data" / "grey_cube"


def camera():
    """Intrinsics from the tracker's XML."""
    text = (FOLDER / "cube.xml").read_text()
    fx, fy, cx, cy = (float(re.search(rf"<{name}>([\d.]+)<", text)[1]) for name in ("px", "py", "u0", "v0"))
    return Camera(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), (640, 480))


def cube(folder):
    """Return the part, from the vertices and faces of its model [m]."""
    lines = [line.split("#")[0].split() for line in (FOLDER / "cube.cao").read_text().splitlines()]
    lines = [line for line in lines if line][1:]
    count = int(lines[0][0])
    vertices = np.array(lines[1 : 1 + count], dtype=float)
    faces = [[int(i) for i in line[1:]] for line in lines if len(line) == 5 and line[0] == "4"]
    triangles = np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))])
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    if np.sum(np.cross(a, b) * c) < 0:
        triangles = triangles[:, ::-1]
    write_off(folder / "cube.off", vertices * 1e3, triangles)
    return read_part(folder / "cube.off", unit="mm")


def published():
    """``T_camera_cube`` of the first image."""
    values = np.array((FOLDER / "cube.0.pos").read_text().split(), dtype=float)
    return SE3.from_parts(SO3.exp(values[3:]), values[:3])


def images():
    """Names of the images, in order."""
    return sorted(path.name for path in FOLDER.glob("image*.png"))


def load(name):
    """Return one image as floats."""
    return cv2.imread(str(FOLDER / name), cv2.IMREAD_GRAYSCALE).astype(float)


def same_pose(part, first, second, turn=2.0, shift=0.01):
    """Return whether two poses are equal up to the cube's symmetry, to ``turn`` degrees and a relative ``shift``."""
    between = SE3.log(SE3.inverse(first) @ second @ part.symmetry.Ts)
    middles = SE3.apply(np.stack([first, second]), part.centroid)
    apart = np.linalg.norm(middles[0] - middles[1]) / np.linalg.norm(second[:3, 3])
    return bool(np.degrees(np.linalg.norm(between[:, 3:], axis=1).min()) < turn and apart < shift)


def measured_corners(image, model, T_camera_cube):
    """Return the visible corners of the cube, and where lines fitted to the image alone intersect there [px].

    The pose assigns edge points to edges (within 4 px); the lines are free.
    """
    edges = map_edges(find_edges(image))
    hits = meet(model.frame, camera(), edges, T_camera_cube, 4.0)
    lines = {}
    for group in np.unique(model.frame.groups[hits.hits]):
        points = edges.points.pixels[hits.points[hits.hits & (model.frame.groups == group)]]
        middle = np.median(points, axis=0)
        for _ in range(5):
            way = np.linalg.svd(points - middle)[2][0]
            off = np.abs((points - middle) @ [-way[1], way[0]])
            points = points[off < max(2.5 * np.median(off), 0.3)]
            middle = points.mean(axis=0)
        if len(points) >= 8:
            lines[group] = middle, way
    corners, pixels = [], []
    for vertex in model.part.vertices:
        near = np.linalg.norm(model.frame.points - vertex, axis=1) < 0.012
        own = [g for g in np.unique(model.frame.groups[near]) if g in lines]
        if len(own) < 2:
            continue
        A = np.array([[-lines[g][1][1], lines[g][1][0]] for g in own])
        b = np.array([a @ lines[g][0] for a, g in zip(A, own, strict=True)])
        corners.append(vertex)
        pixels.append(np.linalg.lstsq(A, b, rcond=None)[0])
    return np.array(corners), np.array(pixels)
