"""Feature of the readings of one label, without wrong readings, widened if they scatter or bend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tanteo.errors import DegenerateError, SideError
from tanteo.features import Feature, Sides, chi2_p_value
from tanteo.features.kinds import PLANE, FeatureKind
from tanteo.fitting.agreement import Bending, bending, residuals_of
from tanteo.fitting.estimate import FitReport
from tanteo.fitting.fits import FITS, LabelledPoints
from tanteo.fitting.sides import known_side, most_opposed
from tanteo.geometry.limits import SUSPECT
from tanteo.sensors import PointMeasurements, reading_kind


def fit_group(
    measured: PointMeasurements, label: str, rows: list[int], tolerance: float
) -> tuple[Sides, dict[str, float], list[str]]:
    """Fit one feature to the readings of a label, without wrong readings.

    Wrong readings are dropped. The covariance is widened if the surface bends or all readings scatter too much.

    Args:
        measured: points in the world.
        label: label of the readings.
        rows: rows of ``measured`` with this label.
        tolerance: sd of the made surface against its CAD [m].

    Returns:
        The feature, the distance of each dropped reading from it by id [m], and notes on why it was widened.

    Raises:
        DegenerateError: if the points do not determine the feature.
        SideError: if too many readings disagree about the outward side.
        InputError: for a ball tip on an edge or a vertex, or different tips.
    """
    name = measured.kinds[rows[0]]
    kind = reading_kind(name).feature
    assert kind is not None
    least = kind.min_readings
    if len(rows) < least:
        raise DegenerateError(f"{name} {label!r}: expected {least} points or more, got {len(rows)}. Sense more of it.")
    kept, fit = _on_one_side(measured, kind, label, rows, tolerance)
    feature, dropped, notes = _agreeing(measured, kind, label, kept, tolerance, *fit)
    other_side = (measured.ids[row] for row in rows if row not in kept)
    return feature, {name: _off(feature, measured, name) for name in other_side} | dropped, notes


def _on_one_side(
    measured: PointMeasurements, kind: FeatureKind, label: str, rows: Sequence[int], tolerance: float
) -> tuple[list[int], tuple[Sides, FitReport]]:
    """Return the rows of one side of a plane, and their fit; at most a quarter of the rows is excluded."""
    kept, least = list(rows), max(3, len(rows) - len(rows) // 4)
    while True:
        fit = unlike = None
        try:
            fit = _fit(measured, kind, label, kept, tolerance)
        except SideError as error:
            unlike = error
        if unlike is not None and kind.shape != "plane":  # normals of a round feature point in all directions
            raise unlike
        row, cosine = most_opposed(measured, kept) if kind.shape == "plane" else (kept[0], 1.0)
        astray = fit is None or (cosine < 0 and not _agrees(fit[1]))
        if astray and len(kept) > least:
            kept.remove(row)
        elif fit is not None:
            return kept, fit
        elif unlike is not None:
            raise unlike


def _agreeing(
    measured: PointMeasurements,
    kind: FeatureKind,
    label: str,
    rows: list[int],
    tolerance: float,
    feature: Sides,
    report: FitReport,
) -> tuple[Sides, dict[str, float], list[str]]:
    """Return the feature of readings of one side without wrong readings, as :func:`fit_group` does.

    Models are compared by their approximate evidence: each parameter costs twice the log of its prior over its
    posterior spread, and a wrong reading twice the log of the number of readings in addition.
    """
    least = kind.min_readings
    bend = _bending(measured, rows, tolerance, feature)
    if _agrees(report):
        return _unless_bent(label, feature, bend, {})
    kept, dropped, better, cleaned = list(rows), list[str](), report, feature
    while not _agrees(better) and len(kept) > least + 1 and len(dropped) < len(rows) // 4:
        dropped.append(better.worst)
        kept.remove(next(row for row in kept if measured.ids[row] == better.worst))
        cleaned, better = _fit(measured, kind, label, kept, tolerance)
    curved = _curved(report, bend)
    if dropped and _agrees(better) and not (curved and _prefers_bent(report, better, bend, len(dropped), len(rows))):
        off = {name: _off(cleaned, measured, name) for name in dropped}
        return _unless_bent(label, cleaned, _bending(measured, kept, tolerance, cleaned), off)
    if curved:
        return _unless_bent(label, feature, bend, {})
    return _scattered(label, feature, report, bend)


def _prefers_bent(report: FitReport, cleaned: FitReport, bend: Bending, dropped: int, count: int) -> bool:
    """Return whether a surface that bends explains the readings better than ``dropped`` wrong ones of ``count``.

    The criterion is that of :func:`_agreeing`.
    """
    size, choice = 2 * np.log(max(report.worst_sds, np.e)), 2 * np.log(count)
    return bool(report.chi2 - bend.gain + bend.dof * size <= cleaned.chi2 + dropped * (size + choice))


def _scattered(
    label: str, feature: Sides, report: FitReport, bend: Bending
) -> tuple[Sides, dict[str, float], list[str]]:
    """Return the feature with a covariance widened by the scatter of the readings."""
    ratio = max(report.chi2 / report.dof, bend.gain / max(bend.dof, 1), 1.0)
    note = (
        f"the readings of {label!r} scatter {_figure(np.sqrt(ratio))} times as much as stated: "
        f"its covariance was widened by that; check reading {report.worst}, {_figure(report.worst_sds)} sd off, "
        "and the standard deviation"
    )
    return _widened(feature, ratio), {}, [note]


def _agrees(report: FitReport) -> bool:
    """Return whether neither the joint test of all readings nor that of the worst one rejects the fit."""
    return min(report.p_value, report.p_worst) >= SUSPECT


def _curved(report: FitReport, bend: Bending) -> bool:
    """Return whether a surface that bends fits the readings, with degrees of freedom left for its test."""
    left = report.dof - bend.dof
    return bool(bend.p_value < SUSPECT and left and chi2_p_value(np.asarray(report.chi2 - bend.gain), left) >= SUSPECT)


def _bending(measured: PointMeasurements, rows: Sequence[int], tolerance: float, feature: Sides) -> Bending:
    """Return the improvement of a bent surface on these rows; none if the feature is not a plane."""
    plane = feature[0] if isinstance(feature, tuple) else feature
    if plane.kind is not PLANE:
        return Bending(0.0, 0, 1.0)
    sensed = _sensed(measured, plane.label, rows, tolerance)
    return bending(plane, sensed.points, sensed.covs, sensed.shared, float(sensed.radii[0]))


def _unless_bent(
    label: str, feature: Sides, bend: Bending, dropped: dict[str, float]
) -> tuple[Sides, dict[str, float], list[str]]:
    """Return the feature, widened if the surface bends."""
    if bend.p_value >= SUSPECT:
        return feature, dropped, []
    ratio = bend.gain / bend.dof
    note = (
        f"the readings of {label!r} are on a curved surface: its covariance was widened by "
        f"{_figure(np.sqrt(ratio))}; sense less of it, or give what is beyond the bend a label of its own"
    )
    return _widened(feature, ratio), dropped, [note]


def _figure(value: float) -> str:
    return f"{value:.1f}" if value < 10 else f"{value:.0f}"


def _fit(
    measured: PointMeasurements, kind: FeatureKind, label: str, rows: Sequence[int], tolerance: float
) -> tuple[Sides, FitReport]:
    return FITS[kind.name](_sensed(measured, label, rows, tolerance))


def _sensed(measured: PointMeasurements, label: str, rows: Sequence[int], tolerance: float) -> LabelledPoints:
    """Return the points of these rows."""
    index = np.array(rows)
    # errors that only other sensors share do not affect these readings
    shared = [(e, J[index]) for e, J in zip(measured.shared, measured.jacobians, strict=True) if J[index].any()]
    ids = tuple(measured.ids[row] for row in rows)
    covs = measured.covs[index] + tolerance**2 * np.eye(3)
    side = known_side(measured, rows)
    # a ball's radius subtracted along a normal already moved the point: the normal must not count twice
    sds = np.where(measured.subtracted_radii[index] > 0, np.nan, measured.normal_sds[index])
    return LabelledPoints(label, ids, measured.points[index], covs, shared, measured.radii[index], side, sds)


def _off(feature: Sides, measured: PointMeasurements, name: str) -> float:
    """Return the distance of a reading from a feature, across it [m]."""
    one = feature[0] if isinstance(feature, tuple) else feature
    row = measured.ids.index(name)
    across = residuals_of(one, measured.points[row][None], float(measured.radii[row])).f
    return float(np.linalg.norm(across))


def _widened(feature: Sides, ratio: float) -> Sides:
    """Return a covariance times the Birge ratio of the scatter of the readings."""
    if isinstance(feature, tuple):
        return _wider(feature[0], ratio), _wider(feature[1], ratio)
    return _wider(feature, ratio)


def _wider(feature: Feature, ratio: float) -> Feature:
    size = feature.size
    if size is not None:
        size = replace(size, variance=ratio * size.variance, covariance=ratio * size.covariance)
    return replace(feature, P=ratio * feature.P, size=size)
