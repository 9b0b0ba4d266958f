"""Fit of a round feature to points: its side, and the radius of the tip's ball; ``math.md`` section 8."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from tanteo.errors import InputError
from tanteo.features import Feature, Round, SharedError, SharedTerm
from tanteo.features.kinds import CIRCLE, CONE, FeatureKind
from tanteo.fitting.estimate import Estimate, FitReport, SharedReadings, check_points, make_report, shared_terms
from tanteo.fitting.round_estimate import SURFACES, RoundEstimate, round_distances, round_ml, unknowns
from tanteo.fitting.round_refusal import refuse
from tanteo.fitting.sides import check_spread, outward_vectors, require_side, side_of
from tanteo.geometry import SE3
from tanteo.geometry.typing import Covariances, FloatArray, Vectors


def fit_round(
    kind: FeatureKind,
    points: Vectors,
    covs: Covariances,
    *,
    size: float | None = None,
    size_sd: float = 0.0,
    convex: bool | None = None,
    directions: Vectors | None = None,
    normals: Vectors | None = None,
    normal_sds: FloatArray | None = None,
    tip_radius: float = 0.0,
    tip_radius_sd: float = 0.0,
    label: str = "",
    readings: Sequence[str] = (),
    shared: SharedReadings = (),
) -> tuple[Feature, FitReport]:
    """Fit a cylinder, cone or sphere to sensed points, or a circle to points of its rim.

    The points of a circle are on the rim itself, like crossings of an edge. If a ball touched the wall of a bore, fit a
    cylinder, or use :func:`tanteo.fitting.on_plane`.

    Args:
        kind: circle, cylinder, cone or sphere.
        points: points of the surface, or centres of the tip's ball if ``tip_radius`` is given ``(n, 3)`` in the world
            [m].
        covs: their independent covariances ``(n, 3, 3)`` [m^2].
        size: radius [m] or half angle [rad], if it is known.
        size_sd: its standard deviation; 0 holds it.
        convex: True for a boss, False for a bore; by default from directions or normals.
        directions: directions of the beam or of the tip's motion, into the material ``(n, 3)``; NaN rows if unknown.
            For a circle: into its face; z of its frame is opposite.
        normals: sensed outward normals ``(n, 3)``; NaN rows if unknown. For a circle: of its face.
        normal_sds: standard deviations of the normals ``(n,)`` [rad]; None: normals determine the side only.
        tip_radius: radius of the tip's ball [m].
        tip_radius_sd: its standard deviation, of one error for everything that the tip touched; features share it by
            its name.
        label: name of the feature.
        readings: ids of the readings.
        shared: errors that the points share, beyond ``covs``. They have weight in the fit, so errors that move points
            against each other are separated from the feature as far as possible.

    Returns:
        The feature, its size with variance and covariance, and how well the points agree.

    Raises:
        InputError: for too few points, shapes that do not fit, a ball on a rim; ``SideError`` if a ball touched from
            an unknown side, or the readings contradict each other about it.
        DegenerateError: if the points do not determine it; the message states what is not observable.

    Example:
        >>> turn = np.radians(np.arange(0, 360, 45))
        >>> ring = np.stack([5e-3 * np.cos(turn), 5e-3 * np.sin(turn), 0 * turn], axis=1)
        >>> covs = np.tile(1e-10 * np.eye(3), (8, 1, 1))
        >>> hole, report = tanteo.fitting.fit_round(tanteo.features.kinds.CIRCLE, ring, covs, label="hole")
        >>> round(1e3 * hole.radius, 6)
        5.0
    """
    name = f"{kind.name} {label!r}"
    points, covs = check_points(points, covs, unknowns(kind, size, size_sd), name)
    _check(kind, points, size, size_sd, max(tip_radius, tip_radius_sd), name)
    check_spread("tip_radius_sd", tip_radius_sd, name)
    outward = outward_vectors(directions, normals, len(points))
    sds = np.full(len(points), np.inf) if normal_sds is None else np.where(np.isfinite(normal_sds), normal_sds, np.inf)
    sensed = outward_vectors(None, normals, len(points))
    sds = np.where(sensed.any(axis=1) & (kind is not CIRCLE), sds, np.inf)
    given = None if size is None else (size, size_sd)
    fit = partial(_sided, kind, points, covs, given=given, convex=convex, sides=(outward, sensed, sds), name=name)
    found, side = fit(shared, tip_radius)
    require_side(side, tip_radius > 0 or tip_radius_sd > 0, name, "neither directions nor normals")
    if tip_radius_sd > 0 and side is not None:
        shared = (*shared, tip_error(tip_radius_sd, side * _normals(kind, found, points)))
        found, side = fit(shared, tip_radius)
    refuse(kind, found, points, name)
    estimate, size_found = _off_the_ball(kind, found, (side or 0) * tip_radius, name)
    estimate = _directed(kind, estimate, outward)
    N = _normals(kind, found, points)
    support = points - (side or 0) * tip_radius * N
    rows = np.vstack([SE3.adjoint_inverse(estimate.T)[list(kind.rows)], np.zeros(6)])
    terms = shared_terms(points, estimate, rows, shared)
    known = convex if side is None else side > 0
    feature = feature_of(kind, estimate, size_found, terms, known, label, support, readings, tip_radius)
    return feature, make_report(estimate, readings)


def _check(
    kind: FeatureKind, points: Vectors, size: float | None, size_sd: float, tip_radius: float, name: str
) -> None:
    if points.ndim != 2:
        raise InputError(f"{name}, points: expected shape (n, 3), got {points.shape}. Use round_ml for batches.")
    if kind.name not in SURFACES:
        raise InputError(f"kind: expected one of {', '.join(SURFACES)}, got {kind.name}.")
    if size is not None and not (np.isfinite(size) and size > 0 and (kind is not CONE or size < np.pi / 2)):
        most = " below pi/2 rad" if kind is CONE else " [m]"
        raise InputError(f"{name}: expected a positive {kind.size_name}{most}, got {size}.")
    check_spread("size_sd", size_sd, name)
    if kind is CIRCLE and tip_radius > 0:
        raise InputError(
            f"{name}: expected points of its rim, got centres of a ball of {1e3 * tip_radius:g} mm, whose contact on "
            "an edge is unknown. Touch its wall and fit a cylinder, or sense its face, too, and fit a circle on that "
            "plane."
        )


def _sided(
    kind: FeatureKind,
    points: Vectors,
    covs: Covariances,
    shared: SharedReadings,
    tip_radius: float,
    *,
    given: tuple[float, float] | None,
    convex: bool | None,
    sides: tuple[Vectors, Vectors, FloatArray],
    name: str,
) -> tuple[RoundEstimate, int | None]:
    """Return the fit to the points with the ball's radius, and 1 for a boss, -1 for a bore, None if unknown."""
    outward, sensed, sds = sides
    own = sds if np.isfinite(sds).any() else None

    def fit(sign: int, moved: float) -> RoundEstimate:
        size = {} if given is None else {"size": given[0] + moved, "size_sd": given[1]}
        along = None if own is None else sign * sensed
        beside = outward if outward.any() and kind is not CIRCLE else None
        return round_ml(kind, points, covs, normals=along, normal_sds=own, outward=beside, shared=shared, **size)

    stated = None if convex is None else (1 if convex else -1)
    found = fit(stated or _spreading(points, sensed), 0.0)
    if kind is CIRCLE:
        return found, stated
    side = side_of(_normals(kind, found, points), outward, stated, name)
    if tip_radius > 0 and given is not None and kind is not CONE and side is not None:
        found = fit(side, side * tip_radius)
    return found, side


def tip_error(sd: float, outward: Vectors) -> tuple[SharedError, FloatArray]:
    """Return the shared error of a tip's radius: a larger ball touches earlier than a nominal one would."""
    return SharedError("tip radius", np.array([[sd**2]]), "error of the radius of the tip [m]"), -outward[..., None]


def _spreading(points: Vectors, normals: Vectors) -> int:
    """Return 1 if sensed normals diverge with the points, as on a boss, -1 if they converge."""
    known = normals.any(axis=1)
    p, n = points[known], normals[known]
    return -1 if len(p) and np.sum((p - p.mean(axis=0)) * (n - n.mean(axis=0))) < 0 else 1


def _normals(kind: FeatureKind, found: RoundEstimate, points: Vectors) -> Vectors:
    """Return unit vectors away from the axis or centre at the points ``(n, 3)``."""
    local = SE3.apply(SE3.inverse(found.fit.T), points)
    return np.asarray(round_distances(kind, local, float(found.size)).G[:, -1] @ found.fit.T[:3, :3].T)


def _off_the_ball(kind: FeatureKind, found: RoundEstimate, tip: float, name: str) -> tuple[Estimate, float]:
    """Return the surface, ``tip`` nearer to the axis than the ball's centres; the apex of a cone moves."""
    s = float(found.size)
    if kind is not CONE or tip == 0:
        if not s - tip > 0:
            raise InputError(
                f"{name}: expected a ball smaller than it, got one of {1e3 * abs(tip):g} mm at {1e3 * s:.4g} mm. Check "
                "the tip's radius and the side."
            )
        return found.fit, s - tip
    slide = np.eye(4)
    slide[2, 3] = tip / np.sin(s)
    J = np.eye(kind.size + 1)
    rows = list(kind.rows)
    J[:-1, :-1] = SE3.adjoint_inverse(slide)[rows][:, rows]
    J[2, -1] = -tip * np.cos(s) / np.sin(s) ** 2
    fit = found.fit
    return replace(fit, T=fit.T @ slide, P=J @ fit.P @ J.T, shared_jacobian=J @ fit.shared_jacobian), s


def _directed(kind: FeatureKind, estimate: Estimate, outward: Vectors) -> Estimate:
    """Return the feature with z of a rim out of the material; otherwise, with the largest component of z positive."""
    if kind.flip is None:
        return estimate
    z = estimate.T[:3, 2]
    along = float(np.sum(outward @ z)) if kind.faces > 1 else 0.0
    if (along or z[np.argmax(np.abs(z))]) > 0:
        return estimate
    flip = np.append(np.tile(kind.flip, 2)[list(kind.rows)], 1.0)
    return replace(
        estimate,
        T=estimate.T @ kind.symmetries[1],
        P=estimate.P * np.outer(flip, flip),
        shared_jacobian=estimate.shared_jacobian * flip[:, None],
    )


def feature_of(
    kind: FeatureKind,
    estimate: Estimate,
    size: float,
    terms: Sequence[SharedTerm],
    convex: bool | None,
    label: str,
    support: Vectors,
    readings: Sequence[str],
    tip_radius: float,
) -> Feature:
    """Return the feature of an estimate whose last row is the size."""
    P = 0.5 * (estimate.P + estimate.P.T)
    gains = tuple(term.jacobian[-1:] for term in terms)
    own = tuple(SharedTerm(term.error, term.jacobian[:-1]) for term in terms)
    size_of = Round(size, float(P[-1, -1]), P[:-1, -1], gains, convex)
    return Feature(kind, estimate.T, P[:-1, :-1], label, own, support, tuple(readings), tip_radius, size_of)
