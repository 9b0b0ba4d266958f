"""Checks of conventions: if the readings fit no part, undo usual mistakes one by one and search again.

A mistake of convention moves everything far, so only one interpretation of the numbers fits. The finding names it and
never applies it: only the author of the file knows what the numbers mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from tanteo.errors import TanteoError
from tanteo.geometry import SE3
from tanteo.geometry.limits import NOTABLE
from tanteo.geometry.typing import BoolArray
from tanteo.parts import Part, part_named
from tanteo.parts.readers import mirror_part
from tanteo.posterior.answers.priors import STATED
from tanteo.posterior.answers.results import Answer
from tanteo.posterior.candidates import sizes_of
from tanteo.posterior.conventions import HANDS, OTHERS, Mistake
from tanteo.posterior.findings import fits_size, scale_of
from tanteo.posterior.prepared import prepare
from tanteo.posterior.settings import DEFAULTS, Settings
from tanteo.sensors import Column, Readings, thinned
from tanteo.words import Finding
from tanteo.words.findings import Convention, MirrorConvention, MirrorQuestion, OffsetQuestion, UnitsConvention

_OFFSET = 0.03
"""Standard deviation of an unstated common offset, such as a ball's radius, over the size of the largest part."""

_AIMED = 3
"""Number of iterations in which touches without a direction get one from the pose."""


class Search(Protocol):
    """Function that searches again; ``bias_sd`` is the sd of a shared error along all approach directions [m]."""

    def __call__(self, readings: Readings, parts: Sequence[Part], *, bias_sd: float | None = None) -> Answer:
        """Return the answer."""


def about_conventions(
    answer: Answer,
    readings: Readings,
    parts: Sequence[Part],
    ask: Search,
    *,
    placed: bool = False,
    settings: Settings = DEFAULTS,
) -> Finding | None:
    """Return the usual mistake that explains readings that fit no part, or fit badly; None if there is none.

    Args:
        answer: answer from the readings as they were read.
        readings: the readings.
        parts: the candidates.
        ask: function that searches again, with the options of the answer.
        placed: whether the pose has a prior, which a mirrored part would not satisfy.
        settings: settings of the inference.
    """
    if not is_bad(answer, settings):
        return None if placed else _about_image(answer, readings, parts, ask)
    others = [way for way in OTHERS if not (placed and way.finding in (MirrorConvention, UnitsConvention))]
    if _is_of_size(readings, parts, settings):  # in another unit they would be of a small patch, which fits anywhere
        others = [way for way in others if way.finding is not UnitsConvention]
    some = thinned(readings, settings.search.few_points)
    found = (
        _about_ways(HANDS, some, parts, ask, settings)
        or _about_offset(some, parts, ask, settings)
        or _about_ways(others, some, parts, ask, settings)
    )
    if found is None or len(some) == len(readings):
        return found
    return replace(found, given=len(readings))


def _is_of_size(readings: Readings, parts: Sequence[Part], settings: Settings) -> bool:
    """Whether points, where there are some, lie as far apart as those of one of the parts do."""
    points = readings.points.values
    scale = scale_of(points, parts)
    return not len(points) or fits_size(scale.span, scale.sizes, settings.checks)


def _about_ways(
    ways: Sequence[Mistake], readings: Readings, parts: Sequence[Part], ask: Search, settings: Settings
) -> Convention | None:
    """Return the first interpretation of the numbers that fits; None if there is none."""
    for way in ways:
        meant = way.undo(readings)
        if meant is not None and way.finding is UnitsConvention and not _is_of_size(meant, parts, settings):
            continue
        found = None if meant is None else _asked(ask, meant, parts)
        if found is not None and fits(found, settings):
            return way.finding(*_fitting(found), way.mistake)
    return None


def is_bad(answer: Answer, settings: Settings = DEFAULTS) -> bool:
    """Whether no part explains the readings, or one does but leaves many aside or far off."""
    best = answer.best or (answer.hypotheses[0] if answer.hypotheses else None)
    if answer.status == "unknown" or best is None:
        return answer.status == "unknown"
    readings = len(best.outliers) + len(best.pairings)
    return best.noise_scale[1] > STATED["typed"] or len(best.pairings) < settings.search.explained * readings


def fits(answer: Answer, settings: Settings = DEFAULTS) -> bool:
    """Whether a part explains the readings as well as can be expected."""
    if answer.status not in ("recognized", "ambiguous", "insufficient") or not answer.hypotheses:
        return False
    best = answer.hypotheses[0]
    return answer.unknown_probability < 0.5 and not is_bad(answer, settings) and best.dof > 0


def _asked(ask: Search, readings: Readings, parts: Sequence[Part], bias_sd: float | None = None) -> Answer | None:
    """Return the answer; None for an invalid question, which leaves the first answer as it is."""
    try:
        return ask(readings, parts) if bias_sd is None else ask(readings, parts, bias_sd=bias_sd)
    except TanteoError:
        return None


def _fitting(answer: Answer) -> tuple[str, int, int]:
    """Return the best part, the number of readings that fit it, and the number of all."""
    best = answer.hypotheses[0]
    return best.part, len(best.pairings), len(best.pairings) + len(best.outliers)


def _about_image(answer: Answer, readings: Readings, parts: Sequence[Part], ask: Search) -> MirrorQuestion | None:
    """Return that all readings fit the mirror image of a part, if some do not fit the part; None if not."""
    if readings.Ts_world_hand.given.any() or answer.best is None or not answer.best.outliers:
        return None
    part = part_named(parts, answer.best.part)
    if part is None:
        return None
    image = mirror_part(part)
    found = _asked(ask, readings, [part, image])
    best = found.best if found is not None else None
    if best is None or best.part != image.name or best.outliers or best.probability < 1 - NOTABLE:
        return None
    return MirrorQuestion(part.name, best.probability)


def _about_offset(readings: Readings, parts: Sequence[Part], ask: Search, settings: Settings) -> OffsetQuestion | None:
    """Return that all readings fit if the surface is nearer to the sensor or farther by one distance."""
    sd = _OFFSET * max(sizes_of(parts))
    found = _asked(ask, readings, parts, sd)
    for _ in range(_AIMED if _is_bare(readings).any() else 0):
        found = None if found is None else _asked(ask, _aimed(found, readings, parts), parts, sd)
        if found is not None and fits(found, settings):
            break
    if found is None or not fits(found, settings):
        return None
    shared = found.hypotheses[0].shared
    if shared is None or not len(shared.mean):
        return None
    off, spread = sd * float(shared.mean[-1]), sd * float(np.sqrt(shared.covariance[-1, -1]))
    if abs(off) < settings.search.gate * spread:
        return None
    touched = bool(readings.points.given.any())
    return OffsetQuestion(*_fitting(found), off, touched)


def _is_bare(readings: Readings) -> BoolArray:
    """Return which touches have neither direction nor normal ``(n,)``: for them an offset is noise at first."""
    return np.asarray(readings.points.given & ~readings.directions.given & ~readings.normals.given)


def _aimed(answer: Answer, readings: Readings, parts: Sequence[Part]) -> Readings:
    """Return touches without direction with the normal of the best answer's part as approach direction."""
    bare = _is_bare(readings)
    if not answer.hypotheses:
        return readings
    best = answer.hypotheses[0]
    part = part_named(parts, best.part)
    surface, T = prepare(part).surface, best.T_world_part
    found = surface.closest(SE3.apply(SE3.inverse(T), readings.points[bare]))
    inwards = Column(bare, -surface.normals[found.triangles] @ T[:3, :3].T)
    return replace(readings, directions=inwards.coalesce(readings.directions))
