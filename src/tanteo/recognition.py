"""From readings to the answer: measure, fit what the labels say, recognise."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from tanteo.errors import InputError
from tanteo.fitting import LabelledFeatures, fit_labelled
from tanteo.limits import check_length
from tanteo.matching.evidence import Priors, sized
from tanteo.matching.recognition import check_question, identify_features, with_elapsed
from tanteo.matching.results import Recognition
from tanteo.parts import Part
from tanteo.parts.several import as_part
from tanteo.remarks import as_model, remarks
from tanteo.sensors import (
    PointMeasurements,
    Readings,
    Rig,
    RobotPreset,
    SensorPreset,
    measure,
)
from tanteo.surface_search import (
    FreePaths,
    Touches,
    as_free_paths,
    as_touches,
    bend,
    identify_touches,
    log_free_paths,
)

_NOTES = 2
"""Notes on labels that a message has; more of them say nothing new."""

_BENT = 3.0
"""Standard deviations by which shared errors may bend the readings of one face until labels are not fitted.

A fitted face takes such an error once, to first order; the search over the surface settles it with the pose.
"""

_UNUSED = {
    "bent": "Labels were not used: what all readings share, the tip or a sensor, may be off by many times their noise.",
    "bare": "Labels were not used: some readings have none. Label them too, or leave them out.",
    "few": "Labels were not used: some have too few readings to be fitted.",
}
"""Why the surface was searched although readings have labels."""

_DOUBT_PRIOR = "What was said of the pose beforehand counts, too: check it, or leave it out and compare."


def identify(
    readings: Readings,
    parts: Sequence[Part],
    *,
    sensor: SensorPreset | str | None = None,
    sd: float | None = None,
    tolerance: float = 0.0,
    robot: RobotPreset | str | None = None,
    tip_sd: npt.ArrayLike | None = None,
    rig: Rig | None = None,
    alpha: float = 0.01,
    top: int = 5,
    as_published: bool = False,
    priors: Priors | None = None,
    seed: int = 0,
) -> Recognition:
    """Which of the parts was sensed, and where it is.

    Readings with a label, and single ones with a sensed normal, become features, which the interpretation tree matches.
    If any reading has neither, all go against the whole surface of every part; likewise where labels cannot be used,
    which the message says with the reason: too few readings of a face beside a rough pose, or shared errors that bend
    faces.

    Args:
        readings: what the devices said; see ``tanteo.io.read_readings``.
        parts: candidates; see ``tanteo.catalogue.read_parts``.
        sensor: preset for readings without an sd of their own.
        sd: one standard deviation of a point along beam or normal [m], for the same.
        tolerance: sd of the made part's surface against its CAD [m].
        robot: preset of robot errors; its absolute error is shared by all readings.
        tip_sd: sds of the tip's offset in the hand's frame [m], one draw for the run.
        rig: where range sensors sit on the hand.
        alpha: an answer whose joint test has a smaller p-value is not accepted.
        top: number of hypotheses to report.
        as_published: use the constraints and tests of the 1991 paper as printed, for comparison.
        priors: what is assumed beforehand: clutter, workspace, a rough pose, a box, a table.
        seed: of the search.

    Returns:
        The answer with its status; an unkind world is not an exception.

    Raises:
        InputError: if an argument or the readings cannot be what was meant.
    """
    start = time.perf_counter()
    check_length("tolerance", tolerance)
    parts = check_question(parts, alpha, top, seed, priors)
    measured = measure(readings, sensor=sensor, robot=robot, sd=sd, tip_sd=tip_sd, rig=rig)
    sensed = fit_labelled(measured, tolerance)
    touches = as_touches(measured, tolerance, readings.ranges[measured.rows])
    bare = bool(len(sensed.bare)) or _single_points(sensed)
    placed = priors is not None and priors.pose is not None
    if as_published:
        _require_labels_alone(bare=bare, placed=placed)
    free = as_free_paths(measured, tolerance) if not as_published else FreePaths.none()
    elapsed = time.perf_counter() - start
    if why := _unlabelled(measured, touches, sensed, bare=bare, placed=placed) if not as_published else "":
        answer = identify_touches(
            touches, free, parts, shared=measured.shared, alpha=alpha, top=top, priors=priors, seed=seed
        )
        unused = _UNUSED[why] if any(measured.features) else ""
        says = unused, *remarks(answer, readings, measured, free, parts)
        return with_elapsed(_said(answer, *says, placed=placed), measure=elapsed)
    if not sensed.features:
        reasons = _in_short(sensed.notes) or "There is no reading that met anything."
        return Recognition("insufficient", f"No feature could be made of the readings. {reasons}", (), 1.0, {}, seed)
    models = [as_model(part) for part in parts]
    assumed = sized(priors, max((model.radius for model in models), default=0.0))
    answer = identify_features(
        sensed.features,
        models,
        tolerance=tolerance,
        alpha=alpha,
        top=top,
        as_published=as_published,
        priors=priors,
        seed=seed,
        beside=(lambda model, Ts, z: log_free_paths(free, Ts, z, model, assumed)) if len(free) else None,
        shared=measured.shared,
    )
    notes = remarks(answer, readings, measured, free, parts)
    return _with_notes(with_elapsed(_said(answer, *notes, placed=placed), measure=elapsed), sensed)


def _unlabelled(
    measured: PointMeasurements, touches: Touches, sensed: LabelledFeatures, *, bare: bool, placed: bool
) -> str:
    """Why the surface is searched, not labels matched: a key of :data:`_UNUSED`; empty if labels are matched."""
    if bare:
        return "bare"
    fitted = {i for f in sensed.features for i in (f[0] if isinstance(f, tuple) else f).readings} | {*sensed.rejected}
    if placed and not (fitted and fitted.issuperset(measured.ids)):
        return "few"
    labels, kinds = np.array(measured.features, dtype=object), np.array(measured.kinds, dtype=object)
    faces = [np.flatnonzero(labels == name) for name in dict.fromkeys(labels[~np.isin(kinds, ["edge", "vertex"])])]
    return "bent" if any(bend(touches.take(rows)) > _BENT for rows in faces) else ""


def _said(answer: Recognition, *notes: str, placed: bool) -> Recognition:
    """The answer with what its message should add."""
    doubt = _DOUBT_PRIOR if answer.status == "unknown" and placed and "beforehand" not in answer.message else ""
    return replace(answer, message=" ".join(filter(None, [answer.message, doubt, *notes])))


def _require_labels_alone(*, bare: bool, placed: bool) -> None:
    """The paper compares features that were sensed, and nothing else."""
    if placed:
        raise InputError("as_published: expected nothing known of the pose, got priors.pose. Leave it out.")
    if bare:
        raise InputError(
            "as_published: expected every reading to have a feature label, got some without. The paper compares "
            "sensed features; give rows taken on one face the same label."
        )


def locate(readings: Readings, part: Part, **options: object) -> Recognition:
    """Where the part is, given that it is this one (or none): :func:`identify` with one part, and its other arguments.

    Raises:
        InputError: as :func:`identify`; or several parts.
    """
    return identify(readings, [as_part("part", part)], **options)  # type: ignore[arg-type]


def _single_points(sensed: LabelledFeatures) -> bool:
    """Whether every feature is one point with its normal: then the surface, not the list of planes, is the model."""
    features = [f[0] if isinstance(f, tuple) else f for f in sensed.features]
    return bool(features) and all(f.kind.name == "plane" and len(f.readings) == 1 for f in features)


def _with_notes(answer: Recognition, sensed: LabelledFeatures) -> Recognition:
    """Add readings thrown out of their label to the outliers, and the notes to the message."""
    hypotheses = tuple(
        replace(
            h,
            outliers=sensed.rejected + h.outliers,
            outlier_distances=sensed.rejected_by + h.outlier_distances,
        )
        for h in answer.hypotheses
    )
    notes = [_left_out(sensed.rejected)] if sensed.rejected else []
    message = " ".join([answer.message, *notes, _in_short(sensed.notes)]).rstrip()
    return replace(answer, hypotheses=hypotheses, message=message)


def _left_out(names: Sequence[str]) -> str:
    if len(names) == 1:
        return f"Reading {names[0]} disagrees with its label and was left out."
    return f"Readings {', '.join(names)} disagree with their labels and were left out."


def _in_short(notes: Sequence[str]) -> str:
    """The first notes as sentences, and how many more there are."""
    rest = len(notes) - _NOTES
    more = [f"And {rest} more label{'s' * (rest > 1)} likewise."] if rest > 0 else []
    return " ".join([*map(_sentence, notes[:_NOTES]), *more])


def _sentence(note: str) -> str:
    return f"{note[0].upper()}{note[1:].rstrip('.')}."
