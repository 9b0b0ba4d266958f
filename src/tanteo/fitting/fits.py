"""Registry of fits: one function for each kind of feature."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeAlias

import numpy as np

from tanteo.errors import InputError
from tanteo.features import Feature, Sides
from tanteo.features.kinds import CIRCLE, CONE, CYLINDER, EDGE, PLANE, SPHERE, VERTEX, FeatureKind
from tanteo.fitting.agreement import jointly
from tanteo.fitting.edge import fit_edge
from tanteo.fitting.estimate import Estimate, FitReport, SharedReadings, make_report, shared_terms
from tanteo.fitting.plane import fit_plane, plane_ml
from tanteo.fitting.round_fit import fit_round
from tanteo.fitting.vertex import fit_vertex
from tanteo.geometry import SE3
from tanteo.geometry.typing import Covariances, FloatArray, Vectors


@dataclass(frozen=True, slots=True, eq=False)
class LabelledPoints:
    """Measured points of one label.

    Attributes:
        label: name of the label.
        ids: ids of the readings.
        points: on the surface, or centres of the tip's ball ``(n, 3)`` in the world [m].
        covs: their independent covariances ``(n, 3, 3)`` [m^2].
        shared: errors that they have in common.
        radii: radius of the tip's ball ``(n,)`` [m]; 0 without one.
        side: ``normals`` or ``directions`` ``(n, 3)``, if the readings determine the outward side.
        normal_sds: standard deviations of the normals ``(n,)`` [rad] if they are measurements; NaN otherwise.
    """

    label: str
    ids: tuple[str, ...]
    points: Vectors
    covs: Covariances
    shared: SharedReadings
    radii: FloatArray
    side: Mapping[str, Vectors]
    normal_sds: FloatArray | None = None


Fit: TypeAlias = Callable[[LabelledPoints], tuple[Sides, FitReport]]

FITS: dict[str, Fit] = {}
"""The fit of each kind, by its name."""


def register_fit(kind: FeatureKind, fit: Fit) -> None:
    """Register the fit of a kind of labelled points."""
    FITS[kind.name] = fit


def fitted(kind: FeatureKind, estimate: Estimate, sensed: LabelledPoints) -> tuple[Feature, FitReport]:
    """Return the feature of an estimate without batch axes, with its shared errors and its report."""
    rows = SE3.adjoint_inverse(estimate.T)[list(kind.rows)]
    terms = shared_terms(sensed.points, estimate, rows, sensed.shared)
    feature = Feature(kind, estimate.T, estimate.P, sensed.label, terms, sensed.points, sensed.ids)
    return feature, make_report(estimate, sensed.ids)


def _plane(sensed: LabelledPoints) -> tuple[Sides, FitReport]:
    """Fit a plane; return both sides if its outward side is unknown."""
    points, covs, radius = sensed.points, sensed.covs, _one_tip("plane", sensed)

    def facing(**side: Vectors) -> tuple[Feature, FitReport]:
        feature, report = fit_plane(
            points, covs, radius=radius, label=sensed.label, readings=sensed.ids, shared=sensed.shared, **side
        )
        return replace(feature, tip_radius=radius), report

    if sensed.side:
        feature, report = facing(**sensed.side)
        return feature, jointly(report, feature, points, covs, sensed.shared, sensed.ids, radius)
    normal = plane_ml(points, covs).T[:3, 2]
    (one, report), (other, _) = facing(outward=normal), facing(outward=-normal)
    return (one, other), jointly(report, one, points, covs, sensed.shared, sensed.ids, radius)


def _edge(sensed: LabelledPoints) -> tuple[Sides, FitReport]:
    return _touched(EDGE, fit_edge, sensed)


def _vertex(sensed: LabelledPoints) -> tuple[Sides, FitReport]:
    return _touched(VERTEX, fit_vertex, sensed)


def _touched(
    kind: FeatureKind, fit: Callable[..., tuple[Feature, FitReport]], sensed: LabelledPoints
) -> tuple[Sides, FitReport]:
    """Fit an edge or a vertex to points on it."""
    if sensed.radii.any():
        raise InputError(
            f"{kind.name} {sensed.label!r}: expected surface points, got centres of a ball of "
            f"{1e3 * sensed.radii.max():g} mm, whose contact on an edge is unknown. Sense the two faces beside it, or "
            f"give points of the {kind.name} itself."
        )
    feature, report = fit(sensed.points, sensed.covs, label=sensed.label, readings=sensed.ids, shared=sensed.shared)
    return feature, jointly(report, feature, sensed.points, sensed.covs, sensed.shared, sensed.ids)


def _round(kind: FeatureKind, sensed: LabelledPoints) -> tuple[Sides, FitReport]:
    """Fit a round feature; normals are measurements if their standard deviation is stated."""
    radius = _one_tip(kind.name, sensed)
    feature, report = fit_round(
        kind, sensed.points, sensed.covs, tip_radius=radius, label=sensed.label, readings=sensed.ids,
        shared=sensed.shared, normal_sds=sensed.normal_sds, normals=sensed.side.get("normals"),
        directions=sensed.side.get("directions"),
    )  # fmt: skip
    return feature, jointly(report, feature, sensed.points, sensed.covs, sensed.shared, sensed.ids, radius)


def _one_tip(name: str, sensed: LabelledPoints) -> float:
    """Return the radius of the tip's ball, the same for all points."""
    if np.ptp(sensed.radii) > 1e-9:
        least, most = 1e3 * sensed.radii.min(), 1e3 * sensed.radii.max()
        raise InputError(f"{name} {sensed.label!r}: expected one tip radius, got {least:g} to {most:g} mm.")
    return float(sensed.radii[0])


register_fit(PLANE, _plane)
register_fit(EDGE, _edge)
register_fit(VERTEX, _vertex)
for _kind in (CIRCLE, CYLINDER, CONE, SPHERE):
    register_fit(_kind, partial(_round, _kind))
