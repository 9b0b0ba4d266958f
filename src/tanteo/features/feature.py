"""The sensed feature and the errors that several features share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from tanteo.errors import InputError
from tanteo.features.kinds import FeatureKind
from tanteo.frames import check_covariance, frozen_array
from tanteo.typing import Covariances, FloatArray, Transforms, Vectors


@dataclass(frozen=True, slots=True, eq=False)
class SharedError:
    """One draw of an error that many readings share: robot base, tool tip, sensor bias.

    Attributes:
        name: identity; two terms with one name are the same draw.
        covariance: ``(d, d)`` of the draw, in the units that ``meaning`` states.
        meaning: what it is, in words.
    """

    name: str
    covariance: Covariances
    meaning: str = ""

    def __post_init__(self) -> None:
        d = np.shape(self.covariance)[0]
        C = check_covariance(f"shared error {self.name!r}", self.covariance, d)
        object.__setattr__(self, "covariance", C)


@dataclass(frozen=True, slots=True, eq=False)
class SharedTerm:
    """How a shared error moves one feature: ``p += gain @ c``.

    Attributes:
        error: the shared draw ``c``.
        jacobian: ``A`` ``(kind.size, d)``, ``math.md`` section 6.
    """

    error: SharedError
    jacobian: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Round:
    """The one number of a round feature, beside its frame: a radius, or the half angle of a cone.

    Attributes:
        value: radius [m] or half angle [rad].
        variance: of its independent error; 0 if it was given.
        covariance: of that error with the feature's perturbations ``(kind.size,)``; none means zero.
        shared: what the feature's shared errors do to it: ``(1, d)`` each, in the order of ``Feature.shared``.
        convex: True for a boss, False for a bore, None where no reading told on which side the material is.

    Raises:
        InputError: if the value is not positive, or the variance negative.
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
    """A sensed feature: ``T = T_world_feature exp(B' p)``, ``p ~ N(0, P + sum of shared terms)``.

    Attributes:
        kind: vertex, edge, plane, circle, cylinder, cone or sphere.
        T_world_feature: the estimated frame ``(4, 4)``.
        P: independent covariance over the kind's rows ``(size, size)`` [m, rad].
        label: the name that the readings gave it.
        shared: errors that it has in common with other features.
        support: surface points from which it was sensed, in the world ``(n, 3)`` [m]; none if unknown.
        readings: ids of those readings.
        tip_radius: of the ball that touched there [m]: its centre was one radius off the surface, so nothing else of
            the part is nearer to the centre than that; 0 for a beam or a point.
        size: radius or half angle of a round feature; None for others, and where nothing is known of it.
        second_size: a second size of a kind that has two, such as the radius of a torus's tube; None where unknown.

    Raises:
        InputError: if the frame is not a rigid motion, or a size is of no round kind or of wrong shape.
        CovarianceError: if ``P``, or ``P`` with the size, is not a covariance.
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
        """``P``; of a round feature with its size as the last row and column ``(size + 1, size + 1)``."""
        if self.size is None:
            return self.P
        C, n = np.zeros((self.kind.size + 1, self.kind.size + 1)), self.kind.size
        C[:n, :n], C[n, n] = self.P, self.size.variance
        if len(self.size.covariance):
            C[:n, n] = C[n, :n] = self.size.covariance
        return C

    @property
    def radius(self) -> float | None:
        """Radius [m] of a circle, cylinder or sphere, if it is known."""
        return self.size.value if self.size is not None and self.kind.size_name == "radius" else None

    @property
    def half_angle(self) -> float | None:
        """Half angle [rad] of a cone, if it is known."""
        return self.size.value if self.size is not None and self.kind.size_name == "half angle" else None

    @property
    def convex(self) -> bool | None:
        """True for a boss, False for a bore, None where it is not known or has no meaning."""
        return None if self.size is None else self.size.convex


def _check_size(name: str, kind: FeatureKind, size: Round, terms: int) -> None:
    """Refuse the size of a kind that has none, or rows that do not match those of the feature."""
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
"""A feature; a plane whose outward side is unknown is a pair, once with either."""


def feature_covariance(feature: Feature) -> Covariances:
    """Total ``6 x 6`` body covariance in the world, shared errors included; rows of free directions are zero."""
    B = feature.kind.B
    P = feature.P + sum(
        (term.jacobian @ term.error.covariance @ term.jacobian.T for term in feature.shared),
        start=np.zeros_like(feature.P),
    )
    return B.T @ P @ B


def cross_covariance(first: Feature, second: Feature) -> FloatArray:
    """``E[e1 e2']`` ``(6, 6)`` that two features owe to the errors they share."""
    C = np.zeros((first.kind.size, second.kind.size))
    for a in first.shared:
        for b in second.shared:
            if a.error.name == b.error.name:
                C += a.jacobian @ a.error.covariance @ b.jacobian.T
    return first.kind.B.T @ C @ second.kind.B


def collect_shared(features: Sequence[Feature]) -> tuple[tuple[SharedError, ...], Covariances, tuple[FloatArray, ...]]:
    """All shared errors of some features as one vector ``c``.

    Returns:
        The errors in order of first appearance, the block-diagonal covariance of ``c`` ``(D, D)``, and each
        feature's gain on the whole of ``c`` ``(size, D)``.
    """
    errors: dict[str, SharedError] = {}
    for feature in features:
        for term in feature.shared:
            errors.setdefault(term.error.name, term.error)
    start, D = {}, 0
    for name, error in errors.items():
        start[name], D = D, D + len(error.covariance)
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
    """Of all these shared errors as one vector ``c``, which know nothing of each other ``(D, D)``."""
    D = sum(len(error.covariance) for error in errors)
    C, start = np.zeros((D, D)), 0
    for error in errors:
        stop = start + len(error.covariance)
        C[start:stop, start:stop], start = error.covariance, stop
    return C


def shared_root(errors: Sequence[SharedError]) -> FloatArray:
    """What makes shared errors of whitened ones, ``c = root z`` with ``z`` unit normal ``(D, D)``.

    Symmetric, so that it mixes no error with another: the parts of ``z`` are those of the errors, in their order.
    """
    C = stacked_covariance(errors)
    values, vectors = np.linalg.eigh(C) if len(C) else (np.zeros(0), C)
    return np.asarray((vectors * np.sqrt(values.clip(0))) @ vectors.T)
