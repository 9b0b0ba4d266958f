"""Sensed features from labelled measurements: one fit for each label; wrong readings are named."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import DegenerateError, InputError, SideError
from tanteo.features import Feature, SharedTerm, Sides
from tanteo.features.kinds import PLANE
from tanteo.fitting.group import fit_group
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import IntArray
from tanteo.sensors import PointMeasurements, reading_kind


@dataclass(frozen=True, slots=True, eq=False)
class LabelledFeatures:
    """Features from the labels of readings.

    Attributes:
        features: planes, edges and vertices; a pair of both sides if the outward side of a plane is unknown.
        unlabelled: rows of the measurements without a feature: centres, and points without label and normal.
        rejected: ids of readings that disagree with the others of their label.
        rejected_by: distance of each from the feature of the others [m].
        notes: sentences on labels that were excluded and covariances that were widened.
    """

    features: tuple[Sides, ...]
    unlabelled: IntArray
    rejected: tuple[str, ...]
    rejected_by: tuple[float, ...]
    notes: tuple[str, ...]


def fit_labelled(measured: PointMeasurements, tolerance: float = 0.0) -> LabelledFeatures:
    """Fit one feature to the points of each label; a single point with its normal is a plane, too.

    Labelled points of kind ``point`` are taken to lie on one plane. A label whose points do not determine their
    feature is excluded with a note on which readings to add.

    Args:
        measured: points in the world.
        tolerance: sd of the made surface against its CAD [m]; added to every point, for the form of the surface.

    Raises:
        InputError: for a ball tip on an edge or a vertex, different tips on one label, a normal without its sd;
            ``SideError`` if the readings of no label agree about its outward side.
    """
    groups: dict[str, list[int]] = {}
    unlabelled, features, rejected, notes = [], list[Sides](), dict[str, float](), list[str]()
    for row, (label, kind) in enumerate(zip(measured.features, measured.kinds, strict=True)):
        if reading_kind(kind).feature is None:
            unlabelled.append(row)
        elif label:
            groups.setdefault(label, []).append(row)
        elif np.isfinite(measured.normals[row]).all():
            features.append(_plane_at_point(measured, row, tolerance))
        else:
            unlabelled.append(row)
    astray: SideError | None = None
    for label, rows in groups.items():
        try:
            feature, dropped, note = fit_group(measured, label, rows, tolerance)
        except (DegenerateError, SideError) as error:
            notes.append(f"{label!r} was excluded: {error}")
            astray = astray or (error if isinstance(error, SideError) else None)
            continue
        features.append(feature)
        rejected |= dropped
        notes += note
    if astray is not None and not features:  # no label agrees: columns are probably swapped
        raise astray
    index = np.array(unlabelled, dtype=np.int64)
    return LabelledFeatures(tuple(features), index, tuple(rejected), tuple(rejected.values()), tuple(notes))


def _plane_at_point(measured: PointMeasurements, row: int, tolerance: float) -> Feature:
    """Return a point with its sensed normal as a small plane."""
    name, normal, sd = measured.ids[row], measured.normals[row], measured.normal_sds[row]
    if not np.isfinite(sd):
        raise InputError(f"reading {name}: expected the sd of its normal, got none. Add the column normal_sd_deg.")
    point = measured.points[row] - measured.radii[row] * normal
    T = SE3.from_parts(SO3.frame_from_axis(normal, 2), point)
    P = np.diag([normal @ measured.covs[row] @ normal + tolerance**2, sd**2, sd**2])
    rows = SE3.adjoint_inverse(T)[list(PLANE.rows)]
    terms = []
    for error, J in zip(measured.shared, measured.jacobians, strict=True):
        rigid = J.shape[-1] == 6 and np.allclose(J[row], np.hstack([np.eye(3), -SO3.hat(measured.points[row])]))
        jacobian = rows if rigid else np.vstack([normal @ J[row], np.zeros((2, J.shape[-1]))])
        terms.append(SharedTerm(error, jacobian))
    return Feature(PLANE, T, P, name, tuple(terms), point[None], (name,), float(measured.radii[row]))
