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
class Feature:
    """A sensed feature: ``T = T_world_feature exp(B' p)``, ``p ~ N(0, P + sum of shared terms)``.

    Attributes:
        kind: vertex, edge or plane (or a curved kind).
        T_world_feature: the estimated frame ``(4, 4)``.
        P: independent covariance over the kind's rows ``(size, size)`` [m, rad].
        label: the name that the readings gave it.
        shared: errors that it has in common with other features.
        support: surface points from which it was sensed, in the world ``(n, 3)`` [m]; none if unknown.
        readings: ids of those readings.
        tip_radius: of the ball that touched there [m]: its centre was one radius off the surface, so nothing else of
            the part is nearer to the centre than that; 0 for a beam or a point.

    Raises:
        InputError: if the frame is not a rigid motion.
        CovarianceError: if ``P`` is not a covariance.
    """

    kind: FeatureKind
    T_world_feature: Transforms
    P: Covariances
    label: str = ""
    shared: tuple[SharedTerm, ...] = ()
    support: Vectors = field(default_factory=lambda: np.zeros((0, 3)))
    readings: tuple[str, ...] = ()
    tip_radius: float = 0.0

    def __post_init__(self) -> None:
        name = f"feature {self.label!r}"
        T = frozen_array(self.T_world_feature)
        R = T[:3, :3] if T.shape == (4, 4) else np.zeros((3, 3))
        if not (np.all(np.isfinite(T)) and np.allclose(R.T @ R, np.eye(3), atol=1e-6) and np.linalg.det(R) > 0):
            raise InputError(f"{name}: expected a rigid motion (4 x 4, rotation of determinant +1), got {T.tolist()}.")
        object.__setattr__(self, "T_world_feature", T)
        object.__setattr__(self, "P", check_covariance(f"{name}, P", self.P, self.kind.size))
        object.__setattr__(self, "support", frozen_array(self.support).reshape(-1, 3))


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
