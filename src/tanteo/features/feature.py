"""Define the sensed feature, and the errors that several features share."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from tanteo.errors import InputError
from tanteo.features.kinds import FeatureKind
from tanteo.geometry import check_covariance, frozen_array
from tanteo.geometry.typing import Covariances, FloatArray, Transforms, Vectors


@dataclass(frozen=True, slots=True, eq=False)
class SharedError:
    """Error that many readings share in one draw, such as of the robot base, the tool tip or a sensor bias.

    Attributes:
        name: identity of the draw; terms with the same name share it.
        covariance: covariance of the draw ``(d, d)``, in the units that ``meaning`` states.
        meaning: description of the error.
        states: description of each component ``(d,)``; empty if there are none.
        one_sided: whether each component is an amount from none on, such as stock, instead of a normal variable.
    """

    name: str
    covariance: Covariances
    meaning: str = ""
    states: tuple[str, ...] = ()
    one_sided: bool = False

    def __post_init__(self) -> None:
        d = np.shape(self.covariance)[0]
        C = check_covariance(f"shared error {self.name!r}", self.covariance, d)
        object.__setattr__(self, "covariance", C)

    @property
    def title(self) -> str:
        """Return the meaning without units, or the name if there is no meaning."""
        return re.sub(r" \[[^\]]*\]", "", self.meaning) or self.name


@dataclass(frozen=True, slots=True, eq=False)
class SharedTerm:
    """Effect of a shared error on one feature: ``p += jacobian @ c``.

    Attributes:
        error: shared error ``c``.
        jacobian: derivative of the feature's perturbations ``(kind.size, d)``, ``math.md`` section 6.
    """

    error: SharedError
    jacobian: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Round:
    """Size of a round feature: a radius, or the half angle of a cone.

    Attributes:
        value: radius [m] or half angle [rad].
        variance: variance of its independent error; 0 if it was given.
        covariance: covariance of that error with the feature's perturbations ``(kind.size,)``; empty for zero.
        shared: derivatives by the feature's shared errors, each ``(1, d)``, in the order of ``Feature.shared``.
        convex: True for a boss, False for a bore, None if unknown.

    Raises:
        InputError: the value is not positive, or the variance is negative.
    """

    value: float
    variance: float = 0.0
    covariance: FloatArray = field(default_factory=lambda: np.zeros(0))
    shared: tuple[FloatArray, ...] = ()
    convex: bool | None = None

    def __post_init__(self) -> None:
        if not (np.isfinite(self.value) and self.value > 0):
            raise InputError(f"size of a round feature: expected a positive number, got {self.value}.")
        if not (np.isfinite(self.variance) and self.variance >= 0):
            raise InputError(f"variance of a size: expected zero or more, got {self.variance}.")
        object.__setattr__(self, "covariance", frozen_array(self.covariance))
        object.__setattr__(self, "shared", tuple(frozen_array(gain) for gain in self.shared))


@dataclass(frozen=True, slots=True, eq=False)
class Feature:
    """Sensed feature: ``T = T_world_feature exp(B' p)``, ``p ~ N(0, P + sum of shared terms)``.

    Attributes:
        kind: vertex, edge, plane, circle, cylinder, cone or sphere.
        T_world_feature: estimated frame ``(4, 4)`` [m].
        P: independent covariance over the kind's rows ``(size, size)`` [m, rad].
        label: name given by the readings.
        shared: effects of errors shared with other features.
        support: surface points from which it was sensed, world frame ``(n, 3)`` [m]; empty if unknown.
        readings: identifiers of those readings.
        tip_radius: radius of the ball that touched the feature [m]; its centre was one radius from the surface, so no
            other surface of the part is closer to it. 0 for a beam or a sharp tip.
        size: radius or half angle of a round feature; None for other kinds and if unknown.
        second_size: second size of a kind with two sizes, such as the tube radius of a torus; None if unknown.

    Raises:
        InputError: the frame is not a rigid motion, or the size does not fit the kind.
        CovarianceError: ``P``, or ``P`` with the size, is not a covariance.
    """

    kind: FeatureKind
    T_world_feature: Transforms
    P: Covariances
    label: str = ""
    shared: tuple[SharedTerm, ...] = ()
    support: Vectors = field(default_factory=lambda: np.zeros((0, 3)))
    readings: tuple[str, ...] = ()
    tip_radius: float = 0.0
    size: Round | None = None
    second_size: Round | None = None

    def __post_init__(self) -> None:
        name = f"feature {self.label!r}"
        T = frozen_array(self.T_world_feature)
        R = T[:3, :3] if T.shape == (4, 4) else np.zeros((3, 3))
        if not (np.all(np.isfinite(T)) and np.allclose(R.T @ R, np.eye(3), atol=1e-6) and np.linalg.det(R) > 0):
            raise InputError(f"{name}: expected a rigid motion (4 x 4, rotation of determinant +1), got {T.tolist()}.")
        object.__setattr__(self, "T_world_feature", T)
        object.__setattr__(self, "P", check_covariance(f"{name}, P", self.P, self.kind.size))
        object.__setattr__(self, "support", frozen_array(self.support).reshape(-1, 3))
        if self.size is not None:
            _check_size(name, self.kind, self.size, len(self.shared))
            check_covariance(f"{name}, P with its {self.kind.size_name}", self.full_covariance, self.kind.size + 1)

    @property
    def full_covariance(self) -> Covariances:
        """Covariance ``P``; for a round feature with its size as last row and column ``(size + 1, size + 1)``."""
        if self.size is None:
            return self.P
        C = np.zeros((self.kind.size + 1, self.kind.size + 1))
        n = self.kind.size
        C[:n, :n], C[n, n] = self.P, self.size.variance
        if len(self.size.covariance):
            C[:n, n] = C[n, :n] = self.size.covariance
        return C

    @property
    def radius(self) -> float | None:
        """Radius of a circle, cylinder or sphere [m]; None if unknown."""
        return self.size.value if self.size is not None and self.kind.size_name == "radius" else None

    @property
    def half_angle(self) -> float | None:
        """Half angle of a cone [rad]; None if unknown."""
        return self.size.value if self.size is not None and self.kind.size_name == "half angle" else None

    @property
    def convex(self) -> bool | None:
        """True for a boss, False for a bore, None if unknown or meaningless."""
        return None if self.size is None else self.size.convex


def _check_size(name: str, kind: FeatureKind, size: Round, terms: int) -> None:
    """Check that the kind has a size, and that its covariance and shared terms match those of the feature."""
    if not kind.size_name:
        raise InputError(f"{name}: expected no size, for a {kind.name} has none, got {size.value}. Leave it out.")
    if kind.size_name == "half angle" and not size.value < np.pi / 2:
        raise InputError(f"{name}: expected a half angle below pi/2 rad, got {size.value}. Is it in degrees?")
    if len(size.covariance) not in (0, kind.size):
        raise InputError(
            f"{name}: expected a covariance of size {kind.size} with its size, got {len(size.covariance)}."
        )
    if len(size.shared) not in (0, terms):
        raise InputError(f"{name}: expected {terms} gains of shared errors on its size, got {len(size.shared)}.")


Sides: TypeAlias = Feature | tuple[Feature, Feature]
"""Feature; a plane with unknown outward side is a pair, one feature for each side."""


def feature_covariance(feature: Feature) -> Covariances:
    """Return the total body covariance ``(6, 6)`` with shared errors; rows of free directions are zero.

    Args:
        feature: sensed feature.
    """
    B = feature.kind.B
    P = feature.P + sum(
        (term.jacobian @ term.error.covariance @ term.jacobian.T for term in feature.shared),
        start=np.zeros_like(feature.P),
    )
    return B.T @ P @ B


def cross_covariance(first: Feature, second: Feature) -> FloatArray:
    """Return ``E[e1 e2']`` ``(6, 6)``, which two features have through shared errors.

    Args:
        first: first feature.
        second: second feature.
    """
    C = np.zeros((first.kind.size, second.kind.size))
    for a in first.shared:
        for b in second.shared:
            if a.error.name == b.error.name:
                C += a.jacobian @ a.error.covariance @ b.jacobian.T
    return first.kind.B.T @ C @ second.kind.B


def collect_shared(features: Sequence[Feature]) -> tuple[tuple[SharedError, ...], Covariances, tuple[FloatArray, ...]]:
    """Return all shared errors of some features as one vector ``c``.

    Args:
        features: sensed features.

    Returns:
        Errors in the order of first appearance, block-diagonal covariance of ``c`` ``(D, D)``, and the derivative of
        each
        feature's perturbations by ``c`` ``(size, D)``.
    """
    errors: dict[str, SharedError] = {}
    for feature in features:
        for term in feature.shared:
            errors.setdefault(term.error.name, term.error)
    start = {}
    D = 0
    for name, error in errors.items():
        start[name] = D
        D = D + len(error.covariance)
    C = np.zeros((D, D))
    for name, error in errors.items():
        block = slice(start[name], start[name] + len(error.covariance))
        C[block, block] = error.covariance
    shared_jacobian = []
    for feature in features:
        A = np.zeros((feature.kind.size, D))
        for term in feature.shared:
            A[:, start[term.error.name] : start[term.error.name] + term.jacobian.shape[1]] += term.jacobian
        shared_jacobian.append(A)
    return tuple(errors.values()), C, tuple(shared_jacobian)


def stacked_covariance(errors: Sequence[SharedError]) -> Covariances:
    """Return the block-diagonal covariance of independent shared errors as one vector ``c`` ``(D, D)``.

    Args:
        errors: shared errors.
    """
    D = sum(len(error.covariance) for error in errors)
    C = np.zeros((D, D))
    start = 0
    for error in errors:
        stop = start + len(error.covariance)
        C[start:stop, start:stop] = error.covariance
        start = stop
    return C


def shared_root(errors: Sequence[SharedError]) -> FloatArray:
    """Return the symmetric root of the stacked covariance ``(D, D)``: ``c = root z`` with standard normal ``z``.

    The symmetric root is block diagonal, so the parts of ``z`` correspond to the errors in their order.

    Args:
        errors: shared errors.
    """
    C = stacked_covariance(errors)
    values, vectors = np.linalg.eigh(C) if len(C) else (np.zeros(0), C)
    return np.asarray((vectors * np.sqrt(values.clip(0))) @ vectors.T)
