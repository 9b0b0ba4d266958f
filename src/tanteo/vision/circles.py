"""The two circles that project to an ellipse, with centre, axis and covariance; one if they cannot be discriminated.

The camera's centre and the ellipse span a cone. Planes of two directions cut circles out of it (Young and others 1992,
Kanatani and Liu 1993); the radius decides where along the cone. A circle that the camera views along its axis gives one
solution, whose tilt is not normal. On a short arc centre and axis depend nonlinearly on the ellipse. So samples of the
ellipse give both circles exactly, and mean and covariance are those of the circles (``math.md`` section 8).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import DegenerateError, InputError
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import Covariances, FloatArray, Transforms, Vectors
from tanteo.vision.camera import Camera
from tanteo.vision.ellipse_fit import Ellipse
from tanteo.vision.settings import NEWTON_STEPS, SEARCH

_DRAWS = 500
"""Numerical: pairs of ellipses that are drawn, one on either side of the estimate.
Standard deviations are exact to 2 %."""


@dataclass(frozen=True, slots=True, eq=False)
class CirclePose:
    """A circle with the covariance of its pose and radius.

    Attributes:
        T_camera_circle: origin at the centre, z along the axis, towards the camera ``(4, 4)`` [m].
        covariance: covariance of ``x, y, z, rx, ry`` and the radius ``(6, 6)`` [m, rad].
        radius: radius of the circle [m].
    """

    T_camera_circle: Transforms
    covariance: Covariances
    radius: float


def circle_poses(camera: Camera, ellipse: Ellipse, radius: float, radius_sd: float = 0.0) -> tuple[CirclePose, ...]:
    """Return the circles of a radius that project to an ellipse: two, or one if they cannot be discriminated.

    Args:
        camera: camera of the image.
        ellipse: ellipse of :func:`tanteo.vision.find_ellipses`.
        radius: radius of the circle [m].
        radius_sd: standard deviation of the radius [m].

    Raises:
        InputError: the radius is not positive.

    Example:
        >>> camera = tanteo.read_camera("images/camera.yaml")
        >>> aslant = tanteo.geometry.SE3.exp(np.array([0, 0, 0.3, 2.5, 0, 0]))
        >>> ellipse = tanteo.vision.circles.project_circle(camera, aslant, 5e-3)
        >>> first, second = tanteo.vision.circles.circle_poses(camera, ellipse, 5e-3)
        >>> len({tuple(np.round(pose.T_camera_circle[:3, 2], 3)) for pose in (first, second)})  # two axes
        2
    """
    if not (np.isfinite(radius) and radius > 0 and np.isfinite(radius_sd) and radius_sd >= 0):
        raise InputError(f"radius: expected a positive radius and its deviation [m], got {radius} and {radius_sd}.")
    if np.any(ellipse.covariance):
        found = _drawn(camera, ellipse)
    else:
        found = [(T, np.zeros((5, 5))) for T in circle_frames(camera, ellipse, 1.0)]
    return tuple(_scaled(T, P, radius, radius_sd) for T, P in found)


def circle_frames(camera: Camera, ellipse: Ellipse, radius: float) -> Transforms:
    """Return frames of the two circles of a radius that project to an ellipse ``(2, 4, 4)``, camera frame [m].

    The two are about equal for a circle that the camera views along its axis.
    """
    both = zip(*_closed_form(_dual(camera, ellipse.centre[None], ellipse.shape[None])), strict=True)
    return np.stack([SE3.from_parts(SO3.frame_from_axis(n[0], 2), radius * c[0]) for c, n in both])


def project_circle(camera: Camera, T_camera_circle: Transforms, radius: float) -> Ellipse:
    """Return the ellipse to which a circle projects, in pixels without distortion, without error.

    Args:
        camera: camera of the image.
        T_camera_circle: frame with its origin at the centre and z along the axis ``(4, 4)`` [m].
        radius: radius of the circle [m].

    Raises:
        DegenerateError: some of the circle is not in front of the camera, or the camera is in its plane.

    Example:
        >>> camera = tanteo.read_camera("images/camera.yaml")
        >>> ahead = tanteo.geometry.SE3.from_parts(np.eye(3), np.array([0, 0, 0.5]))
        >>> ellipse = tanteo.vision.circles.project_circle(camera, ahead, 5e-3)
        >>> np.allclose(ellipse.semi_axes, 5e-3 / 0.5 * camera.focal[::-1])
        True
    """
    D = _dual_of(camera, T_camera_circle, radius)
    if T_camera_circle[2, 3] <= radius * np.hypot(*T_camera_circle[2, :2]) or D[2, 2] >= 0:
        raise DegenerateError("circle: expected all of it in front of the camera, got some of it behind. Move it away.")
    m, S = D[:2, 2] / D[2, 2], np.outer(D[:2, 2], D[:2, 2]) / D[2, 2] ** 2 - D[:2, :2] / D[2, 2]
    values, axes = np.linalg.eigh(S)
    if values[0] < 1e-9 * values[1]:
        raise DegenerateError("circle: expected a camera outside of its plane, got one inside of it. Turn the circle.")
    return Ellipse(m, (axes * np.sqrt(values)) @ axes.T, np.zeros((5, 5)), 0.0, 1.0, 2 * np.pi, 0)


def _dual(camera: Camera, centres: FloatArray, shapes: FloatArray) -> FloatArray:
    """Return dual conics in rays ``(N, 3, 3)``: lines ``l`` with ``l D l = 0`` touch the ellipse; ``D[2, 2] = -1``."""
    A = np.diag(1 / camera.focal)
    m, S = (centres - camera.centre) @ A, A @ shapes @ shapes @ A
    D = np.full((len(m), 3, 3), -1.0)
    D[:, :2, :2], D[:, :2, 2], D[:, 2, :2] = S - m[:, :, None] * m[:, None], -m, -m
    return D


def _dual_of(camera: Camera, T: Transforms, radius: float) -> FloatArray:
    """Return the dual conic of a circle in the image ``(3, 3)``."""
    H = camera.K @ np.column_stack([radius * T[:3, 0], radius * T[:3, 1], T[:3, 3]])
    return np.asarray(H @ np.diag([1.0, 1.0, -1.0]) @ H.T)


def _closed_form(D: FloatArray) -> tuple[Vectors, Vectors]:
    """Return centres and axes, towards the camera, of both unit circles of dual conics ``(2, N, 3)``."""
    values, axes = np.linalg.eigh(np.linalg.inv(D))
    low, middle, high = values.T[..., None]  # low < 0 < middle <= high
    with np.errstate(invalid="ignore", divide="ignore"):
        depth = middle / np.sqrt(-high * low)
        along, across = np.sqrt(np.maximum(high - middle, 0) / (high - low)), np.sqrt((middle - low) / (high - low))
    sides = np.array([1.0, -1.0])[:, None, None]
    c = depth * (sides * low / middle * along * axes[:, :, 2] + high / middle * across * axes[:, :, 0])
    n = sides * along * axes[:, :, 2] + across * axes[:, :, 0]
    c = c * np.where(c[..., 2:] < 0, -1.0, 1.0)
    return c, n * -np.sign(np.sum(n * c, axis=-1, keepdims=True))


def _drawn(camera: Camera, ellipse: Ellipse) -> list[tuple[Transforms, Covariances]]:
    """Return unit circles and covariances, rows x y z rx ry: two, or one if they cannot be discriminated.

    Samples of the ellipse have weights by which all positions and axes have the same prior density.
    """
    values, vectors = np.linalg.eigh(ellipse.covariance)
    z = np.random.default_rng(0).normal(size=(_DRAWS, 5)) @ (vectors * np.sqrt(values.clip(0))).T
    x = ellipse.numbers + np.concatenate([np.zeros((1, 5)), z, -z])
    shapes = np.stack([x[:, [2, 4]], x[:, [4, 3]]], axis=1)
    shapes = np.where((np.linalg.eigvalsh(shapes)[:, 0] > 0)[:, None, None], shapes, ellipse.shape)
    c, n = _closed_form(_dual(camera, x[:, :2], shapes))
    frame = SO3.frame_from_axis(-c[0, 0] / np.linalg.norm(c[0, 0]), 2)
    across = (n[0, 0] - n[1, 0]) @ frame[:, :2]
    tilts = (n @ frame[:, :2]) @ across
    weights = np.stack([_weights(camera, shapes, *one) for one in zip(c, n, strict=True)])
    weights[:, 0] = 0.0  # the estimate itself is no draw
    mean = float(np.sum(weights * np.abs(tilts)) / weights.sum())
    spread = float(np.sqrt(np.sum(weights * (np.abs(tilts) - mean) ** 2) / weights.sum()))
    # the log density in the middle is mean^2 / (2 spread^2) lower than on either side
    halves = [tilts > 0, tilts <= 0] if mean > np.sqrt(SEARCH.likely) * spread else [np.ones_like(tilts, dtype=bool)]
    return [_moments(c[on], n[on], weights[on] / weights[on].sum()) for on in halves]


def _weights(camera: Camera, shapes: FloatArray, c: Vectors, n: Vectors) -> FloatArray:
    """Return the volume of circles for a volume of ellipses about each sample ``(N,)``, up to a factor.

    It follows from the derivatives of centre ``m`` and ``S = P^2`` of the ellipse, in rays, by those of the circle.
    """
    D = np.eye(3) - _outer(n, n) - _outer(c, c)
    last, m = D[:, 2, 2, None, None], D[:, :2, 2] / D[:, 2, 2, None]
    x = np.cross(n, np.where(np.abs(n[:, :1]) < 0.7, [[1.0, 0, 0]], [[0, 1.0, 0]]))
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    moves = [(c, np.broadcast_to(e, c.shape)) for e in np.eye(3)] + [(n, x), (n, np.cross(n, x))]
    columns = []
    for v, dv in moves:
        dD = -_outer(v, dv) - _outer(dv, v)
        dm = (dD[:, :2, 2] - m * dD[:, 2, 2, None]) / last[:, 0]
        dS = _outer(dm, m) + _outer(m, dm) - (dD[:, :2, :2] - D[:, :2, :2] * dD[:, 2, 2, None, None] / last) / last
        columns.append(np.stack([*dm.T, dS[:, 0, 0], dS[:, 0, 1], dS[:, 1, 1]], axis=1))
    volume = np.abs(np.linalg.det(np.stack(columns, axis=2)))
    a, b = np.linalg.eigvalsh(shapes).T
    return np.asarray(a * b * (a + b) / np.maximum(volume, 1e-6 * np.median(volume)))


def _moments(c: Vectors, n: Vectors, w: FloatArray) -> tuple[Transforms, Covariances]:
    """Return mean and covariance of weighted circles, from motions that do not turn about the axis of a circle."""
    mean = w @ n
    T = SE3.from_parts(SO3.frame_from_axis(mean / np.linalg.norm(mean), 2), w @ c)
    for _ in range(NEWTON_STEPS):
        xi = _motions(T, c, n)
        T = T @ SE3.exp(w @ xi)
    xi = _motions(T, c, n)
    return T, (w[:, None] * xi[:, :5]).T @ xi[:, :5]


def _motions(T: Transforms, c: Vectors, n: Vectors) -> FloatArray:
    """Return the motions from one circle to others ``(N, 6)``; the last column is 0."""
    R = T[:3, :3]
    z = n @ R
    sine = np.maximum(np.hypot(z[:, 0], z[:, 1]), 1e-300)
    turn = (np.arctan2(sine, z[:, 2]) / sine)[:, None] * np.column_stack([-z[:, 1], z[:, 0], np.zeros(len(z))])
    return SE3.log(SE3.from_parts(SO3.exp(turn), (c - T[:3, 3]) @ R))


def _scaled(T: Transforms, P: Covariances, radius: float, radius_sd: float) -> CirclePose:
    """Return a unit circle scaled to a radius with its standard deviation."""
    by_radius = np.r_[T[:3, :3].T @ T[:3, 3], 0, 0]
    units = np.r_[np.full(3, radius), np.ones(2)]
    C = np.zeros((6, 6))
    C[:5, :5] = P * np.outer(units, units) + radius_sd**2 * np.outer(by_radius, by_radius)
    C[:5, 5] = C[5, :5] = radius_sd**2 * by_radius
    C[5, 5] = radius_sd**2
    return CirclePose(SE3.from_parts(T[:3, :3], radius * T[:3, 3]), C, radius)


def _outer(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[:, :, None] * b[:, None])
