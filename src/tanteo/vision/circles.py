"""A circle behind an ellipse: two of them, each with centre, axis and covariance.

The camera's centre and the ellipse span a cone. Planes of two directions cut circles out of it (Young and others 1992,
Kanatani and Liu 1993); the radius says where along the cone. The covariance is that of the ellipse carried through the
inverse of the projection, whose derivative is exact (``math.md`` section 8).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.errors import DegenerateError, InputError
from tanteo.lie import SE3, SO3
from tanteo.typing import Covariances, FloatArray, Transforms
from tanteo.vision.camera import Camera
from tanteo.vision.ellipse_fit import Ellipse

HEAD_ON = 3.0
"""A tilt against the line of sight that is known worse than to a third of itself is not known from an ellipse."""

BENT = 2.0
"""A circle is refused where the map from the ellipse is bent by more than so many standard deviations, over one: of
second order its covariance is right so far."""


@dataclass(frozen=True, slots=True, eq=False)
class CirclePose:
    """One of the two circles that look like an ellipse.

    Attributes:
        T_camera_circle: origin at the centre, z along the axis, towards the camera ``(4, 4)`` [m].
        covariance: of ``x, y, z, rx, ry`` and the radius ``(6, 6)`` [m, rad].
        radius: [m].
    """

    T_camera_circle: Transforms
    covariance: Covariances
    radius: float


def circle_poses(
    camera: Camera, ellipse: Ellipse, radius: float, radius_sd: float = 0.0
) -> tuple[CirclePose, CirclePose]:
    """The two circles of a radius that an ellipse may be.

    Args:
        camera: that took the image.
        ellipse: of :func:`tanteo.vision.find_ellipses`.
        radius: of the circle [m].
        radius_sd: its standard deviation [m].

    Raises:
        InputError: a radius that is none.
        DegenerateError: the circle is seen so nearly along its axis that its tilt is not known.

    Example:
        >>> camera = tanteo.read_camera("images/camera.yaml")
        >>> aslant = tanteo.lie.SE3.exp(np.array([0, 0, 0.3, 2.5, 0, 0]))
        >>> ellipse = tanteo.vision.project_circle(camera, aslant, 5e-3)
        >>> first, second = tanteo.vision.circle_poses(camera, ellipse, 5e-3)
        >>> len({tuple(np.round(pose.T_camera_circle[:3, 2], 3)) for pose in (first, second)})  # two axes
        2
    """
    if not (np.isfinite(radius) and radius > 0 and np.isfinite(radius_sd) and radius_sd >= 0):
        raise InputError(f"radius: expected a positive radius and its deviation [m], got {radius} and {radius_sd}.")
    first, second = (_posed(camera, ellipse, T, radius, radius_sd) for T in circle_frames(camera, ellipse, radius))
    return first, second


def circle_frames(camera: Camera, ellipse: Ellipse, radius: float) -> Transforms:
    """Frames of the two circles of a radius that an ellipse may be, without covariance ``(2, 4, 4)``, camera frame [m].

    The two are about one where a circle is seen along its axis.
    """
    D = _dual(camera, ellipse)
    values, axes = np.linalg.eigh(np.linalg.inv(D))
    Q, values, axes = (
        (np.linalg.inv(D), values, axes) if values[1] > 0 else (-np.linalg.inv(D), -values[::-1], axes[:, ::-1])
    )
    low, middle, high = values  # low < 0 < middle <= high
    along, across = np.sqrt(max(high - middle, 0.0) / (high - low)), np.sqrt((middle - low) / (high - low))
    out = []
    for sign in (1.0, -1.0):
        n = sign * along * axes[:, 2] + across * axes[:, 0]
        pole = np.linalg.solve(Q, n)
        c = pole * np.sqrt(-middle / (pole @ n)) * radius
        c = c if c[2] > 0 else -c
        out.append(SE3.from_parts(SO3.frame_from_axis(n if n @ c < 0 else -n, 2), c))
    return np.stack(out)


def project_circle(camera: Camera, T_camera_circle: Transforms, radius: float) -> Ellipse:
    """The ellipse of a circle, in pixels without distortion, without error.

    Args:
        camera: that looks at it.
        T_camera_circle: origin at its centre, z along its axis ``(4, 4)`` [m].
        radius: [m].

    Raises:
        DegenerateError: a part of the circle is not in front of the camera, or it is seen from the side.

    Example:
        >>> camera = tanteo.read_camera("images/camera.yaml")
        >>> ahead = tanteo.lie.SE3.from_parts(np.eye(3), np.array([0, 0, 0.5]))
        >>> ellipse = tanteo.vision.project_circle(camera, ahead, 5e-3)
        >>> np.allclose(ellipse.semi_axes, 5e-3 / 0.5 * camera.focal[::-1])
        True
    """
    D = _dual_of(camera, T_camera_circle, radius)
    if T_camera_circle[2, 3] <= radius * np.hypot(*T_camera_circle[2, :2]) or D[2, 2] >= 0:
        raise DegenerateError("circle: expected all of it in front of the camera, got one that is not. Move it away.")
    m, S = D[:2, 2] / D[2, 2], np.outer(D[:2, 2], D[:2, 2]) / D[2, 2] ** 2 - D[:2, :2] / D[2, 2]
    values, axes = np.linalg.eigh(S)
    if values[0] < 1e-9 * values[1]:
        raise DegenerateError("circle: expected one that looks like an ellipse, got one seen from the side. Turn it.")
    return Ellipse(m, (axes * np.sqrt(values)) @ axes.T, np.zeros((5, 5)), 0.0, 1.0, 2 * np.pi, 0)


def _dual(camera: Camera, ellipse: Ellipse) -> FloatArray:
    """The dual conic in rays: lines ``l`` with ``l D l = 0`` touch the ellipse; ``D[2, 2] = -1``."""
    A = np.diag(1 / camera.focal)
    m, S = A @ (ellipse.centre - camera.centre), A @ ellipse.shape @ ellipse.shape @ A
    D = np.empty((3, 3))
    D[:2, :2], D[:2, 2], D[2, :2], D[2, 2] = S - np.outer(m, m), -m, -m, -1.0
    return D


_UNIT = np.diag([1.0, 1.0, -1.0])


def _homography(camera: Camera, T: Transforms, radius: float) -> FloatArray:
    """From the unit circle to the image."""
    return np.asarray(camera.K @ np.column_stack([radius * T[:3, 0], radius * T[:3, 1], T[:3, 3]]))


def _dual_of(camera: Camera, T: Transforms, radius: float) -> FloatArray:
    H = _homography(camera, T, radius)
    return np.asarray(H @ _UNIT @ H.T)


def _posed(camera: Camera, ellipse: Ellipse, T: Transforms, radius: float, radius_sd: float) -> CirclePose:
    G = _projection_derivatives(camera, T, radius)
    # lengths in radii, so that the matrix says how well the tilt is seen
    scale = np.array([radius, radius, radius, 1.0, 1.0])
    try:
        inverse = scale[:, None] * np.linalg.inv(G[:, :5] * scale)
    except np.linalg.LinAlgError:
        raise _head_on(np.inf, 0.0) from None
    by_radius = -inverse @ G[:, 5]
    C = np.zeros((6, 6))
    flat, bends = inverse @ ellipse.covariance @ inverse.T, _bends(camera, ellipse, T, radius)
    if np.any(ellipse.covariance):
        _refuse_bent(flat, bends)
    total = bends.sum(axis=0)
    C[:5, :5] = flat + 2 * bends.T @ bends + np.outer(total, total)
    C[:5, :5] += radius_sd**2 * np.outer(by_radius, by_radius)
    C[:5, 5] = C[5, :5] = radius_sd**2 * by_radius
    C[5, 5] = radius_sd**2
    ray = T[:3, 3] / np.linalg.norm(T[:3, 3])
    tilt = float(np.arccos(np.clip(-ray @ T[:3, 2], -1.0, 1.0)))
    sd = float(np.sqrt(np.linalg.eigvalsh(C[3:5, 3:5])[1]))
    if not sd * HEAD_ON < tilt:
        raise _head_on(sd, tilt)
    return CirclePose(T, C, radius)


def _bends(camera: Camera, ellipse: Ellipse, T: Transforms, radius: float) -> FloatArray:
    """By how much the map from ellipse to circle is bent: rows of ``x, y, z, rx, ry`` ``(5, 5)``.

    Each is half a second difference over one standard deviation along an axis of the ellipse's covariance. Of a short
    arc some of the five numbers are known a hundred times better than others: along the loose ones the map may be bent
    by more than the width of the narrow ones.
    """
    values, vectors = np.linalg.eigh(ellipse.covariance)
    out = np.zeros((5, 5))
    for k, step in enumerate((vectors * np.sqrt(np.maximum(values, 0.0))).T):
        ahead, back = (_moved(camera, ellipse, T, radius, sign * step) for sign in (1.0, -1.0))
        out[k] = 0.5 * (ahead + back)
    return out


def _refuse_bent(flat: Covariances, bends: FloatArray) -> None:
    """Refuse a circle whose errors are far from normal.

    Raises:
        DegenerateError: the map is bent by more than :data:`BENT` standard deviations.
    """
    scale = np.sqrt(np.maximum(np.diagonal(flat), 1e-300))
    values, axes = np.linalg.eigh(flat / np.outer(scale, scale))
    bent = np.linalg.norm((bends / scale) @ (axes / np.sqrt(np.maximum(values, 1e-12))), axis=1).max()
    if not bent < BENT:
        raise DegenerateError(
            f"circle: expected an ellipse that is known well enough, got one by which centre and axis are bent by "
            f"{bent:.1f} standard deviations ({BENT:.1f} is allowed). Show more of the rim, or closer."
        )


def _moved(camera: Camera, ellipse: Ellipse, T: Transforms, radius: float, step: FloatArray) -> FloatArray:
    """How the circle moves, in its own frame, if the ellipse's five numbers move ``(5,)`` [m, rad]."""
    x = ellipse.numbers + step
    other = replace(ellipse, centre=x[:2], shape=np.array([[x[2], x[4]], [x[4], x[3]]]))
    found = circle_frames(camera, other, radius)
    near = found[np.argmax(found[:, :3, 2] @ T[:3, 2])]
    M = T[:3, :3].T @ near[:3, :3]
    back = np.arctan2(M[0, 1] - M[1, 0], M[0, 0] + M[1, 1])  # a circle may turn about its axis
    turned = near @ SE3.from_parts(SO3.axis_rotation(2, back), np.zeros(3))
    return np.asarray(SE3.log(SE3.inverse(T) @ turned)[:5])


def _head_on(sd: float, tilt: float) -> DegenerateError:
    return DegenerateError(
        f"circle: expected one that is seen aslant, got one tilted by {np.degrees(tilt):.1f} degrees (sd "
        f"{np.degrees(min(sd, np.pi)):.0f}) against the line of sight: its axis cannot be told. Look from aside."
    )


def _projection_derivatives(camera: Camera, T: Transforms, radius: float) -> FloatArray:
    """Of the ellipse's five numbers by ``x, y, z, rx, ry`` and the radius ``(5, 6)``."""
    R, H = T[:3, :3], _homography(camera, T, radius)
    zero = np.zeros(3)
    # columns of the homography: r x, r y, c; a turn about x takes y to z, one about y takes x to -z
    moved = [np.column_stack([zero, zero, R[:, k]]) for k in range(3)]
    moved += [np.column_stack([zero, radius * R[:, 2], zero]), np.column_stack([-radius * R[:, 2], zero, zero])]
    moved += [np.column_stack([R[:, 0], R[:, 1], zero])]
    D = H @ _UNIT @ H.T
    m = D[:2, 2] / D[2, 2]
    P = _root(np.outer(m, m) - D[:2, :2] / D[2, 2])
    # P dP + dP P = dS for the three numbers of a symmetric matrix
    sylvester = np.array(
        [[2 * P[0, 0], 0, 2 * P[0, 1]], [0, 2 * P[1, 1], 2 * P[0, 1]], [P[0, 1], P[0, 1], P[0, 0] + P[1, 1]]]
    )
    out = np.empty((5, 6))
    for k, change in enumerate(moved):
        half = camera.K @ change @ _UNIT @ H.T
        dD = half + half.T
        dm = dD[:2, 2] / D[2, 2] - m * dD[2, 2] / D[2, 2]
        dS = np.outer(dm, m) + np.outer(m, dm) - dD[:2, :2] / D[2, 2] + D[:2, :2] * dD[2, 2] / D[2, 2] ** 2
        out[:2, k] = dm
        out[2:, k] = np.linalg.solve(sylvester, np.array([dS[0, 0], dS[1, 1], dS[0, 1]]))
    return out


def _root(S: FloatArray) -> FloatArray:
    values, axes = np.linalg.eigh(S)
    return np.asarray((axes * np.sqrt(np.maximum(values, 0.0))) @ axes.T)
