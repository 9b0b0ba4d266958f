"""Convert pose covariances between the conventions of different software.

A convention is an order of the rows, the axes in which the error is expressed, and the point about which its rotation
acts. Each is a linear, invertible map ``G(T)`` of tanteo's body error, so ``C_named = G C G'`` is exact:

==============  =======================  ==========================================================
name            ``G(T)``                 used by
==============  =======================  ==========================================================
``TANTEO``      identity                 tanteo: ``T exp(e)``, ``x y z rx ry rz``, axes of the part
``ROS``         ``diag(R, R)``           geometry_msgs/PoseWithCovariance, tf2, robot_localization
``GTSAM``       halves swapped           gtsam.Pose3: ``T Expmap(e)``, ``rx ry rz x y z``
``SPATIAL``     ``Ad(T)``                Barfoot, Sophus' left increment: ``exp(e) T``, axes of the world
==============  =======================  ==========================================================

ROS specifies only "fixed-axis representation ... rotation about X axis, rotation about Y axis, rotation about Z axis"
in the header's frame (REP 103; the message's comment). tf2 and robot_localization transform such a covariance to
another header frame with ``diag(R, R)`` on both sides. That is correct for a displacement of the origin and a small
rotation vector about axes through that origin, both along the header's axes: ``p' = p + dp``, ``R' = exp(dw) R``.
``ROS`` has this meaning here. Packages that store the covariance of roll, pitch and yaw instead (MRPT, some filters)
differ from it at large pitch; ``frames.location_covariance`` computes that one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from tanteo.errors import CovarianceError, InputError
from tanteo.geometry import se3 as SE3
from tanteo.geometry import so3 as SO3
from tanteo.geometry.covariances import check_covariances
from tanteo.geometry.propagation import congruence
from tanteo.geometry.typing import Adjoints, Covariances, FloatArray, Transforms
from tanteo.geometry.uncertain import UncertainFrame, check_transforms

TRANSLATION_FIRST: Final = "x y z rx ry rz"
ROTATION_FIRST: Final = "rx ry rz x y z"
_CHOICES = {
    "order": (TRANSLATION_FIRST, ROTATION_FIRST),
    "frame": ("part", "world"),
    "perturbation": ("right", "left"),
}


@dataclass(frozen=True, slots=True)
class CovarianceConvention:
    """Meaning of the rows of a pose covariance, for a pose ``T_world_part``.

    Attributes:
        order: order of the rows, ``x y z rx ry rz`` or ``rx ry rz x y z``.
        frame: axes in which the error is expressed, ``part`` (body) or ``world`` (spatial, parent, header).
        perturbation: point about which the rotation acts: ``right`` for the origin of the part, ``left`` for that of
            the world.

    Raises:
        InputError: a word is unknown; the message lists the choices.
    """

    order: Literal["x y z rx ry rz", "rx ry rz x y z"]
    frame: Literal["part", "world"]
    perturbation: Literal["right", "left"]

    def __post_init__(self) -> None:
        for field, choices in _CHOICES.items():
            if getattr(self, field) not in choices:
                raise InputError(f"{field}: expected one of {choices}, got {getattr(self, field)!r}.")


TANTEO = CovarianceConvention(TRANSLATION_FIRST, "part", "right")
ROS = CovarianceConvention(TRANSLATION_FIRST, "world", "right")
GTSAM = CovarianceConvention(ROTATION_FIRST, "part", "right")
SPATIAL = CovarianceConvention(TRANSLATION_FIRST, "world", "left")


@dataclass(frozen=True, slots=True, eq=False)
class NamedCovariance:
    """Pose covariance with its convention.

    Attributes:
        T: ``T_world_part`` ``(*batch, 4, 4)`` [m].
        covariance: covariance in the order, axes and perturbation of the convention ``(*batch, 6, 6)`` [m, rad].
        convention: meaning of the rows.

    Raises:
        InputError: ``T`` is not a rigid motion.
        CovarianceError: the covariance is invalid.
    """

    T: Transforms
    covariance: Covariances
    convention: CovarianceConvention

    def __post_init__(self) -> None:
        object.__setattr__(self, "T", check_transforms("T", self.T))
        object.__setattr__(self, "covariance", check_covariances("covariance", self.covariance, 6))


def convention_jacobian(T: Transforms, convention: CovarianceConvention) -> Adjoints:
    """Return ``G(T)`` ``(*batch, 6, 6)`` with ``e_named = G e``, where ``e`` is tanteo's body error.

    Args:
        T: ``T_world_part`` ``(*batch, 4, 4)`` [m].
        convention: meaning of the rows of ``e_named``.
    """
    T = np.asarray(T, dtype=np.float64)
    left = convention.perturbation == "left"
    world = convention.frame == "world"
    R = SE3.rotation(T)
    if left and world:
        G = SE3.adjoint(T)
    elif left:
        G = _turn(SO3.inverse(R)) @ SE3.adjoint(T)
    elif world:
        G = _turn(R)
    else:
        G = _turn(np.broadcast_to(np.eye(3), R.shape))
    return np.roll(G, 3, axis=-2) if convention.order == ROTATION_FIRST else G


def _turn(R: FloatArray) -> Adjoints:
    G = np.zeros((*R.shape[:-2], 6, 6))
    G[..., :3, :3] = G[..., 3:, 3:] = R
    return G


def _jacobian_inverse(T: Transforms, convention: CovarianceConvention) -> Adjoints:
    """Return ``G^-1`` in closed form: ``diag(R', R')`` and ``Ad(T^-1)`` avoid the rounding of a solver."""
    left = convention.perturbation == "left"
    world = convention.frame == "world"
    R = SE3.rotation(np.asarray(T, dtype=np.float64))
    if left:
        G = SE3.adjoint_inverse(T) if world else SE3.adjoint_inverse(T) @ _turn(R)
    else:
        G = _turn(SO3.inverse(R) if world else np.broadcast_to(np.eye(3), R.shape))
    return np.roll(G, 3, axis=-1) if convention.order == ROTATION_FIRST else G


def name_covariance(frame: UncertainFrame, convention: CovarianceConvention) -> NamedCovariance:
    """Return the covariance of a frame in another convention.

    Args:
        frame: frame with tanteo's body covariance.
        convention: convention of the result.
    """
    return NamedCovariance(frame.T, congruence(convention_jacobian(frame.T, convention), frame.C), convention)


def uncertain_frame(named: NamedCovariance) -> UncertainFrame:
    """Return a frame with tanteo's body covariance, the inverse of :func:`name_covariance`.

    Args:
        named: pose covariance with its convention.
    """
    return UncertainFrame(named.T, congruence(_jacobian_inverse(named.T, named.convention), named.covariance))


def convert_covariance(named: NamedCovariance, convention: CovarianceConvention) -> NamedCovariance:
    """Return a pose covariance in another convention.

    Args:
        named: pose covariance with its convention.
        convention: convention of the result.
    """
    return name_covariance(uncertain_frame(named), convention)


def as_ros_covariance(frame: UncertainFrame) -> FloatArray:
    """Return ``PoseWithCovariance.covariance`` of a frame, 36 numbers row by row ``(*batch, 36)``.

    Args:
        frame: frame with tanteo's body covariance; the message's pose is ``frame.T``.
    """
    C = name_covariance(frame, ROS).covariance
    return C.reshape(*C.shape[:-2], 36).copy()


def from_ros_covariance(T: Transforms, covariance: FloatArray) -> UncertainFrame:
    """Return the frame of a ``PoseWithCovariance``.

    Args:
        T: pose of the message ``(*batch, 4, 4)`` [m].
        covariance: 36 numbers of the message ``(*batch, 36)``.

    Raises:
        CovarianceError: there are not 36 numbers, or they do not form a covariance.
    """
    C = np.asarray(covariance, dtype=np.float64)
    if C.ndim == 0 or C.shape[-1] != 36:
        raise CovarianceError(f"covariance: expected 36 numbers (row by row), got shape {C.shape}.")
    return uncertain_frame(NamedCovariance(T, C.reshape(*C.shape[:-1], 6, 6), ROS))


def as_gtsam_covariance(frame: UncertainFrame) -> Covariances:
    """Return the covariance of a ``gtsam.Pose3`` ``(*batch, 6, 6)``: body error, rotation first.

    Args:
        frame: frame with tanteo's body covariance.
    """
    return name_covariance(frame, GTSAM).covariance


def from_gtsam_covariance(T: Transforms, covariance: Covariances) -> UncertainFrame:
    """Return the frame of a ``gtsam.Pose3`` with its marginal covariance.

    Args:
        T: pose ``(*batch, 4, 4)`` [m].
        covariance: marginal covariance ``(*batch, 6, 6)``.
    """
    return uncertain_frame(NamedCovariance(T, covariance, GTSAM))
