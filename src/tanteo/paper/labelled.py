"""The same from labelled measurements: features are fitted to them first."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

from tanteo.errors import InputError
from tanteo.fitting import LabelledFeatures, fit_labelled
from tanteo.paper.recognition import identify_as_published
from tanteo.parts import Part
from tanteo.posterior import Answer, with_elapsed
from tanteo.sensors import PointMeasurements, reading_kind
from tanteo.words.findings import LabelNotes, LabelsRejected, NoFeatures

_NOTES = 2
"""Notes on labels that a message has; more of them say nothing new."""


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
    """Which of the parts pass the constraints and tests of 1991, by features fitted to the labels.

    Args:
        measured: planes, edges and vertices, every point labelled.
        parts: candidates.
        tolerance: sd of the made part's surface against its CAD [m].
        significance: rejection percentage of each gate (25).
        top: number of hypotheses to report.
        seed: that the answer names.
        placed: whether something is known of the pose, for which the paper has no place.
        seconds: that measuring took, which the answer tells with the time of the fits.

    Raises:
        InputError: what the paper has no place for: points without label, centres of round features, a known pose.
    """
    if any(reading_kind(kind).is_centre for kind in measured.kinds):
        raise InputError(
            "as_published: expected planes, edges and vertices, got centres of round features, which the paper does not"
            " have. Leave those rows out, or as_published."
        )
    start = time.perf_counter()
    sensed = fit_labelled(measured, tolerance)
    if placed:
        raise InputError("as_published: expected nothing known of the pose, got priors.pose. Leave it out.")
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
    """Add readings thrown out of their label to the outliers, and the notes to the message."""
    out, by = sensed.rejected, sensed.rejected_by
    hypotheses = tuple(
        replace(h, outliers=out + h.outliers, outlier_distances=by + h.outlier_distances) for h in answer.hypotheses
    )
    found = (*((LabelsRejected(out),) if out else ()), *((_in_short(sensed.notes),) if sensed.notes else ()))
    return replace(answer, hypotheses=hypotheses).adding(*found)


def _in_short(notes: Sequence[str]) -> LabelNotes:
    """Return the first notes, and how many more there are."""
    return LabelNotes(tuple(notes[:_NOTES]), max(len(notes) - _NOTES, 0))
