"""Refusal of round features that their points do not determine, with what is unobservable and what to do."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tanteo.errors import DegenerateError
from tanteo.features.kinds import CIRCLE, CONE, CYLINDER, SPHERE, FeatureKind
from tanteo.fitting.round_estimate import RoundEstimate
from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, FloatArray, Vectors

MOST_SHARE = 0.1
"""Largest standard deviation of a size, or of the centre across the axis, as a share of the radius."""
MOST_TILT = 0.1
"""Largest standard deviation of the axis' direction [rad]."""
_BENT = 0.25
"""Largest second order shift of the points by a tilt of one standard deviation, as a fraction of their place's sd."""
_CONE_FACTOR = 0.4
"""Factor on all three limits for a cone, whose apex is far from its points."""
_SAME_RADIUS = 0.01
"""Relative difference of radii below which two cylinders fit one ring with different tilts."""
_FREE = 1e-11
"""Least eigenvalue of the information scaled to unit diagonal: below it a direction is free to rounding."""


class Excess(NamedTuple):
    """Ratio of each standard deviation to the largest accepted one; above 1 it is unobservable ``(*batch,)``."""

    size: FloatArray
    place: FloatArray
    tilt: FloatArray


def excess(kind: FeatureKind, estimate: RoundEstimate, points: Vectors) -> Excess:
    """Return the ratios of the standard deviations to the largest ones for which a covariance is valid."""
    P = estimate.fit.P
    sd = np.sqrt(np.maximum(np.diagonal(P, axis1=-2, axis2=-1), 0.0))
    local = SE3.apply(SE3.inverse(estimate.fit.T)[..., None, :, :], points)
    radius = np.mean(np.linalg.norm(local[..., :2], axis=-1), axis=-1) if kind is CONE else estimate.size
    margin = np.minimum(estimate.size, np.pi / 2 - estimate.size) if kind is CONE else estimate.size
    place = sd[..., : 3 if kind is SPHERE else 2].max(axis=-1) / (MOST_SHARE * radius)
    tilt = np.zeros_like(place)
    if kind is not SPHERE:
        tilt = sd[..., -3:-1].max(axis=-1)
        arm = np.linalg.norm(local.mean(axis=-2)[..., : 2 if kind is CYLINDER else 3], axis=-1)
        bent = arm * tilt**2 / 2 / _with_all_else_known(P)
        tilt = np.maximum(tilt / MOST_TILT, bent / _BENT)
    free = np.where(estimate.condition < _FREE, np.inf, 0.0)
    place, tilt = (place + free, tilt) if kind is SPHERE else (place, tilt + free)
    limit = _CONE_FACTOR if kind is CONE else 1.0
    return Excess(sd[..., -1] / (MOST_SHARE * margin) / limit, place / limit, tilt / limit)


def _with_all_else_known(P: FloatArray) -> FloatArray:
    """Return the smallest sd of a coordinate across the axis given all others ``(*batch,)``."""
    d = np.sqrt(np.maximum(np.diagonal(P, axis1=-2, axis2=-1), 1e-300))
    unit = P / (d[..., :, None] * d[..., None, :]) + 1e-14 * np.eye(P.shape[-1])
    tight = np.diagonal(np.linalg.inv(unit), axis1=-2, axis2=-1)[..., :2]
    return np.asarray(np.min(d[..., :2] / np.sqrt(np.maximum(tight, 1e-300)), axis=-1))


def observable(kind: FeatureKind, estimate: RoundEstimate, points: Vectors) -> BoolArray:
    """Return whether the points determine each feature of a batch, as :func:`refuse` tests it ``(*batch,)``."""
    beyond = np.maximum.reduce(list(excess(kind, estimate, points)))
    return np.asarray(estimate.converged & (beyond <= 1) & np.isnan(estimate.rival))


def refuse(kind: FeatureKind, estimate: RoundEstimate, points: Vectors, name: str) -> None:
    """Refuse a fit that the points do not determine.

    Raises:
        DegenerateError: size, place or axis is not observable; the message states which, and what to do.
    """
    beyond = excess(kind, estimate, points)
    if not float(max(beyond)) <= 1:
        first = beyond.size > 1 and beyond.size < np.inf  # a given size also improves place and tilt
        worst = _no_size if first else _no_tilt if beyond.tilt > beyond.place else _no_place
        raise DegenerateError(worst(kind, estimate, points, name))
    if not estimate.converged:
        raise DegenerateError(
            f"{name}: expected points of a {kind.name}, got a fit that does not converge (so far "
            f"{_size(kind, float(estimate.size))}). Check for points of other faces, check their standard deviations, "
            "or touch more of it."
        )
    if np.isfinite(estimate.rival) and kind is CYLINDER and abs(estimate.rival / estimate.size - 1) < _SAME_RADIUS:
        raise DegenerateError(_no_tilt(kind, estimate, points, name))
    if np.isfinite(estimate.rival):
        raise DegenerateError(
            f"{name}: expected points that one {kind.name} fits, got points that another fits as well "
            f"({_size(kind, float(estimate.size))} or {_size(kind, float(estimate.rival))}, elsewhere). Give the "
            "direction of each touch or sensed normals, or touch more of it."
        )


def _size(kind: FeatureKind, size: float) -> str:
    return f"half angle {np.degrees(size):.3g} deg" if kind is CONE else f"radius {1e3 * size:.4g} mm"


def arc_of(kind: FeatureKind, estimate: RoundEstimate, points: Vectors) -> float:
    """Return the angle that the points cover about the axis, or the cap of a sphere [deg]."""
    local = SE3.apply(SE3.inverse(estimate.fit.T), points)
    if kind is SPHERE:
        unit = local / np.linalg.norm(local, axis=-1, keepdims=True)
        mean = unit.mean(axis=0)
        cosine = np.min(unit @ mean) / max(float(np.linalg.norm(mean)), 1e-300)
        return float(2 * np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
    turns = np.sort(np.arctan2(local[:, 1], local[:, 0]))
    return float(360 - np.degrees(np.diff(turns, append=turns[0] + 2 * np.pi).max()))


def _covered(kind: FeatureKind, estimate: RoundEstimate, points: Vectors) -> str:
    what = "cap" if kind is SPHERE else "arc"
    return f"the {what} covers {arc_of(kind, estimate, points):.0f} degrees"


def _no_size(kind: FeatureKind, estimate: RoundEstimate, points: Vectors, name: str) -> str:
    sd, s = float(np.sqrt(estimate.fit.P[-1, -1])), float(estimate.size)
    off = f"sd {np.degrees(sd):.2g} deg of {np.degrees(s):.3g} deg" if kind is CONE else f"sd {1e3 * sd:.2g} mm of "
    off += "" if kind is CONE else f"{1e3 * s:.4g} mm"
    further = " and further along it" if kind is CONE else ""
    return (
        f"{name}: {_covered(kind, estimate, points)}: the {kind.size_name} is not observable ({off}); give it, or "
        f"touch more of it{further}."
    )


def _no_place(kind: FeatureKind, estimate: RoundEstimate, points: Vectors, name: str) -> str:
    sd = float(np.sqrt(np.diag(estimate.fit.P)[: 3 if kind is SPHERE else 2].max()))
    given = "" if estimate.fit.P[-1, -1] == 0 else f" give the {kind.size_name}, or"
    return (
        f"{name}: {_covered(kind, estimate, points)}: its {'axis' if kind is CYLINDER else 'centre'} is not observable "
        f"(sd {1e3 * sd:.2g} mm);{given} touch more of it."
    )


def _no_tilt(kind: FeatureKind, estimate: RoundEstimate, points: Vectors, name: str) -> str:
    sd = np.degrees(np.sqrt(np.diag(estimate.fit.P)[-3:-1].max()))
    if kind is CIRCLE:
        return (
            f"{name}: {_covered(kind, estimate, points)}: the plane of the rim is not observable (tilt sd {sd:.2g} "
            "deg); touch more of it, or sense the face around it and give that plane."
        )
    length = 1e3 * np.ptp(SE3.apply(SE3.inverse(estimate.fit.T), points)[:, 2])
    return (
        f"{name}: the points reach {length:.3g} mm along the axis, and {_covered(kind, estimate, points)}: the "
        f"direction of the axis is not observable (sd {sd:.2g} deg); touch another ring further along it, or sense "
        "normals."
    )
