"""The camera: from points to pixels and back to rays, with the distortion of calibration files.

Frame ``camera``: x to the right of the image, y down, z forward; pixel centres have whole coordinates. Distortion is
the rational model with tangential terms (Brown 1966; the order of OpenCV and of ROS ``plumb_bob`` and
``rational_polynomial``).
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from types import ModuleType

import numpy as np

from tanteo.errors import InputError, MissingExtraError, install_command
from tanteo.geometry import SE3, check_covariance, frozen_array
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, Transforms, Vectors
from tanteo.values import Value, lock
from tanteo.vision.settings import EDGES, NEWTON_STEPS

PIXELS = 64_000_000
"""Numerical: largest number of pixels of an image, which take half a gigabyte of memory."""


def opencv() -> ModuleType:
    """Return the module of OpenCV. Before it is loaded, its limit of the number of pixels is set.

    Raises:
        MissingExtraError: OpenCV is not installed.
    """
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(PIXELS))
    try:
        import cv2
    except ImportError as error:
        raise MissingExtraError(
            f"image: expected OpenCV to work on images, got {error}. Run {install_command('vision')}."
        ) from error
    return cv2


USUAL_EDGE_SD = EDGES.lens
"""Standard deviation of the displacement of whole edges after a usual calibration [px]."""

DISTORTION_COUNTS = (0, 4, 5, 8)
"""Definition: a distortion model has k1 k2 p1 p2, then k3, then k4 k5 k6."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Mounting(Value):
    """The pose of a camera on a hand, whose error is the same in all images of one mounting.

    Attributes:
        T_hand_camera: pose of the camera in the hand's frame ``(4, 4)`` [m].
        covariance: its covariance ``(6, 6)``, camera frame, right [m, rad], such as
            :func:`~tanteo.sensors.calibration.calibrate_hand_eye` returns.

    Raises:
        InputError: the pose is no rigid motion, or the covariance is none.
    """

    T_hand_camera: Transforms
    covariance: Covariances

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_hand_camera", rigid("T_hand_camera", self.T_hand_camera))
        object.__setattr__(self, "covariance", check_covariance("mounting, covariance", self.covariance, 6))
        lock(self)

    def camera_at(self, camera: Camera, T_world_hand: Transforms, covariance: Covariances | None = None) -> Camera:
        """Return a camera with its pose in the world, where the hand has a pose.

        Args:
            camera: camera of this mounting; its pose is not used.
            T_world_hand: pose of the hand ``(4, 4)`` [m].
            covariance: covariance of this pose ``(6, 6)``, hand frame, right [m, rad]; its error differs from image to
                image. None if it is exact.
        """
        Ad = SE3.adjoint(SE3.inverse(self.T_hand_camera))
        own = None if covariance is None else Ad @ np.asarray(covariance, dtype=np.float64) @ Ad.T
        T = rigid("T_world_hand", T_world_hand) @ self.T_hand_camera
        return replace(camera, T_world_camera=T, covariance=None if own is None else 0.5 * (own + own.T), mounting=self)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Camera(Value):
    """A calibrated camera.

    Attributes:
        K: focal lengths and principal point ``(3, 3)`` [px], without skew.
        size: width and height [px].
        distortion: coefficients ``k1 k2 p1 p2 [k3 [k4 k5 k6]]``; empty for a camera without distortion.
        T_world_camera: pose of the camera ``(4, 4)``; None if it is unknown.
        covariance: covariance of that pose ``(6, 6)``, camera frame, right [m, rad], without that of the mounting;
            None if the pose is exact.
        mounting: mounting of the camera, whose error all images with this object have in common; None without one.
        edge_sd: standard deviation of the displacement of a whole edge by lens and calibration [px].
        notes: assumptions that were made when the camera was read, one sentence each.

    Raises:
        InputError: the matrix is not that of a camera, no model has so many coefficients, or a deviation is negative.

    Example:
        >>> camera = tanteo.read_camera("images/camera.yaml")
        >>> camera.T_world_camera is None  # the pose of the camera is unknown
        True
    """

    K: FloatArray
    size: tuple[int, int]
    distortion: FloatArray = field(default_factory=lambda: np.zeros(0))
    T_world_camera: Transforms | None = None
    covariance: Covariances | None = None
    mounting: Mounting | None = None
    edge_sd: float = USUAL_EDGE_SD
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        K, distortion = frozen_array(self.K), frozen_array(self.distortion).reshape(-1)
        lower = K.shape == (3, 3) and np.allclose(K[[0, 1, 2, 2], [1, 0, 0, 1]], 0) and np.isclose(K[2, 2], 1)
        if not (lower and np.all(np.isfinite(K)) and K[0, 0] > 0 and K[1, 1] > 0):
            raise InputError(
                f"K: expected fx, 0, cx; 0, fy, cy; 0, 0, 1 with fx, fy > 0, got {K.tolist()}. Give pixels, no skew."
            )
        if len(distortion) not in DISTORTION_COUNTS or not np.all(np.isfinite(distortion)):
            raise InputError(
                f"distortion: expected 0, 4, 5 or 8 coefficients (k1 k2 p1 p2 k3 k4 k5 k6), got {distortion.tolist()}. "
                "Fisheye models are not supported: rectify the image first."
            )
        if min(self.size) < 1:
            raise InputError(f"size: expected width and height in pixels, got {self.size}. Give the image's own.")
        if not 0 <= self.edge_sd < np.inf:
            raise InputError(
                f"edge_sd (edge_sd_px): expected a standard deviation in pixels, 0 or more, got {self.edge_sd}. "
                f"Omit it if it is unknown: the default is {USUAL_EDGE_SD} px."
            )
        object.__setattr__(self, "K", K)
        object.__setattr__(self, "distortion", distortion)
        if self.T_world_camera is not None:
            object.__setattr__(self, "T_world_camera", rigid("T_world_camera", self.T_world_camera))
        if self.covariance is not None:
            object.__setattr__(self, "covariance", check_covariance("camera, covariance", self.covariance, 6))
        lock(self)

    @property
    def pose_covariance(self) -> Covariances | None:
        """Return the covariance of the pose with the error of the mounting ``(6, 6)``; None if the pose is exact."""
        if self.mounting is None:
            return self.covariance
        return self.mounting.covariance + (0.0 if self.covariance is None else self.covariance)

    @property
    def numbers(self) -> FloatArray:
        """Focal lengths, principal point and the eight coefficients of the lens ``(12,)``, for the core."""
        return np.array([*self.focal, *self.centre, *_all_terms(self.distortion)])

    @property
    def focal(self) -> FloatArray:
        """Focal lengths ``(2,)`` [px]."""
        return np.array([self.K[0, 0], self.K[1, 1]])

    @property
    def centre(self) -> FloatArray:
        """Principal point ``(2,)`` [px]."""
        return self.K[:2, 2]


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """One image and its camera.

    Attributes:
        pixels: grey levels from 0 to 255 ``(rows, columns)``; see :func:`tanteo.read_image`.
        camera: calibrated camera with its pose in the world of the readings, or of the other images
            (``T_world_camera``).
        on_table: whether the object lies on a table, so that the image proposes such poses; if not, any poses.
        ignore: pixels of known objects ``(rows, columns)``, whose regions are excluded; None without any.
    """

    pixels: FloatArray
    camera: Camera
    on_table: bool = True
    ignore: BoolArray | None = None


def rigid(name: str, T: Transforms) -> Transforms:
    """Return a rigid motion as a read-only array.

    Raises:
        InputError: the matrix is not a rigid motion.
    """
    out = frozen_array(T)
    R = out[:3, :3] if out.shape == (4, 4) else np.zeros((3, 3))
    turns = np.all(np.isfinite(out)) and np.allclose(R.T @ R, np.eye(3), atol=1e-4) and np.linalg.det(R) > 0
    if not (turns and np.allclose(out[3], [0, 0, 0, 1], atol=1e-9)):
        raise InputError(
            f"{name}: expected a rigid motion, 4 x 4, metres, row by row, its last row 0 0 0 1, its rotation with five "
            f"digits, got {out.tolist()}. Check its rows."
        )
    return out


def project(camera: Camera, points: Vectors) -> FloatArray:
    """Return the pixels ``(*batch, 2)`` of points ``(*batch, 3)``, camera frame [m]; NaN behind the camera."""
    z = points[..., 2]
    ahead = np.where(z > 0, z, np.nan)
    x, y = points[..., 0] / ahead, points[..., 1] / ahead
    if len(camera.distortion):
        x, y = _distort(camera.distortion, x, y)
    return np.stack([camera.K[0, 0] * x + camera.K[0, 2], camera.K[1, 1] * y + camera.K[1, 2]], axis=-1)


def project_linearized(camera: Camera, points: Vectors) -> tuple[FloatArray, FloatArray]:
    """Return the pixels of points, and their derivative by the point ``(*batch, 2, 3)`` [px/m]."""
    z = np.where(points[..., 2] > 0, points[..., 2], np.nan)
    x, y = points[..., 0] / z, points[..., 1] / z
    rows: tuple[tuple[FloatArray, ...], ...] = (
        (np.ones_like(z), np.zeros_like(z)),
        (np.zeros_like(z), np.ones_like(z)),
    )
    seen = x, y
    if len(camera.distortion):
        rows, seen = _distortion_derivatives(camera.distortion, x, y), _distort(camera.distortion, x, y)
    # derivative of x and y by the point: those of a central projection
    D = np.stack([np.stack([by_x, by_y, -by_x * x - by_y * y], axis=-1) for by_x, by_y in rows], axis=-2)
    pixels = np.stack(seen, axis=-1) * camera.focal + camera.centre
    return pixels, D * (camera.focal[:, None] / z[..., None, None])


def rays(camera: Camera, pixels: FloatArray) -> Vectors:
    """Return the rays ``(*batch, 3)`` of pixels ``(*batch, 2)`` without distortion, camera frame, z = 1."""
    x, y = np.moveaxis((np.asarray(pixels, dtype=np.float64) - camera.centre) / camera.focal, -1, 0)
    if len(camera.distortion):
        x, y = _undistort(camera.distortion, x, y)
    return np.stack([x, y, np.ones_like(x)], axis=-1)


def without_distortion(camera: Camera, pixels: FloatArray) -> FloatArray:
    """Return the pixels without distortion ``(*batch, 2)`` [px], in which straight edges are straight lines."""
    return np.asarray(rays(camera, pixels)[..., :2] * camera.focal + camera.centre)


def on_plane(camera: Camera, pixels: FloatArray, T_camera_plane: Transforms) -> Vectors:
    """Return where rays of pixels intersect the plane z = 0 of a frame, in that frame [m]; NaN where they do not."""
    return meet_plane(rays(camera, pixels), T_camera_plane)


def meet_plane(rays_camera: Vectors, T_camera_plane: Transforms) -> Vectors:
    """Return where rays ``(*batch, 3)`` intersect the plane z = 0 of a frame, in that frame [m]; else NaN."""
    directions = rays_camera @ T_camera_plane[:3, :3]
    origin = -T_camera_plane[:3, :3].T @ T_camera_plane[:3, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = -origin[2] / directions[..., 2]
    along = np.where(np.isfinite(along) & (along > 0), along, np.nan)
    return np.asarray(origin + along[..., None] * directions)


def _all_terms(k: FloatArray) -> tuple[float, ...]:
    """Return all eight coefficients, with 0 for those that are not given."""
    return *k.tolist(), *(0.0,) * (8 - len(k))


def _terms(k: FloatArray, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the radial factor, its derivative by ``r^2``, and the tangential shifts."""
    k1, k2, p1, p2, k3, k4, k5, k6 = _all_terms(k)
    r2 = x * x + y * y
    up, down = 1 + r2 * (k1 + r2 * (k2 + r2 * k3)), 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
    d_up, d_down = k1 + r2 * (2 * k2 + 3 * r2 * k3), k4 + r2 * (2 * k5 + 3 * r2 * k6)
    dx, dy = 2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return up / down, (d_up * down - up * d_down) / (down * down), dx, dy


def _distort(k: FloatArray, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    radial, _, dx, dy = _terms(k, x, y)
    return x * radial + dx, y * radial + dy


def _distortion_derivatives(k: FloatArray, x: FloatArray, y: FloatArray) -> tuple[tuple[FloatArray, ...], ...]:
    """Return the derivatives of the distorted point by the ideal point: two rows of two, each ``(*batch,)``."""
    radial, slope, _, _ = _terms(k, x, y)
    p1, p2 = k[2], k[3]
    cross = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y
    xx = radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x
    yy = radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x
    return (xx, cross), (cross, yy)


def _undistort(k: FloatArray, u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
    x, y = u, v
    for _ in range(NEWTON_STEPS):
        radial, _, dx, dy = _terms(k, x, y)
        x, y = (u - dx) / radial, (v - dy) / radial
    for _ in range(NEWTON_STEPS):
        (xx, xy), (yx, yy) = _distortion_derivatives(k, x, y)
        a, b = _distort(k, x, y)
        a, b, det = u - a, v - b, xx * yy - xy * yx
        x, y = x + (yy * a - xy * b) / det, y + (xx * b - yx * a) / det
    return x, y
