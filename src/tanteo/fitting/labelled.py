"""From measurements to sensed features: one fit a label, wrong readings named, unknown sides kept open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.errors import DegenerateError, InputError
from tanteo.features import PLANE, Feature, SharedTerm
from tanteo.fitting.agreement import bending, jointly
from tanteo.fitting.edge import fit_edge
from tanteo.fitting.estimate import FitReport, SharedReadings
from tanteo.fitting.plane import fit_plane, plane_ml
from tanteo.fitting.vertex import fit_vertex
from tanteo.lie import SE3, SO3
from tanteo.sensors import PointMeasurements
from tanteo.typing import Covariances, FloatArray, IntArray, Vectors

SUSPECT = 1e-3
"""Fits with a smaller p-value hold a wrong reading, are of more than one surface, or their sd is too small."""

Sides = Feature | tuple[Feature, Feature]
"""A feature, or both readings of a plane whose outward side is unknown."""


@dataclass(frozen=True, slots=True, eq=False)
class LabelledFeatures:
    """What the labels of the readings gave.

    Attributes:
        features: planes, edges and vertices; a pair where the outward side of a plane is unknown.
        bare: rows of the measurements that belong to no feature: points without label and without normal.
        rejected: ids of readings that disagree with the others of their label.
        rejected_by: how far each of them is from the feature of the others [m].
        notes: what could not be used or had to be widened, one sentence each.
    """

    features: tuple[Sides, ...]
    bare: IntArray
    rejected: tuple[str, ...]
    rejected_by: tuple[float, ...]
    notes: tuple[str, ...]


def fit_labelled(measured: PointMeasurements, tolerance: float = 0.0) -> LabelledFeatures:
    """Fit one feature to the points of each label; a single point with its normal is a plane, too.

    Labelled points of kind ``point`` are taken to lie on one plane. A label whose points do not determine their
    feature is left out with a note that says what to add.

    Args:
        measured: points in the world.
        tolerance: sd of the made surface against its CAD [m]; added to every point, for the form of the surface.

    Raises:
        InputError: for a ball tip on an edge or a vertex, different tips on one label, a normal without its sd.
    """
    groups: dict[str, list[int]] = {}
    bare, features, rejected, notes = [], list[Sides](), dict[str, float](), list[str]()
    for row, (label, kind) in enumerate(zip(measured.features, measured.kinds, strict=True)):
        if label:
            groups.setdefault(label, []).append(row)
        elif kind == "vertex":
            groups[f"vertex {measured.ids[row]}"] = [row]
        elif np.isfinite(measured.normals[row]).all():
            features.append(_plane_at_point(measured, row, tolerance))
        else:
            bare.append(row)
    for label, rows in groups.items():
        try:
            feature, dropped, note = _fit_group(measured, label, rows, tolerance)
        except DegenerateError as error:
            notes.append(f"{label!r} was left out: {error}")
            continue
        features.append(feature)
        rejected |= dropped
        notes += note
    index = np.array(bare, dtype=np.int64)
    return LabelledFeatures(tuple(features), index, tuple(rejected), tuple(rejected.values()), tuple(notes))


def _fit_group(
    measured: PointMeasurements, label: str, rows: list[int], tolerance: float
) -> tuple[Sides, dict[str, float], list[str]]:
    """Fit one label; drop readings that spoil the fit, or widen it if all of them scatter too much."""
    kind = measured.kinds[rows[0]]
    least = {"edge": 2, "vertex": 1}.get(kind, 3)
    if len(rows) < least:
        raise DegenerateError(f"{kind} {label!r}: expected {least} points or more, got {len(rows)}. Sense more of it.")
    feature, report = _fit(measured, kind, label, rows, tolerance)
    if _agrees(report):
        feature, notes = _unless_bent(measured, label, rows, tolerance, feature)
        return feature, {}, notes
    kept, dropped, better = list(rows), list[str](), report
    while not _agrees(better) and len(kept) > least + 1 and len(dropped) < len(rows) // 4:
        worst = next(row for row in kept if measured.ids[row] == better.worst)
        dropped.append(better.worst)
        kept.remove(worst)
        cleaned, better = _fit(measured, kind, label, kept, tolerance)
    if dropped and _agrees(better):
        cleaned, notes = _unless_bent(measured, label, kept, tolerance, cleaned)
        return cleaned, {name: _off(cleaned, measured, name) for name in dropped}, notes
    ratio = max(report.chi2 / report.dof, 1.0)
    note = (
        f"the readings of {label!r} scatter {_figure(np.sqrt(ratio))} times as much as stated: "
        f"its covariance was widened by that; check reading {report.worst}, {_figure(report.worst_sds)} sd off, "
        "and the standard deviation"
    )
    return _widened(feature, ratio), {}, [note]


def _agrees(report: FitReport) -> bool:
    """Whether neither all readings together nor the worst of them speak against the fit."""
    return min(report.p_value, report.p_worst) >= SUSPECT


def _unless_bent(
    measured: PointMeasurements, label: str, rows: Sequence[int], tolerance: float, feature: Sides
) -> tuple[Sides, list[str]]:
    """The feature; widened if it is a plane and what was sensed bends, which the test of all readings may not see."""
    plane = feature[0] if isinstance(feature, tuple) else feature
    if plane.kind is not PLANE:
        return feature, []
    points, covs, shared, radii = _sensed(measured, rows, tolerance)
    bend = bending(plane, points, covs, shared, float(radii[0]))
    if bend.p_value >= SUSPECT:
        return feature, []
    ratio = bend.gain / bend.dof
    note = (
        f"the readings of {label!r} are on a surface that bends: its covariance was widened by "
        f"{_figure(np.sqrt(ratio))}; sense less of it, or give what is beyond the bend a label of its own"
    )
    return _widened(feature, ratio), [note]


def _figure(value: float) -> str:
    return f"{value:.1f}" if value < 10 else f"{value:.0f}"


def _fit(
    measured: PointMeasurements, kind: str, label: str, rows: Sequence[int], tolerance: float
) -> tuple[Sides, FitReport]:
    points, covs, shared, radii = _sensed(measured, rows, tolerance)
    index, ids = np.array(rows), [measured.ids[row] for row in rows]
    if kind in ("edge", "vertex"):
        if radii.any():
            raise InputError(
                f"{kind} {label!r}: expected surface points, got centres of a ball of {1e3 * radii.max():g} mm, whose "
                f"contact on an edge is unknown. Sense the two faces beside it, or give points of the {kind} itself."
            )
        fit = fit_edge if kind == "edge" else fit_vertex
        one, report = fit(points, covs, label=label, readings=ids, shared=shared)
        return one, jointly(report, one, points, covs, shared, ids)
    if np.ptp(radii) > 1e-9:
        raise InputError(
            f"plane {label!r}: expected one tip radius, got {1e3 * radii.min():g} to {1e3 * radii.max():g} mm."
        )
    radius = float(radii[0])
    sides = _known_side(measured, index)
    if sides:
        feature, report = fit_plane(
            points,
            covs,
            radius=radius,
            label=label,
            readings=ids,
            shared=shared,
            **sides,
        )
        return replace(feature, tip_radius=radius), jointly(report, feature, points, covs, shared, ids, radius)
    normal = plane_ml(points, covs).T[:3, 2]
    both = [
        fit_plane(points, covs, outward=s * normal, radius=radius, label=label, readings=ids, shared=shared)
        for s in (1, -1)
    ]
    report = jointly(both[0][1], both[0][0], points, covs, shared, ids, radius)
    return (replace(both[0][0], tip_radius=radius), replace(both[1][0], tip_radius=radius)), report


def _sensed(
    measured: PointMeasurements, rows: Sequence[int], tolerance: float
) -> tuple[Vectors, Covariances, SharedReadings, FloatArray]:
    """Points of these rows, their covariances, the errors that they share, and the radii of their tips."""
    index = np.array(rows)
    # what other sensors share is no error of these readings
    shared = [(e, J[index]) for e, J in zip(measured.shared, measured.jacobians, strict=True) if J[index].any()]
    return measured.points[index], measured.covs[index] + tolerance**2 * np.eye(3), shared, measured.radii[index]


def _off(feature: Sides, measured: PointMeasurements, name: str) -> float:
    """Distance of a reading from a feature, across it [m]."""
    one = feature[0] if isinstance(feature, tuple) else feature
    row = measured.ids.index(name)
    local = SE3.apply(SE3.inverse(one.T_world_feature), measured.points[row])
    across = local[[i for i in one.kind.rows if i < 3]]
    return abs(float(np.linalg.norm(across)) - float(measured.radii[row]))


def _known_side(measured: PointMeasurements, index: IntArray) -> dict[str, np.ndarray]:
    """What tells the outward side of these rows: sensed normals, or the directions of approach."""
    for name, vectors in (("normals", measured.normals[index]), ("directions", measured.directions[index])):
        if np.isfinite(vectors).all(axis=1).any():
            return {name: vectors}
    return {}


def _widened(feature: Sides, ratio: float) -> Sides:
    """Covariance times ``ratio``: what the scatter of the readings says (Birge)."""
    if isinstance(feature, tuple):
        return replace(feature[0], P=ratio * feature[0].P), replace(feature[1], P=ratio * feature[1].P)
    return replace(feature, P=ratio * feature.P)


def _plane_at_point(measured: PointMeasurements, row: int, tolerance: float) -> Feature:
    """A point with its sensed normal as a plane that small."""
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
        gain = rows if rigid else np.vstack([normal @ J[row], np.zeros((2, J.shape[-1]))])
        terms.append(SharedTerm(error, gain))
    return Feature(PLANE, T, P, name, tuple(terms), point[None], (name,), float(measured.radii[row]))
