"""Recognize parts as published from labelled measurements, after a fit of features."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

from tanteo.errors import InputError
from tanteo.fitting import LabelledFeatures, fit_labelled
from tanteo.paper.recognition import identify_as_published
from tanteo.parts import Part
from tanteo.posterior import Answer
from tanteo.posterior.answers import with_elapsed
from tanteo.sensors import PointMeasurements, reading_kind
from tanteo.words.findings import LabelNotes, LabelsRejected, NoFeatures

_NOTES = 2
"""Largest number of notes on labels in a message."""


def identify_labelled_as_published(
    measured: PointMeasurements,
    parts: Sequence[Part],
    *,
    tolerance: float,
    significance: float,
    top: int,
    seed: int,
    placed: bool,
    seconds: float,
) -> Answer:
    """Return the parts that pass the constraints and tests of 1991, from features fitted to the labels.

    Args:
        measured: labelled points on planes, edges and vertices.
        parts: candidate parts.
        tolerance: standard deviation of the made surface from its CAD [m].
        significance: rejection percentage of each gate (25).
        top: number of hypotheses to report.
        seed: seed to report in the answer.
        placed: whether there is a pose prior, which the paper does not treat.
        seconds: time of the measurement model, to which the time of the fits is added [s].

    Raises:
        InputError: points without label, centres of round features, or a pose prior.
    """
    if any(reading_kind(kind).is_centre for kind in measured.kinds):
        raise InputError(
            "as_published: expected planes, edges and vertices, got centres of round features, which the paper does not"
            " have. Remove those rows, or as_published."
        )
    start = time.perf_counter()
    sensed = fit_labelled(measured, tolerance)
    if placed:
        raise InputError("as_published: expected no pose prior, got priors.pose. Remove it.")
    if len(sensed.unlabelled):
        raise InputError(
            "as_published: expected every reading to have a feature label, got some without. The paper compares "
            "sensed features; give rows taken on one face the same label."
        )
    seconds += time.perf_counter() - start
    if not sensed.features:
        return Answer(
            "insufficient", (NoFeatures(), _in_short(sensed.notes)), (), 1.0, {}, seed, significance=significance
        )
    answer = identify_as_published(sensed.features, parts, significance=significance, top=top)
    return _with_notes(with_elapsed(answer, measure=seconds), sensed)


def _with_notes(answer: Answer, sensed: LabelledFeatures) -> Answer:
    """Add readings excluded from their label to the outliers, and the notes to the message."""
    out, by = sensed.rejected, sensed.rejected_by
    hypotheses = tuple(
        replace(h, outliers=out + h.outliers, outlier_distances=by + h.outlier_distances) for h in answer.hypotheses
    )
    found = (*((LabelsRejected(out),) if out else ()), *((_in_short(sensed.notes),) if sensed.notes else ()))
    return replace(answer, hypotheses=hypotheses).adding(*found)


def _in_short(notes: Sequence[str]) -> LabelNotes:
    """Return the first notes and the number of the others."""
    return LabelNotes(tuple(notes[:_NOTES]), max(len(notes) - _NOTES, 0))
