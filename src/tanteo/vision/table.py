"""The table: its errors, and the pose of the camera from marks whose positions on it are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import DegenerateError, InputError
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import Covariances, FloatArray, Transforms, Vectors
from tanteo.vision.camera import Camera, opencv, project, project_linearized, rays
from tanteo.vision.settings import SEARCH


@dataclass(frozen=True, slots=True)
class TableErrors:
    """Errors of the height and tilt of parts on the table.

    Attributes:
        height: standard deviation of the height of a part [m].
        tilt: standard deviation of the tilt of a part about each direction of the table [rad].
    """

    height: float = 2e-4
    tilt: float = 2e-3

    def __post_init__(self) -> None:
        if not (self.height > 0 and self.tilt > 0):
            raise InputError(f"table: expected deviations above zero, got {self.height} m and {self.tilt} rad.")


def lying_information(T_table_part: Transforms, centre: Vectors, errors: TableErrors) -> FloatArray:
    """Return the information on ``Log(T_lying^-1 T)`` of a part on the table ``(*batch, 6, 6)``.

    The height is that of the ``centre`` of the part. Yaw and position on the table are free.
    """
    up, first, second = (T_table_part[..., k, :3] for k in (2, 0, 1))
    zero = np.zeros_like(up)
    rows = np.stack(
        [
            np.concatenate([up, np.cross(centre, up)], axis=-1) / errors.height,
            np.concatenate([zero, first], axis=-1) / errors.tilt,
            np.concatenate([zero, second], axis=-1) / errors.tilt,
        ],
        axis=-2,
    )
    return np.asarray(np.swapaxes(rows, -1, -2) @ rows)


def seen_table(errors: TableErrors, camera: Camera, T_world_table: Transforms) -> TableErrors:
    """Return the errors of the table in the frame of the camera, with those of the camera's pose."""
    covariance = camera.pose_covariance
    if covariance is None or camera.T_world_camera is None:
        return errors
    T = SE3.inverse(T_world_table) @ camera.T_world_camera
    # the effect of the camera's error on the table about the point on the optical axis
    middle = np.array([0.0, 0.0, abs(T[2, 3] / min(T[2, 2], -0.1))])
    up, first, second = T[2, :3], T[0, :3], T[1, :3]
    height = np.concatenate([up, np.cross(middle, up)])
    tilts = np.concatenate([np.zeros((2, 3)), np.stack([first, second])], axis=1)
    tilt = float(np.trace(tilts @ covariance @ tilts.T)) / 2
    return TableErrors(
        float(np.sqrt(errors.height**2 + height @ covariance @ height)), float(np.sqrt(errors.tilt**2 + tilt))
    )


@dataclass(frozen=True, slots=True, eq=False)
class CameraPose:
    """The pose of a camera from known points.

    Attributes:
        T_world_camera: pose of the camera ``(4, 4)``.
        covariance: covariance of the pose ``(6, 6)``, camera frame, right [m, rad].
        offs: distances of the points from their pixels ``(n,)`` [px].
    """

    T_world_camera: Transforms
    covariance: Covariances
    offs: FloatArray

    @property
    def rms(self) -> float:
        """Root mean square of the distances [px]."""
        return float(np.sqrt(np.mean(self.offs**2)))


def fit_camera(camera: Camera, pixels: FloatArray, points: Vectors, sd: float = 0.5) -> CameraPose:
    """Fit the pose of the camera to points whose pixels are known.

    Args:
        camera: camera with its lens; its pose is not used.
        pixels: pixels of the points ``(n, 2)`` [px].
        points: four or more points in the world, not on a line ``(n, 3)`` [m].
        sd: prior standard deviation of a pixel, which counts like the residuals of one mark [px].

    Raises:
        InputError: too few points, or points that contradict each other.
        DegenerateError: points on a line, or none that a camera in front of them could see so.
        MissingExtraError: without OpenCV.
    """
    pixels, points = np.asarray(pixels, dtype=np.float64), np.asarray(points, dtype=np.float64)
    apart = len(np.unique(points, axis=0)) if points.ndim == 2 else 0
    if apart < 4 or pixels.shape != (len(points), 2) or points.shape[1:] != (3,):
        raise InputError(
            f"points: expected four or more different points with pixels, got {apart} and {len(pixels)}. Mark more."
        )
    centred = points - points.mean(axis=0)
    spread = np.linalg.svd(centred, compute_uv=False)
    if spread[1] < 1e-6 * max(spread[0], 1e-12):
        raise DegenerateError("points: expected points that span the table, got a line. Mark a point beside it.")
    best: tuple[float, Transforms, FloatArray] | None = None
    for T in _starts(rays(camera, pixels), points):
        T, information, chi2 = _improve(camera, pixels, points, T)
        if np.isfinite(chi2) and (best is None or chi2 < best[0]):
            best = chi2, T, information
    if best is None:
        raise DegenerateError("points: expected points in front of the camera, got none. Check their order.")
    chi2, T, information = best
    offs = np.linalg.norm(pixels - project(camera, SE3.apply(T, points)), axis=1)
    if chi2 > len(points) * (SEARCH.contradict * camera.size[0]) ** 2:
        far = int(np.argmax(offs))
        raise InputError(
            f"points: expected points that agree, got {np.sqrt(chi2 / len(points)):.1f} px rms; farthest off is number "
            f"{far + 1}, by {offs[far]:.0f} px. Check it, the order of the others, and the camera."
        )
    dof = 2 * len(points) - 6
    stated = pixels.shape[1]  # residuals that the stated deviation counts for: those of one mark
    covariance = np.linalg.inv(information) * (stated * sd**2 + chi2) / (stated + dof)
    # the errors are those of T_camera_world, right, in the world; those of the inverse are minus these, in the camera
    Ad = SE3.adjoint(T)
    return CameraPose(SE3.inverse(T), Ad @ covariance @ Ad.T, offs)


def _starts(directions: Vectors, points: Vectors) -> list[Transforms]:
    """Return pose proposals ``T_camera_world`` (Terzakis and Lourakis 2020, by OpenCV), and mirrored ones."""
    cv2 = opencv()
    found = cv2.solvePnPGeneric(points, directions[:, :2].copy(), np.eye(3), None, flags=cv2.SOLVEPNP_SQPNP)
    out = [SE3.from_parts(SO3.exp(w.ravel()), t.ravel()) for w, t in zip(found[1], found[2], strict=True)]
    normal = np.linalg.svd(points - points.mean(axis=0))[2][2]
    for T in list(out):
        # the mirrored pose of a plane fits about as well under weak perspective
        middle = SE3.apply(T, points.mean(axis=0))
        way, across = middle / np.linalg.norm(middle), T[:3, :3] @ normal
        turn = SO3.exp(2 * np.cross(across, way * np.sign(across @ way)))
        out.append(SE3.from_parts(turn, middle - turn @ middle) @ T)
    return out


def _improve(
    camera: Camera, pixels: FloatArray, points: Vectors, T: Transforms
) -> tuple[Transforms, FloatArray, float]:
    """Return the pose that fits the pixels best, the information for unit deviation, and the sum of squares.

    The unknowns are a motion ``x`` of the start, ``T exp(x)``.
    """
    from scipy.optimize import least_squares  # slow to import

    def residuals(x: FloatArray) -> FloatArray:
        return (project(camera, SE3.apply(T @ SE3.exp(x), points)) - pixels).ravel()

    def jacobian(x: FloatArray) -> FloatArray:
        here = T @ SE3.exp(x)
        JR = project_linearized(camera, SE3.apply(here, points))[1] @ here[:3, :3]
        J = np.concatenate([JR, np.cross(points[:, None], JR)], axis=-1).reshape(-1, 6)
        return np.asarray(J @ SE3.right_jacobian(x))

    if not np.all(np.isfinite(residuals(np.zeros(6)))):
        return T, np.eye(6), np.inf
    found = least_squares(residuals, np.zeros(6), jacobian, x_scale="jac", ftol=1e-15, xtol=1e-12, gtol=None)
    J = found.jac @ SE3.right_jacobian_inverse(found.x)
    return T @ SE3.exp(found.x), J.T @ J, float(2 * found.cost)
