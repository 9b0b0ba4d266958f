"""Findings about the input: units, spreads, directions, repeats, a stuck sensor, free rays through the part.

Each is a typed :class:`tanteo.words.Finding`. These checks need no search;
``convention_checks`` has those that do.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from tanteo.errors import ReadingsError
from tanteo.factors import FreeRays
from tanteo.geometry.typing import Covariances, FloatArray, Vectors
from tanteo.parts import Part, part_named
from tanteo.parts.readers import METRES
from tanteo.posterior.answers.results import Answer, Hypothesis
from tanteo.posterior.candidates import Candidates, sizes_of
from tanteo.posterior.free_space import gone_through
from tanteo.posterior.prepared import prepare
from tanteo.posterior.settings import DEFAULTS, FEWEST, CheckSettings, Settings
from tanteo.posterior.touched_region import LARGER
from tanteo.sensors import PointMeasurements, Readings
from tanteo.sensors.anomalies import find_repeated, find_stuck
from tanteo.sensors.error_states import ErrorState
from tanteo.words import Finding
from tanteo.words.findings import (  # fmt: skip
    DirectionsQuestion,
    FreeSpaceCrossed,
    NormalsQuestion,
    OpenSurface,
    SharedEstimates,
    SpreadQuestion,
    TooFarApart,
    TooNarrow,
    UnitsQuestion,
)
from tanteo.words.sentences import size_advice

UNITS = {unit: METRES[unit] for unit in ("mm", "m", "um", "in")}
"""Units of columns, and of part files, in metres."""


@dataclass(frozen=True, slots=True)
class Scale:
    """Sizes of readings and parts, and the units with which they were read.

    Attributes:
        span: extent of the readings [m].
        sizes: diagonals of the parts [m].
        column: unit in the names of the readings' columns; empty if not known.
        option: stated unit of the parts; empty if their files have their own.
    """

    span: float
    sizes: tuple[float, ...]
    column: str = ""
    option: str = ""


def scale_of(points: Vectors, parts: Any, column: str = "", option: str = "") -> Scale:
    """Return the sizes of points and parts, and the units with which they were read.

    Args:
        points: points of the readings ``(n, 3)`` [m].
        parts: list of parts, or catalogue.
        column: unit in the names of the readings' columns; empty if not known.
        option: stated unit of the parts; empty if their files have their own.
    """
    span = 2 * float(np.median(_away(points))) if len(points) >= FEWEST else 0.0
    return Scale(span, sizes_of(parts), column, option)


def about_readings(
    answer: Answer,
    readings: Readings,
    measured: PointMeasurements,
    free: FreeRays,
    parts: Sequence[Part],
    settings: Settings = DEFAULTS,
) -> tuple[Finding, ...]:
    """Return findings about the readings, given an answer.

    Args:
        answer: the answer from these readings.
        readings: readings as the devices reported them.
        measured: measurements made from the readings.
        free: free-space rays.
        parts: candidate parts, prepared or not.
        settings: settings of the inference.
    """
    found: tuple[Finding | None, ...] = (
        _gone_through(answer, free, measured.free.ids, parts, settings),
        find_repeated(measured),
        find_stuck(readings),
        _too_wide(answer, measured, parts, settings.checks),
        _open_surface(answer, parts),
    )
    return tuple(one for one in found if one is not None)


_MOST_ESTIMATES = 24
"""Definition: largest number of states of shared errors that are reported."""


def estimates_of(
    answer: Answer, measured: PointMeasurements, errors: Sequence[ErrorState], others: int = 0
) -> tuple[Finding, ...]:
    """Return the finding with the estimates of stated shared errors in the best hypothesis; none without any.

    Args:
        answer: the answer.
        measured: measurements, whose last shared errors are the stated ones, followed by others.
        errors: stated errors.
        others: number of shared errors after the stated ones.
    """
    if not errors or answer.status == "unknown" or answer.best is None or answer.best.shared is None:
        return ()
    names, values, units, sds, priors = list[str](), list[float](), list[str](), list[float](), list[float]()
    mean, covariance = shared_estimates(answer.best)
    first = len(measured.shared) - others - len(errors)
    own = slice(first, first + len(errors))
    begin = start = len(mean) - sum(len(one.covariance) for one in measured.shared[first:])
    for error, shared, jacobian in zip(errors, measured.shared[own], measured.jacobians[own], strict=True):
        rows = range(start, start := start + len(shared.covariance))
        faces = faces_of(answer.best, measured, jacobian)
        names += [_on_face(name, face) for name, face in zip(shared.states, faces, strict=True)]
        own_mean, own_sd = mean[list(rows)], np.sqrt(np.diagonal(covariance)[list(rows)])
        values += error.amounts(own_mean).tolist()
        sds += (0.5 * (error.amounts(own_mean + own_sd) - error.amounts(own_mean - own_sd))).tolist()
        units += [error.unit] * len(rows)
        priors += [error.sd * error.spread] * len(rows)
    if not names or len(names) > _MOST_ESTIMATES:
        return ()
    return (SharedEstimates(tuple(names), tuple(values), tuple(sds), tuple(units), tuple(priors), begin),)


def shared_estimates(best: Hypothesis) -> tuple[FloatArray, FloatArray]:
    """Return mean and marginal covariance of the whitened shared errors of a hypothesis ``(D,)``, ``(D, D)``."""
    shared = best.shared
    assert shared is not None
    assert shared.marginal is not None
    return shared.mean, shared.marginal


def faces_of(best: Hypothesis, measured: PointMeasurements, jacobian: FloatArray) -> list[str]:
    """Return the face that the readings of each state of a shared error are on; empty if they are on several.

    Args:
        best: hypothesis with its pairings.
        measured: the measurements.
        jacobian: derivative of the points by the states ``(n, 3, d)``.
    """
    paired = dict(best.pairings)
    out = list[str]()
    for k in range(jacobian.shape[2]):
        rows = np.flatnonzero(jacobian[:, :, k].any(axis=1))
        faces = Counter(paired[measured.ids[row]] for row in rows if measured.ids[row] in paired)
        face, count = faces.most_common(1)[0] if faces else ("", 0)
        out.append(face if len(rows) < len(measured) and count > 0.5 * len(rows) else "")
    return out


def _on_face(name: str, face: str) -> str:
    """Return the name of a state with the face of its readings."""
    return re.sub(r"the face approached along \(.*\)", face, name) if face else name


def about_frames(
    answer: Answer,
    readings: Readings,
    scale: Scale,
    measured: PointMeasurements,
    checks: CheckSettings = DEFAULTS.checks,
) -> Finding | None:
    """Return the finding about a probably wrong unit or direction; None if a part explains the readings.

    Only directions that the readings state are examined: that of a beam follows from the rig.

    Args:
        answer: answer from these readings.
        readings: readings as the devices reported them.
        scale: sizes of readings and parts.
        measured: measurements made from the readings.
        checks: limits of the checks.
    """
    if answer.status != "unknown":
        return None
    stated = readings.directions.given[measured.rows, None]
    directions = np.where(stated, measured.directions, np.nan)
    return (
        about_units(scale, checks)
        or about_directions(measured.points, directions, checks)
        or about_normals(measured.normals, directions, checks)
    )


def about_units(scale: Scale, checks: CheckSettings = DEFAULTS.checks) -> UnitsQuestion | None:
    """Return the finding about units with which readings and parts would be equally large; None without any.

    Args:
        scale: sizes of readings and parts, and their units.
        checks: limits of the checks.
    """
    if not scale.span or fits_size(scale.span, scale.sizes, checks):
        return None
    columns, files = list[str](), list[str]()
    for column, option in product(_others(scale.column), _others(scale.option)):
        span = scale.span * UNITS.get(column, 1) / UNITS.get(scale.column, 1)
        sizes = [size * UNITS.get(option, 1) / UNITS.get(scale.option, 1) for size in scale.sizes]
        if (column == scale.column) != (option == scale.option) and fits_size(span, sizes, checks):
            if option != scale.option:
                files.append(option)
            else:
                columns.append(column)
    if not columns and not files:
        return None
    return UnitsQuestion(max(scale.sizes), len(scale.sizes), scale.span, tuple(columns), tuple(files))


def about_size(points: Vectors, scale: Scale, checks: CheckSettings = DEFAULTS.checks) -> TooNarrow | None:
    """Return the finding that all readings are too close together for these parts; None if they are not.

    Args:
        points: points of the readings ``(n, 3)`` [m].
        scale: sizes of readings and parts.
        checks: limits of the checks.

    Raises:
        ReadingsError: the readings are far wider than any part.
    """
    if len(points) < FEWEST:
        return None
    away = _away(points)
    largest, smallest = max(scale.sizes), min(scale.sizes)
    units = about_units(scale, checks)
    if np.median(away) > checks.too_wide * largest:
        raise ReadingsError(
            f"readings: expected points around a part of {largest * 1e3:.4g} mm or less, got half of them more than "
            f"{np.median(away) * 1e3:.4g} mm from their middle. {size_advice(units)}"
        )
    if away.max() >= DEFAULTS.checks.too_narrow * smallest:
        return None
    return TooNarrow(float(away.max()), smallest, units)


def about_spread(covs: Covariances, scale: Scale, checks: CheckSettings = DEFAULTS.checks) -> Finding | None:
    """Return the finding about an implausible standard deviation; None if it is plausible.

    Args:
        covs: covariance of each point ``(n, 3, 3)`` [m^2].
        scale: sizes of readings and parts.
        checks: limits of the checks.
    """
    if not len(covs):
        return None
    sd = float(np.median(np.sqrt(np.trace(covs, axis1=1, axis2=2) / 3)))
    if checks.finest <= sd <= DEFAULTS.checks.coarsest * max(scale.sizes):
        return None
    return SpreadQuestion(sd, max(scale.sizes) if sd > checks.finest else float("nan"))


def about_directions(points: Vectors, directions: Vectors, checks: CheckSettings = DEFAULTS.checks) -> Finding | None:
    """Return the finding that most approach directions point outward; None if they do not.

    Args:
        points: points of the readings ``(n, 3)`` [m].
        directions: approach direction of each point ``(n, 3)``; NaN where unknown. A direction away from the middle of
            the points is outward.
        checks: limits of the checks.
    """
    known = np.isfinite(directions).all(axis=1)
    if known.sum() < FEWEST:
        return None
    inward = np.median(points[known], axis=0) - points[known]
    cosines = np.sum(inward * directions[known], axis=1) / np.linalg.norm(inward, axis=1).clip(1e-12)
    if cosines.mean() > -checks.outward:
        return None
    return DirectionsQuestion(float(np.mean(cosines < 0)))


def about_normals(normals: Vectors, directions: Vectors, checks: CheckSettings = DEFAULTS.checks) -> Finding | None:
    """Return the finding that sensed normals point into the material; None if they do not.

    Args:
        normals: sensed normal of each point ``(n, 3)``; NaN where unknown.
        directions: approach direction of each point ``(n, 3)``; NaN where unknown.
        checks: limits of the checks.
    """
    cosines = np.sum(normals * directions, axis=1)
    known = cosines[np.isfinite(cosines)]
    if len(known) < FEWEST or np.mean(known > 0) <= 1 - checks.outward:
        return None
    return NormalsQuestion(float(np.mean(known > 0)))


def _gone_through(
    answer: Answer, free: FreeRays, ids: Sequence[str], parts: Sequence[Part], settings: Settings
) -> FreeSpaceCrossed | None:
    """Return the finding about free-space rays that the best part surely blocks; None if it blocks none."""
    if not answer.hypotheses or not len(free):
        return None
    best = answer.hypotheses[0]
    part = prepare(part_named(parts, best.part))
    short = gone_through(free, best.T_world_part, best.covariance, best.shared, part, settings)
    rows = np.flatnonzero(short > 0)[np.argsort(-short[short > 0], kind="stable")]
    if not len(rows):
        return None
    named, lengths = tuple(ids[k] for k in rows), tuple(float(short[k]) for k in rows)
    return FreeSpaceCrossed(best.part, named, lengths, len(ids))


def _too_wide(
    answer: Answer, measured: PointMeasurements, parts: Sequence[Part], checks: CheckSettings
) -> TooFarApart | None:
    """Return the finding that readings which fit no part are farther apart than any part; None if they are not."""
    if answer.status != "unknown" or not len(measured.points):
        return None
    away = float(np.median(np.linalg.norm(measured.points - np.median(measured.points, axis=0), axis=1)))
    widest = 2 * float(Candidates(parts).radii.max())
    if away <= DEFAULTS.checks.too_wide * widest:
        return None
    return TooFarApart(away, widest)


def _open_surface(answer: Answer, parts: Sequence[Part]) -> OpenSurface | None:
    """Return the finding that the best part has gaps, to which undecided readings may belong; None without any."""
    best = answer.hypotheses[0] if answer.hypotheses else None
    if answer.status not in ("unknown", "ambiguous") or best is None or not best.outliers:
        return None
    return None if prepare(part_named(parts, best.part)).part.closed else OpenSurface(best.part)


def _away(points: Vectors) -> FloatArray:
    """Return the distances of points from their middle ``(n,)`` [m]."""
    return np.asarray(np.linalg.norm(points - np.median(points, axis=0), axis=1))


def _others(unit: str) -> tuple[str, ...]:
    """Return the unit and those with which it may be confused; the unit alone if none was stated."""
    return (unit, *(u for u in UNITS if u != unit)) if unit else (unit,)


def fits_size(span: float, sizes: Sequence[float], checks: CheckSettings = DEFAULTS.checks) -> bool:
    """Return whether readings with a span can be on a part of one of the sizes.

    Args:
        span: extent of the readings [m].
        sizes: diagonals of the parts [m].
        checks: limits of the checks.
    """
    size = np.asarray(sizes)
    ratio = span / size
    wide = (checks.least_span <= ratio) & (ratio <= LARGER)
    return bool(np.any(wide & (checks.smallest_part <= size) & (size <= checks.largest_part)))
