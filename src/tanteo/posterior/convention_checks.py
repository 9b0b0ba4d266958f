"""Checks of conventions: if the readings fit no part, undo usual mistakes one by one and search again.

A mistake of convention moves everything far, so only one interpretation of the numbers fits. The finding names it and
never applies it: only the author of the file can decide what the numbers mean.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from tanteo.defaults import SIGNIFICANCE
from tanteo.errors import TanteoError
from tanteo.geometry import SE3
from tanteo.geometry.limits import NOTABLE
from tanteo.parts import Part, part_named
from tanteo.parts.readers import mirror_part
from tanteo.posterior.answers.priors import STATED
from tanteo.posterior.answers.results import Answer
from tanteo.posterior.candidates import Candidates, sizes_of
from tanteo.posterior.conventions import HANDS, OTHERS, Mistake, of_rig
from tanteo.posterior.findings import fits_size, scale_of, shared_estimates
from tanteo.posterior.outliers import beta_binomial_tail
from tanteo.posterior.prepared import prepare
from tanteo.posterior.problem import Problem
from tanteo.posterior.settings import DEFAULTS, Settings
from tanteo.posterior.trial_fit import TrialFit, trial_fits
from tanteo.sensors import Column, Readings, Rig, reading_kind, thinned
from tanteo.sensors.error_states import ErrorState, Offset, OffsetByGroup, Scale, Stock
from tanteo.words import Finding
from tanteo.words.findings import (  # fmt: skip
    Convention,
    DirectionsConvention,
    MirrorConvention,
    MirrorQuestion,
    OffsetQuestion,
    ResponseConvention,
    ScaleQuestion,
    SharedEstimates,
    UnitsConvention,
)

_SHARED_SD = 0.03
"""Standard deviation of an unstated scale, and of an unstated offset over the size of the largest part."""

_CHANCE = 1e-6
"""Definition: significance of an unstated error or mistake, one in 500 over 2,000 poses."""


_GRAZING = 0.02
"""Definition: least cosine of incidence at which a touch or beam measures a face, as in the core."""


class Query(Protocol):
    """Options of an inference, with which it is repeated for other readings."""

    @property
    def rig(self) -> Rig | None:
        """Range sensors on the hand; None if there are none."""

    def with_rig(self, rig: Rig) -> Query:
        """Return the options with another rig."""

    def problem(self, readings: Readings, parts: Sequence[Part]) -> tuple[Problem, Candidates]:
        """Return the measurements and priors of the inference for other readings, and its candidate parts."""

    def answer(
        self,
        readings: Readings,
        parts: Sequence[Part],
        *,
        shared_errors: Sequence[ErrorState] = (),
        outlier_rate: float | None = None,
        anywhere: bool = False,
        settings: Settings | None = None,
    ) -> Answer:
        """Return the answer for other readings or parts, without checks of conventions.

        Args:
            readings: the readings.
            parts: the candidates.
            shared_errors: errors that the readings share, in addition to those of the first inference.
            outlier_rate: rate of outliers; None for that of the first inference.
            anywhere: whether to omit the prior pose and the box; a table remains.
            settings: settings of the search; None for those of the first inference.
        """


def about_conventions(
    answer: Answer,
    readings: Readings,
    parts: Sequence[Part],
    question: Query,
    *,
    placed: bool = False,
    settings: Settings = DEFAULTS,
) -> Finding | None:
    """Return the usual mistake that explains readings that fit no part, or fit badly; None if there is none.

    Each mistake is first tested by a robust fit of the points (:mod:`tanteo.posterior.trial_fit`); only if the fit
    explains them, the search is repeated, with the parts that explain them and few rounds. Of readings that are too few
    for a pose only the unit is checked: they fit under many mistakes.

    Args:
        answer: answer from the unchanged readings.
        readings: the readings.
        parts: the candidates.
        question: options of the inference that gave the answer.
        placed: whether the pose has a prior, which a mirrored part would not satisfy.
        settings: settings of the inference.
    """
    some = thinned(readings, settings.search.few_points)
    found: Convention | OffsetQuestion | ScaleQuestion | None = None
    if answer.status != "recognized" and not (placed or _is_of_size(readings, parts, settings)):
        # in another unit they would cover a small patch, which fits anywhere, also with an offset
        units = [way for way in OTHERS if way.finding is UnitsConvention]
        found = _about_ways(units, some, parts, question, settings)
    if not is_bad(answer, settings):
        return found or (None if placed else _about_image(answer, readings, parts, question, settings))
    if found is None and answer.hypotheses and not _may_fix(answer, readings, parts, question):
        return None
    others = [way for way in OTHERS if way.finding is not UnitsConvention]
    others = [way for way in others if not (placed and way.finding is MirrorConvention)]
    found = (
        found
        or _about_ways((*HANDS, *of_rig(question.rig)), some, parts, question, settings)
        or _about_response(some, parts, question, settings)
        or _about_shared(answer, some, parts, question, settings)
        or _about_ways(others, some, parts, question, settings)
    )
    if found is None or len(some) == len(readings):
        return found
    return replace(found, given=len(readings))


def _may_fix(answer: Answer, readings: Readings, parts: Sequence[Part], question: Query) -> bool:
    """Return whether the readings are enough for a pose of the best part."""
    best = part_named(parts, answer.hypotheses[0].part)
    return best is None or question.problem(readings, parts)[0].may_fix(getattr(best, "part", best))


def _is_of_size(readings: Readings, parts: Sequence[Part], settings: Settings) -> bool:
    """Return whether the points, if there are some, have an extent that one of the parts may have."""
    points = readings.points.values
    scale = scale_of(points, parts)
    return not len(points) or fits_size(scale.span, scale.sizes, settings.checks)


def _about_ways(
    ways: Sequence[Mistake], readings: Readings, parts: Sequence[Part], question: Query, settings: Settings
) -> Convention | None:
    """Return the first interpretation of the numbers that fits; None if there is none."""
    for way in ways:
        meant = way.undo(readings)
        if meant is None or (way.finding is UnitsConvention and not _is_of_size(meant, parts, settings)):
            continue
        found = _answer_to(question, meant, parts, settings)
        if found is None or not fits(found, settings):
            continue
        if way.finding is not DirectionsConvention or _contradict(found, meant, readings, parts, question):
            return way.finding(*_fitting(found), way.mistake)
    return None


def _contradict(found: Answer, meant: Readings, readings: Readings, parts: Sequence[Part], question: Query) -> bool:
    """Return whether more directions contradict the pose that was found with other ones than outliers explain.

    A direction contradicts it if it points along or out of the nearest face, or if the part is in its way. A pose that
    fits by chance is no reason: each redundant residual is within two sds with their ratio to the part's size, and
    each direction points into the part with a probability of a half.
    """
    best = found.hypotheses[0]
    part = part_named(parts, best.part)
    if part is None:
        return True
    prepared, T = prepare(part), SE3.inverse(best.T_world_part)
    sd = best.rms * math.sqrt(len(best.pairings) / best.dof)
    chance = min(4 * sd / prepared.part.diagonal, 1.0) ** best.dof * 0.5 ** int(meant.directions.given.sum())
    if chance > _CHANCE:
        return False
    rows = np.flatnonzero(readings.directions.given & readings.points.given & ~readings.is_free)
    if not len(rows):
        return True
    p, d = SE3.apply(T, readings.points[rows]), readings.directions[rows] @ T[:3, :3].T
    near = prepared.surface.closest(p)
    far = 2 * prepared.part.diagonal
    ahead = prepared.surface.cast(p - far * d, d).distances
    off = np.abs(near.distances) / _GRAZING  # along the approach, of a ball that stops before the surface, or noise
    wrong = (np.sum(d * prepared.surface.normals[near.triangles], axis=1) > -_GRAZING) | (ahead < far - off)
    rate = question.problem(readings, parts)[0].priors.outlier_rate
    return beta_binomial_tail(int(wrong.sum()), len(rows), rate) < SIGNIFICANCE


def _about_response(
    readings: Readings, parts: Sequence[Part], question: Query, settings: Settings
) -> ResponseConvention | None:
    """Return the response of the devices with which the readings fit best, other than the stated one; None if none."""
    rig = question.rig
    if rig is None:
        return None
    factors, found = question.problem(readings, parts)[0].points.factors, list[tuple[float, Answer, str]]()
    for response in dict.fromkeys(name for factor in factors for name in factor.other_responses):
        meant = _answer_to(question.with_rig(rig.with_response(response)), readings, parts, settings)
        if meant is not None and fits(meant, settings):
            found.append((meant.unknown_probability, meant, response))
    if not found:
        return None
    _, meant, response = min(found, key=lambda one: one[0])
    return ResponseConvention(*_fitting(meant), f"response_{response}")


def is_bad(answer: Answer, settings: Settings = DEFAULTS) -> bool:
    """Return whether no part explains the readings, or one does with many outliers or much noise."""
    best = answer.best or (answer.hypotheses[0] if answer.hypotheses else None)
    if answer.status == "unknown" or best is None:
        return answer.status == "unknown"
    readings = len(best.outliers) + len(best.pairings)
    return best.noise_scale[1] > STATED["typed"] or len(best.pairings) < settings.search.explained * readings


def fits(answer: Answer, settings: Settings = DEFAULTS) -> bool:
    """Return whether a part explains the readings without many outliers or much noise."""
    if answer.status not in ("recognized", "ambiguous", "insufficient") or not answer.hypotheses:
        return False
    best = answer.hypotheses[0]
    return answer.unknown_probability < 0.5 and not is_bad(answer, settings) and best.dof > 0


def _answer_to(question: Query, readings: Readings, parts: Sequence[Part], settings: Settings) -> Answer | None:
    """Return the answer to other readings, if a trial fit explains most of the points.

    None also if the other readings are invalid.
    """
    try:
        trials = trial_fits(*question.problem(readings, parts))
        kept = [trial.part.part for trial in trials if not trial.rejects(settings.search.explained)]
        if not trials:
            return question.answer(readings, parts, settings=settings)
        if not kept:
            return None
        return _as_of_all(question.answer(readings, kept, settings=settings.brief), len(kept), len(parts))
    except TanteoError:
        return None


def _as_of_all(answer: Answer, searched: int, count: int) -> Answer:
    """Return the answer of some parts with the probability of an unknown object as if all parts had been candidates.

    The prior probability of a known part is shared by the candidates, so each searched part has more of it.

    Args:
        answer: answer of the searched parts.
        searched: number of these parts.
        count: number of all parts.
    """
    unknown, known = answer.unknown_probability * count, (1 - answer.unknown_probability) * searched
    return replace(answer, unknown_probability=unknown / (unknown + known))


def _fitting(answer: Answer) -> tuple[str, int, int]:
    """Return the best part, the number of readings that fit it, and the number of all."""
    best = answer.hypotheses[0]
    return best.part, len(best.pairings), len(best.pairings) + len(best.outliers)


def _about_image(
    answer: Answer, readings: Readings, parts: Sequence[Part], question: Query, settings: Settings
) -> MirrorQuestion | None:
    """Return the question of a mirror image that fits all readings where the part does not; None if none does."""
    if readings.Ts_world_hand.given.any() or answer.best is None or not answer.best.outliers:
        return None
    part = part_named(parts, answer.best.part)
    if part is None:
        return None
    image = mirror_part(getattr(part, "part", part))
    found = _answer_to(question, readings, [part, image], settings)
    best = found.best if found is not None else None
    if best is None or best.part != image.name or best.outliers or best.probability < 1 - NOTABLE:
        return None
    return MirrorQuestion(part.name, best.probability)


def _about_shared(
    answer: Answer, readings: Readings, parts: Sequence[Part], question: Query, settings: Settings
) -> OffsetQuestion | ScaleQuestion | None:
    """Return the question of offsets or one scale with which all readings fit; None if none is significant.

    Groups that the file names come first. One offset and one scale both explain a part that is too large: the one with
    the smaller misfit is named. Stock on each face comes last.
    """
    best = answer.hypotheses[0].part if answer.hypotheses else ""
    likely = part_named(parts, best)
    if likely is not None and (grouped := _about_groups(likely, readings, question, settings)):
        return grouped
    offset = _offset_answer(readings, parts, question, settings)
    named = likely if offset is None else part_named(parts, offset[0].hypotheses[0].part)
    scale = None if named is None else _shared_answer(readings, [named], question, Scale(_SHARED_SD), settings)
    found = min((one for one in (offset, scale) if one is not None), key=_misfit, default=None)
    if found is None:
        return None if named is None else _about_stock(named, readings, question, settings)
    fitted, value, sd = found
    if found is scale:
        return ScaleQuestion(*_fitting(fitted), 1 / (1 + value), sd)
    return OffsetQuestion(*_fitting(fitted), value, bool(readings.points.given.any()))


def _about_groups(part: Part, readings: Readings, question: Query, settings: Settings) -> OffsetQuestion | None:
    """Return the question of an offset of each group of readings with which all fit; None if there is none.

    Args:
        part: the part that fits best.
        readings: the readings.
        question: options of the inference.
        settings: settings of the inference.
    """
    if len(set(readings.groups) - {""}) < 2:
        return None
    found = _answer_with_offsets(part, readings, question, OffsetByGroup(_shared_sd([part])), settings)
    if found is None:
        return None
    answer, names, values, sds = found
    largest, named = max(values, key=abs), tuple(name.removeprefix("group ") for name in names)
    return OffsetQuestion(
        *_fitting(answer), largest, bool(readings.points.given.any()), groups=named, offsets=values, sds=sds
    )


def _about_stock(part: Part, readings: Readings, question: Query, settings: Settings) -> OffsetQuestion | None:
    """Return the question of stock on the faces of the part with which all readings fit; None if there is none."""
    touched = readings.points.given & ~readings.is_free
    aimed = readings.directions.given | readings.normals.given
    if not aimed[touched].all() or readings.ranges.given.any():
        return None
    found = _answer_with_offsets(part, readings, question, Stock(_shared_sd([part])), settings)
    if found is None:
        return None
    answer, faces, values, sds = found
    return OffsetQuestion(*_fitting(answer), max(values), touched=True, faces=faces, offsets=values, sds=sds)


def _shared_sd(parts: Sequence[Part]) -> float:
    """Return the standard deviation of an unstated offset [m]."""
    return _SHARED_SD * float(max(sizes_of(parts)))


def _answer_with_offsets(
    part: Part, readings: Readings, question: Query, error: ErrorState, settings: Settings
) -> tuple[Answer, tuple[str, ...], tuple[float, ...], tuple[float, ...]] | None:
    """Return the answer with offsets of faces or groups, their names, values and sds; None without them.

    Offsets of opposite faces are known by their sum only, so all are tested together: Hotelling's statistic of all of
    them against none, at one in a million.

    Args:
        part: the part.
        readings: the readings.
        question: options of the inference.
        error: the offsets, whose states are named "... of NAME".
        settings: settings of the inference.
    """
    try:
        answer = question.answer(readings, [part], shared_errors=(error,))
    except TanteoError:
        return None
    best = answer.best
    estimates = next((one for one in answer.findings if isinstance(one, SharedEstimates)), None)
    if estimates is None or best is None or best.outliers or not fits(answer, settings):
        return None
    from scipy.stats import f as f_distribution  # slow to import

    of_error = error.name.split()[0]
    names = tuple(name.split(" of ", 1)[1] for name in estimates.names if name.startswith(of_error))
    if not (count := len(names)):
        return None
    rows = slice(estimates.first + len(estimates.names) - count, estimates.first + len(estimates.names))
    values, sds = estimates.values[-count:], estimates.sds[-count:]
    whitened = shared_estimates(best)[1][rows, rows]
    scales = np.array(sds) / np.sqrt(np.diagonal(whitened))
    covariance = scales[:, None] * whitened * scales
    statistic = float(np.array(values) @ np.linalg.solve(covariance, np.array(values))) / count
    if best.dof < count or f_distribution.sf(statistic, count, best.dof) > _CHANCE:
        return None
    return answer, names, values, sds


def _misfit(found: tuple[Answer, float, float]) -> float:
    """Return the squared residuals of an answer."""
    return found[0].hypotheses[0].chi2


def _offset_answer(
    readings: Readings, parts: Sequence[Part], question: Query, settings: Settings
) -> tuple[Answer, float, float] | None:
    """Return the answer with one common offset, the offset and its sd [m]; None if there is none."""
    if all(reading_kind(kind).is_centre or kind == "free" for kind in readings.kinds):
        return None  # a centre has neither a radius nor an approach
    sd = _shared_sd(parts)
    try:
        trials = trial_fits(*question.problem(readings, parts), offset_sd=sd)
    except TanteoError:
        return None
    if not trials:
        return _shared_answer(readings, parts, question, Offset(sd, common=True), settings)
    kept = [trial for trial in trials if not trial.rejects(settings.search.explained)]
    if not kept or kept[0].is_without_offset(settings.search.gate):
        return None
    some = [trial.part.part for trial in kept]
    return _shared_answer(
        _aimed(readings, kept[0]), some, question, Offset(sd, common=True), settings.brief, len(parts)
    )


def _shared_answer(
    readings: Readings,
    parts: Sequence[Part],
    question: Query,
    error: ErrorState,
    settings: Settings,
    count: int | None = None,
) -> tuple[Answer, float, float] | None:
    """Return the answer with one more shared error, its value and sd; None if readings without it explain as much.

    The simpler explanation is larger noise without the error. It is tested by Student's t of the value over its
    marginal standard deviation, which contains the estimated noise, at one in a million: one in 500 over the about
    2,000 poses from which a search chooses.

    Args:
        readings: the readings.
        parts: the parts that may fit.
        question: options of the inference.
        error: the shared error.
        settings: settings of the inference.
        count: number of all parts; None if ``parts`` are all.
    """
    try:
        found = _as_of_all(
            question.answer(readings, parts, shared_errors=(error,), settings=settings), len(parts), count or len(parts)
        )
    except TanteoError:
        return None
    if not fits(found, settings):
        return None
    best = found.hypotheses[0]
    shared = best.shared
    if shared is None or not len(shared.mean) or best.dof < 2:
        return None
    from scipy.stats import t as t_distribution  # slow to import

    estimates = next((one for one in found.findings if isinstance(one, SharedEstimates)), None)
    if estimates is None:
        return None
    value, sd = estimates.values[-1], estimates.sds[-1]
    if 2 * t_distribution.sf(abs(value) / sd, best.dof - 1) > _CHANCE:
        return None
    return found, value, sd


def _aimed(readings: Readings, trial: TrialFit) -> Readings:
    """Return touches that have neither direction nor normal with the inward normal of a trial fit as direction."""
    bare = np.asarray(readings.points.given & ~readings.directions.given & ~readings.normals.given)
    surface, T = trial.part.surface, trial.T_world_part
    found = surface.closest(SE3.apply(SE3.inverse(T), readings.points[bare]))
    inwards = Column(bare, -surface.normals[found.triangles] @ T[:3, :3].T)
    return replace(readings, directions=inwards.coalesce(readings.directions))
