"""Edges, corners and ellipses of an image as sensed features, for ``localization``.

An edge in the image is a plane through the camera's centre that holds the model edge (relation ``plane_has_edge``, two
equations). A corner is a line through the centre that holds the model vertex (``edge_has_vertex``, two equations). An
image does not measure depth, so neither fixes a pose alone. An ellipse is one of two circles if the radius is known. If
it is unknown, the centre is on one of two lines. Lens and calibration add ``Camera.edge_sd`` to each.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tanteo.errors import InputError
from tanteo.features import Feature, Round, Sides
from tanteo.features.kinds import CIRCLE, EDGE, PLANE
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import Covariances, FloatArray, Transforms
from tanteo.vision.camera import Camera
from tanteo.vision.circles import circle_poses
from tanteo.vision.ellipse_fit import Ellipse
from tanteo.vision.segments import Corners, Segments

CENTRE_SD = 1e-6
"""Numerical: standard deviation of the camera's centre across a plane or line through it [m]. Its position is exact."""


def image_edge(camera: Camera, segments: Segments, index: int, T_world_camera: Transforms | None = None) -> Feature:
    """Return the plane through the camera's centre and a segment, as a sensed plane to be paired with a model edge.

    The origin of its frame is the camera's centre. x is along the ray to the middle of the segment, z is the normal.
    The plane turns about y with the offset of the segment and about x with its direction.

    Args:
        camera: camera of the image.
        segments: segments of the image.
        index: number of the segment.
        T_world_camera: pose of the camera ``(4, 4)``; that of ``camera`` if not given.

    Raises:
        InputError: the pose of the camera is unknown.
    """
    T = standing(camera, T_world_camera)
    middle, direction = segments.middles[index], segments.directions[index]
    ray = np.append((middle - camera.centre) / camera.focal, 1.0)
    along = np.append(direction / camera.focal, 0.0)
    # a step of one pixel across, and a turn of one radian about the middle, as rotations of the plane
    across = np.append(np.array([-direction[1], direction[0]]) / camera.focal, 0.0)
    x = ray / np.linalg.norm(ray)
    z = np.cross(x, along)
    z /= np.linalg.norm(z)
    R = np.stack([x, np.cross(z, x), z], axis=1)
    turn_offset = -float(across @ z) / np.linalg.norm(ray)
    length = float(along @ R[:, 1]) / np.linalg.norm(ray)
    turn_angle = float(across @ z) / np.linalg.norm(ray) / length
    G = np.array([[0.0, turn_angle], [turn_offset, 0.0]])
    P = np.zeros((3, 3))
    P[0, 0] = CENTRE_SD**2
    lens = np.diag([camera.edge_sd, 0.0]) ** 2
    P[1:, 1:] = G @ (segments.covariances[index] + lens) @ G.T
    return Feature(PLANE, T @ SE3.from_parts(R, np.zeros(3)), P, label=f"image edge {index}")


def image_corner(camera: Camera, corners: Corners, index: int, T_world_camera: Transforms | None = None) -> Feature:
    """Return the line through the camera's centre and a corner, as a sensed edge to be paired with a model vertex.

    Args:
        camera: camera of the image.
        corners: corners of the image.
        index: number of the corner.
        T_world_camera: pose of the camera ``(4, 4)``; that of ``camera`` if not given.

    Raises:
        InputError: the pose of the camera is unknown.
    """
    T = standing(camera, T_world_camera)
    covariance = corners.covariances[index] + camera.edge_sd**2 * np.eye(2)
    return _ray_feature(camera, corners.pixels[index], covariance, T, f"image corner {index}")


def image_circle(
    camera: Camera,
    ellipse: Ellipse,
    radius: float,
    *,
    radius_sd: float = 0.0,
    T_world_camera: Transforms | None = None,
    label: str = "image circle",
) -> Sides:
    """Return the two circles of a radius that project to an ellipse, to be paired with a circle of the model.

    There is one circle if the two cannot be discriminated. Lens and calibration (``Camera.edge_sd``) move the whole
    ellipse.

    Args:
        camera: camera of the image.
        ellipse: ellipse of :func:`tanteo.vision.find_ellipses`.
        radius: radius of the circle of the part [m].
        radius_sd: standard deviation of the radius [m].
        T_world_camera: pose of the camera ``(4, 4)``; that of ``camera`` if not given.
        label: label of the features.

    Raises:
        InputError: the pose of the camera is unknown, or the radius is not positive.

    Example:
        >>> camera = tanteo.read_camera("images/camera.yaml")
        >>> points = tanteo.vision.find_edges(tanteo.read_image("images/three_parts.png"))
        >>> ellipse = tanteo.vision.find_ellipses(camera, points).found[0]
        >>> first, second = tanteo.vision.features.image_circle(camera, ellipse, 5e-3, T_world_camera=np.eye(4))
        >>> first.kind.name, first.radius
        ('circle', 0.005)
    """
    T = standing(camera, T_world_camera)
    poses = circle_poses(camera, with_lens(camera, ellipse), radius, radius_sd)
    found = [
        Feature(
            CIRCLE,
            T @ pose.T_camera_circle,
            pose.covariance[:5, :5],
            label=label,
            size=Round(pose.radius, float(pose.covariance[5, 5]), pose.covariance[:5, 5]),
        )
        for pose in poses
    ]
    return found[0] if len(found) == 1 else (found[0], found[1])


def image_centre(
    camera: Camera,
    ellipse: Ellipse,
    *,
    T_world_camera: Transforms | None = None,
    label: str = "image centre",
) -> Feature:
    """Return the line through the camera's centre and the centre of a circle of unknown radius.

    It is a sensed edge, to be paired with a model vertex at the centre of the circle: two equations, no depth. The
    covariance includes the distance between the lines of the two circles.

    Args:
        camera: camera of the image.
        ellipse: ellipse of :func:`tanteo.vision.find_ellipses`.
        T_world_camera: pose of the camera ``(4, 4)``; that of ``camera`` if not given.
        label: label of the feature.

    Raises:
        InputError: the pose of the camera is unknown.

    Example:
        >>> camera = tanteo.read_camera("images/camera.yaml")
        >>> points = tanteo.vision.find_edges(tanteo.read_image("images/three_parts.png"))
        >>> ellipse = tanteo.vision.find_ellipses(camera, points).found[0]
        >>> tanteo.vision.features.image_centre(camera, ellipse, T_world_camera=np.eye(4)).kind.name
        'edge'
    """
    T = standing(camera, T_world_camera)
    pixels, covariances = [], []
    for pose in circle_poses(camera, with_lens(camera, ellipse), 1.0):
        x, y, z = pose.T_camera_circle[:3, 3]
        by = np.array([[1, 0, -x / z], [0, 1, -y / z]]) * camera.focal[:, None] / z @ pose.T_camera_circle[:3, :3]
        pixels.append(np.array([x, y]) / z * camera.focal + camera.centre)
        covariances.append(by @ pose.covariance[:3, :3] @ by.T)
    pixel = np.mean(pixels, axis=0)
    apart = np.mean([np.outer(p - pixel, p - pixel) for p in pixels], axis=0)
    return _ray_feature(camera, pixel, np.mean(covariances, axis=0) + apart, T, label)


def with_lens(camera: Camera, ellipse: Ellipse) -> Ellipse:
    """Return an ellipse with the error of lens and calibration: half of the variance shifts it, half widens it."""
    C = ellipse.covariance.copy()
    C[:2, :2] += 0.5 * camera.edge_sd**2 * np.eye(2)
    C[2:4, 2:4] += 0.5 * camera.edge_sd**2
    return replace(ellipse, covariance=C)


def _ray_feature(camera: Camera, pixel: FloatArray, C: Covariances, T: Transforms, label: str) -> Feature:
    ray = np.append((pixel - camera.centre) / camera.focal, 1.0)
    R = SO3.frame_from_axis(ray / np.linalg.norm(ray), 0)
    # d(unit ray) / d(pixel) across the ray; a turn w moves the x axis by w_z y - w_y z
    D = np.zeros((3, 2))
    D[0, 0], D[1, 1] = 1 / camera.focal
    across = R[:, 1:].T @ D / np.linalg.norm(ray)
    G = np.stack([-across[1], across[0]])
    P = np.zeros((4, 4))
    P[:2, :2] = CENTRE_SD**2 * np.eye(2)
    P[2:, 2:] = G @ C @ G.T
    return Feature(EDGE, T @ SE3.from_parts(R, np.zeros(3)), P, label=label)


def standing(camera: Camera, T_world_camera: Transforms | None) -> Transforms:
    """Return the pose of the camera.

    Raises:
        InputError: the pose is unknown.
    """
    T = camera.T_world_camera if T_world_camera is None else T_world_camera
    if T is None:
        raise InputError("camera: expected its pose (T_world_camera), got none. Fit it with fit_camera.")
    return T
