"""Round features from a measuring machine's report or a drawing, and sizes that become known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from tanteo.errors import InputError
from tanteo.features import Feature, Round, SharedTerm
from tanteo.features.kinds import FeatureKind
from tanteo.geometry import SE3, SO3, check_covariance
from tanteo.geometry.typing import FloatArray, Vectors

_UNKNOWN_AXIS = float(np.pi)
"""Standard deviation of an axis that was not given [rad]: no information."""


def given_round(
    kind: FeatureKind,
    centre: Vectors,
    sd: npt.ArrayLike,
    *,
    axis: Vectors | None = None,
    axis_sd: float | None = None,
    size: float | None = None,
    size_sd: float = 0.0,
    convex: bool | None = None,
    label: str = "",
    readings: Sequence[str] = (),
) -> Feature:
    """Return a circle, cylinder, cone or sphere from its stated centre, axis and size.

    Args:
        kind: kind of the feature.
        centre: ``(3,)`` in the world [m]: centre, apex of a cone, any point of a cylinder's axis.
        sd: standard deviation of the centre [m]: one number, three along x, y and z of the world, or a covariance ``(3,
            3)`` [m^2].
        axis: axis ``(3,)``, of any length: out of the material for a circle, into a cone. A circle without it is a
            centre without information on the axis.
        axis_sd: standard deviation of each tilt [rad]; needed with an axis.
        size: radius [m] or half angle [rad], if it is known.
        size_sd: its standard deviation.
        convex: True for a boss, False for a bore.
        label: name of the feature.
        readings: ids of the readings behind it.

    Raises:
        InputError: for an axis without spread or length, a cylinder or cone without axis, numbers that are not finite;
            ``CovarianceError`` if ``sd`` is none.

    Example:
        >>> hole = tanteo.fitting.given_round(
        ...     tanteo.features.kinds.CIRCLE, [0.1, 0, 0], 1e-5, axis=[0, 0, 2], axis_sd=1e-3, size=3e-3, label="A"
        ... )
        >>> hole.radius, hole.convex is None
        (0.003, True)
    """
    name = f"{kind.name} {label!r}"
    if not kind.size_name:
        raise InputError(f"{name}: expected a circle, cylinder, cone or sphere, got a {kind.name}.")
    c = np.asarray(centre, dtype=np.float64)
    if c.shape != (3,) or not np.isfinite(c).all():
        raise InputError(f"{name}, centre: expected three finite numbers [m], got {centre!r}.")
    R, tilt = _frame(kind, axis, axis_sd, name)
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = R.T @ _covariance(sd, name) @ R
    covariance[3:, 3:] = tilt**2 * np.eye(3)
    P = covariance[np.ix_(kind.rows, kind.rows)]
    known = None if size is None else Round(float(size), float(size_sd) ** 2, convex=convex)
    return Feature(kind, SE3.from_parts(R, c), P, label, support=c[None], readings=tuple(readings), size=known)


def _frame(kind: FeatureKind, axis: Vectors | None, axis_sd: float | None, name: str) -> tuple[FloatArray, float]:
    """Return a rotation with z along the axis, and its covariance."""
    if axis is None:
        if kind.axis is not None and kind.aspects[-1] != "centre":
            raise InputError(f"{name}: expected its axis, got none. Give axis and axis_sd.")
        return np.eye(3), _UNKNOWN_AXIS
    z = np.asarray(axis, dtype=np.float64)
    if z.shape != (3,) or not np.isfinite(z).all() or not np.linalg.norm(z) > 0:
        raise InputError(f"{name}, axis: expected three numbers that are not all zero, got {axis!r}.")
    if axis_sd is None or not (np.isfinite(axis_sd) and axis_sd > 0):
        raise InputError(
            f"{name}, axis_sd: expected a positive angle [rad], got {axis_sd}. How well is the axis known?"
        )
    return SO3.frame_from_axis(z / np.linalg.norm(z), 2), float(axis_sd)


def _covariance(sd: npt.ArrayLike, name: str) -> FloatArray:
    given = np.asarray(sd, dtype=np.float64)
    if given.shape == (3, 3):
        return check_covariance(f"{name}, sd", given, 3)
    if given.shape not in ((), (3,)) or not np.isfinite(given).all() or not np.all(given > 0):
        raise InputError(f"{name}, sd: expected one or three positive lengths [m], or a covariance, got {sd!r}.")
    return np.diag(np.broadcast_to(given, 3) ** 2)


def with_known_size(feature: Feature, size: float, sd: float = 0.0) -> tuple[Feature, float]:
    """Return the feature given its true size; correlated frames, as of an arc, become more accurate.

    Args:
        feature: a round feature with a fitted size.
        size: size of a candidate [m or rad].
        sd: standard deviation of the made size from it.

    Returns:
        The feature, and the squared Mahalanobis distance of the two sizes (one degree of freedom, shared errors of the
        size included).

    Raises:
        InputError: for a feature without fitted size, or a size that is not positive.
    """
    own = feature.size
    if own is None or not own.variance > 0:
        raise InputError(f"feature {feature.label!r}: expected a round feature with a fitted size, got none of it.")
    off, variance, C = size - own.value, own.variance + sd**2, feature.full_covariance
    gain = C[:, -1] / variance
    after = C - np.outer(gain, C[:, -1])
    pairs = tuple(zip(own.shared, feature.shared, strict=True)) if own.shared else ()
    total = variance + sum(float((A @ term.error.covariance @ A.T)[0, 0]) for A, term in pairs)
    shared = tuple(SharedTerm(term.error, term.jacobian - np.outer(gain[:-1], A)) for A, term in pairs)
    xi = np.zeros(6)
    xi[list(feature.kind.rows)] = gain[:-1] * off
    kept = Round(
        own.value + float(gain[-1]) * off,
        max(float(after[-1, -1]), 0.0),
        after[:-1, -1] if sd > 0 else np.zeros(0),
        tuple(A * (1 - gain[-1]) for A in own.shared),
        own.convex,
    )
    P = 0.5 * (after[:-1, :-1] + after[:-1, :-1].T)
    moved = replace(
        feature,
        T_world_feature=feature.T_world_feature @ SE3.exp(xi),
        P=P,
        shared=shared if own.shared else feature.shared,
        size=kept,
    )
    return moved, off**2 / total
