"""Circles of bores and bosses in a known plane, from three or four touches of the wall."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo import _core
from tanteo.errors import InputError
from tanteo.features import Feature, SharedError, SharedTerm, shared_root
from tanteo.features.kinds import CIRCLE, CYLINDER, PLANE
from tanteo.features.reframing import reframe_near
from tanteo.fitting.estimate import Estimate, FitReport, SharedReadings, check_points, make_report, rigid_motion
from tanteo.fitting.flatness import refuse_flat
from tanteo.fitting.round_estimate import KnownFrame, RoundEstimate, check_positive, solved
from tanteo.fitting.round_fit import feature_of, tip_error
from tanteo.fitting.round_refusal import refuse
from tanteo.fitting.sides import check_spread, outward_vectors, require_side, side_of
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import Covariances, FloatArray, Vectors

_EXACT = np.diag([1e-9, 1e-7, 1e-7]) ** 2
"""No plane is known better than this [m, rad]."""
_OWN = 1e-6
"""Share of a plane's covariance that stays its own when the rest gets a name."""


def circle_on_plane(
    points: Vectors,
    covs: Covariances,
    plane: Feature,
    *,
    height: float = 0.0,
    height_sd: float = 0.0,
    size: float | None = None,
    size_sd: float = 0.0,
    convex: bool | None = None,
    directions: Vectors | None = None,
    tip_radius: float = 0.0,
    tip_radius_sd: float = 0.0,
    label: str = "",
    readings: Sequence[str] = (),
    shared: SharedReadings = (),
) -> tuple[Feature, FitReport]:
    """Fit the circle in which the wall of a bore or boss, perpendicular to a plane, meets the plane.

    This is three- or four-point probing. The points are on the wall, at any depth, and are projected along the plane's
    normal; crossings of the rim are points of the wall, too. With a known size two points are enough, if directions and
    ``convex`` determine the side of the centre.

    Args:
        points: points of the wall, or centres of the tip's ball ``(n, 3)`` in the world [m].
        covs: their independent covariances ``(n, 3, 3)`` [m^2].
        plane: the sensed face around it, or a given one (with zero ``P`` if it is exact); z of the circle is its
            outward normal. Its uncertainty propagates to the circle, its shared errors by name. If the plane and
            several circles of it are used together, pass all of them :func:`with_named_errors` of the plane.
        height: height of the circle over the plane, along its outward normal [m]: a rim in a counterbore, the top of a
            boss.
        height_sd: its standard deviation.
        size: radius [m], if it is known.
        size_sd: its standard deviation; 0 holds it.
        convex: True for a boss, False for a bore; by default from the directions.
        directions: directions of the touches, into the material ``(n, 3)``; NaN rows if unknown.
        tip_radius: radius of the tip's ball [m].
        tip_radius_sd: its standard deviation, of one error for everything that the tip touched, see :func:`fit_round`.
        label: name of the circle.
        readings: ids of the readings.
        shared: errors that the points have in common, beyond ``covs``.

    Raises:
        InputError: if ``plane`` is none, for too few points; ``SideError`` if a ball touched from an unknown side.
        DegenerateError: if the arc is too short for what is unknown.
    """
    name, own = f"circle {label!r}", size is None or size_sd > 0
    if plane.kind is not PLANE:
        raise InputError(f"{name}, plane: expected a plane, got a {plane.kind.name}. Fit a plane to its face first.")
    points, covs = check_points(points, covs, 2 + own, name)
    if points.ndim != 2:
        raise InputError(f"{name}, points: expected shape (n, 3), got {points.shape}.")
    check_positive(covs, name)
    refuse_flat(points, 1 if not own else 2, name)
    check_spread("tip_radius_sd", tip_radius_sd, name)
    touched = tip_radius > 0 or tip_radius_sd > 0
    side = _side(points, plane, outward_vectors(directions, None, len(points)), convex, touched, name)
    tip = (side or 0) * tip_radius
    near = _raised(reframe_near(plane, _centre(points, plane)), height, height_sd, name)
    beside, given = outward_vectors(directions, None, len(points)), (None if size is None else size + tip, size_sd)
    errors = _errors(points, near, shared)
    found, gain = _solve(points, covs, near, given, beside, side, errors)
    if tip_radius_sd > 0 and side is not None:
        spokes = _away(points - found.fit.T[:3, 3], found.fit.T[:3, 2])
        errors = _errors(points, near, (*shared, tip_error(tip_radius_sd, side * spokes)))
        found, gain = _solve(points, covs, near, given, beside, side, errors)
    refuse(CIRCLE, found, points, name)
    s = float(found.size) - tip
    if not s > 0:
        raise InputError(f"{name}: expected a ball smaller than the bore, got {1e3 * tip_radius:g} mm. Check the tip.")
    terms = _terms(found.fit, gain, errors)
    support = points - tip * _away(points - found.fit.T[:3, 3], found.fit.T[:3, 2])
    known = None if side is None else side > 0
    feature = feature_of(CIRCLE, found.fit, s, terms, known, label, support, readings, tip_radius)
    return feature, make_report(found.fit, readings)


def _centre(points: Vectors, plane: Feature) -> Vectors:
    """Return the centre of the circle of the points, projected along the plane's normal."""
    return _core.circle_centre(np.ascontiguousarray(points), np.ascontiguousarray(plane.T_world_feature[:3, :3]))


def _away(off: Vectors, axis: Vectors) -> Vectors:
    """Return unit vectors from the axis through a centre towards places ``(n, 3)``."""
    across = off @ (np.eye(3) - np.outer(axis, axis))
    return np.asarray(across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300))


def _raised(plane: Feature, height: float, sd: float, name: str) -> Feature:
    """Return the parallel plane at a height over another."""
    check_spread("height_sd", sd, name)
    if not np.isfinite(height):
        raise InputError(f"{name}, height: expected a finite length [m], got {height}.")
    T, P = plane.T_world_feature.copy(), plane.P + np.diag([sd**2, 0.0, 0.0])
    T[:3, 3] += height * T[:3, 2]
    return replace(plane, T_world_feature=T, P=P)


def _side(
    points: Vectors, plane: Feature, outward: Vectors, convex: bool | None, touched: bool, name: str
) -> int | None:
    stated = None if convex is None else (1 if convex else -1)
    spokes = _away(points - _centre(points, plane), plane.T_world_feature[:3, 2])
    side = stated if len(points) < 3 else side_of(spokes, outward, stated, name)
    require_side(side, touched, name, "no directions")
    return side


@dataclass(frozen=True, slots=True, eq=False)
class _Error:
    """Effect of a shared error on the plane ``(3, d)`` and the points ``(n, 3, d)``.

    ``rigid`` is its rigid motion of the world ``(6, d)``; None if it is not rigid.
    """

    error: SharedError
    plane: FloatArray
    points: FloatArray
    rigid: FloatArray | None


def _errors(points: Vectors, plane: Feature, shared: SharedReadings) -> list[_Error]:
    of_plane = SE3.adjoint_inverse(plane.T_world_feature)[list(PLANE.rows)]
    of_points = np.concatenate([np.broadcast_to(np.eye(3), (len(points), 3, 3)), -SO3.hat(points)], axis=-1)
    on_plane = {term.error.name: term.jacobian for term in plane.shared}
    on_points = {error.name: np.asarray(J, dtype=np.float64) for error, J in shared}
    errors: dict[str, SharedError] = {}
    for error in (*(term.error for term in plane.shared), *(error for error, _ in shared)):
        errors.setdefault(error.name, error)
    found = []
    for name, error in errors.items():
        d = len(error.covariance)
        A = on_plane.get(name, np.zeros((3, d)))
        J = on_points.get(name, np.zeros((len(points), 3, d)))
        M = rigid_motion(np.vstack([of_plane, of_points.reshape(-1, 6)]), np.vstack([A, J.reshape(-1, d)]))
        found.append(_Error(error, A, J, M))
    return found


def _solve(
    points: Vectors,
    covs: Covariances,
    near: Feature,
    size: tuple[float | None, float],
    outward: Vectors,
    side: int | None,
    errors: list[_Error],
) -> tuple[RoundEstimate, FloatArray]:
    """Return the estimate, and the derivatives of the circle by the plane's perturbation ``(6, 3)``."""
    information = np.zeros((5, 5))
    information[2:, 2:] = np.linalg.inv(near.P + _EXACT)
    weighing = [(one, shared_root([one.error])) for one in errors if one.rigid is None]
    of_points = np.concatenate([np.zeros((len(points), 3, 0)), *(one.points @ root for one, root in weighing)], axis=-1)
    of_plane = np.concatenate([np.zeros((3, 0)), *(one.plane @ root for one, root in weighing)], axis=-1)
    known = KnownFrame(near.T_world_feature, information, np.vstack([np.zeros((2, of_plane.shape[1])), of_plane]))
    found = solved(
        CIRCLE, points, covs, surface=CYLINDER, size=size[0], size_sd=size[1], side=side, known=known,
        outward=outward if outward.any() else None, shared_jacobian=of_points,
    )  # fmt: skip
    return found, found.frame_gain[:, 2:5]


def _terms(fit: Estimate, gain: FloatArray, errors: list[_Error]) -> tuple[SharedTerm, ...]:
    """Return the effect of shared errors of plane and points on circle and size; exact for rigid errors."""
    rows = np.vstack([SE3.adjoint_inverse(fit.T)[list(CIRCLE.rows)], np.zeros(6)])
    terms = []
    for one in errors:
        through = gain @ one.plane + np.sum(fit.shared_jacobian @ one.points, axis=0)
        terms.append(SharedTerm(one.error, through if one.rigid is None else rows @ one.rigid))
    return tuple(terms)


def with_named_errors(plane: Feature) -> Feature:
    """Return the plane with its own error as a named error that circles on it share.

    Then a pairing of a face and its holes counts the face once. The total covariance stays the same.

    Raises:
        InputError: if the plane has no label to name the error after.

    Example:
        >>> top = tanteo.features.Feature(tanteo.features.kinds.PLANE, np.eye(4), 1e-10 * np.eye(3), label="top")
        >>> tanteo.fitting.with_named_errors(top).shared[0].error.name
        "plane 'top'"
    """
    if not plane.label:
        raise InputError("plane: expected a label, got none: its error is named after it. Give one.")
    error = SharedError(
        f"{plane.kind.name} {plane.label!r}", (1 - _OWN) * plane.P, "error of a fitted feature [m, rad]"
    )
    return replace(plane, P=_OWN * plane.P, shared=(*plane.shared, SharedTerm(error, np.eye(plane.kind.size))))
