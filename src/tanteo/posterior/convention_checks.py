"""Checks of conventions: if the readings fit no part, undo usual mistakes one by one and search again.

A mistake of convention displaces all readings, so only one interpretation of the numbers fits. The finding names the
mistake but does not correct it: only the author of the file can confirm what the numbers mean.
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
from tanteo.parts import Part, mirror_part, part_named
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
    """Function that repeats the search; ``bias_sd`` is the sd of a shared error along all approach directions [m]."""

    def __call__(self, readings: Readings, parts: Sequence[Part], *, bias_sd: float | None = None) -> Answer:
        """Return the answer for these readings and parts."""


def about_conventions(
    answer: Answer,
    readings: Readings,
    parts: Sequence[Part],
    search: Search,
    *,
    placed: bool = False,
    settings: Settings = DEFAULTS,
) -> Finding | None:
    """Return the usual mistake that explains readings that fit no part, or fit badly; None if there is none.

    Args:
        answer: answer from the unchanged readings.
        readings: the readings.
        parts: the candidates.
        search: function that repeats the search, with the options of the answer.
        placed: whether the pose has a prior, which a mirrored part would not satisfy.
        settings: settings of the inference.
    """
    if not is_bad(answer, settings):
        return None if placed else _about_image(answer, readings, parts, search)
    others = [one for one in OTHERS if not (placed and one.finding in (MirrorConvention, UnitsConvention))]
    if _is_of_size(readings, parts, settings):  # in a smaller unit they would cover a small patch, which fits anywhere
        others = [one for one in others if one.finding is not UnitsConvention]
    some = thinned(readings, settings.search.few_points)
    found = (
        _first_that_fits(HANDS, some, parts, search, settings)
        or _about_offset(some, parts, search, settings)
        or _first_that_fits(others, some, parts, search, settings)
    )
    if found is None or len(some) == len(readings):
        return found
    return replace(found, given=len(readings))


def _is_of_size(readings: Readings, parts: Sequence[Part], settings: Settings) -> bool:
    """Return whether the extent of the points is that of one of the parts; True without points."""
    points = readings.points.values
    scale = scale_of(points, parts)
    return not len(points) or fits_size(scale.span, scale.sizes, settings.checks)


def _first_that_fits(
    conventions: Sequence[Mistake], readings: Readings, parts: Sequence[Part], search: Search, settings: Settings
) -> Convention | None:
    """Return the first interpretation of the numbers that fits; None if there is none."""
    for one in conventions:
        meant = one.undo(readings)
        if meant is not None and one.finding is UnitsConvention and not _is_of_size(meant, parts, settings):
            continue
        found = None if meant is None else _searched(search, meant, parts)
        if found is not None and fits(found, settings):
            return one.finding(*_fitting(found), one.mistake)
    return None


def is_bad(answer: Answer, settings: Settings = DEFAULTS) -> bool:
    """Return whether no part explains the readings, or the best part leaves many outliers or large residuals."""
    best = answer.best or (answer.hypotheses[0] if answer.hypotheses else None)
    if answer.status == "unknown" or best is None:
        return answer.status == "unknown"
    readings = len(best.outliers) + len(best.pairings)
    return best.noise_scale[1] > STATED["typed"] or len(best.pairings) < settings.search.explained * readings


def fits(answer: Answer, settings: Settings = DEFAULTS) -> bool:
    """Return whether a part explains the readings with no more outliers and noise than expected."""
    if answer.status not in ("recognized", "ambiguous", "insufficient") or not answer.hypotheses:
        return False
    best = answer.hypotheses[0]
    return answer.unknown_probability < 0.5 and not is_bad(answer, settings) and best.dof > 0


def _searched(search: Search, readings: Readings, parts: Sequence[Part], bias_sd: float | None = None) -> Answer | None:
    """Return the answer; None if the search rejects the changed readings."""
    try:
        return search(readings, parts) if bias_sd is None else search(readings, parts, bias_sd=bias_sd)
    except TanteoError:
        return None


def _fitting(answer: Answer) -> tuple[str, int, int]:
    """Return the best part, the number of readings that fit it, and the number of all."""
    best = answer.hypotheses[0]
    return best.part, len(best.pairings), len(best.pairings) + len(best.outliers)


def _about_image(answer: Answer, readings: Readings, parts: Sequence[Part], search: Search) -> MirrorQuestion | None:
    """Return the finding that all readings fit the mirror image of a part, but not the part; None if they do not."""
    if readings.Ts_world_hand.given.any() or answer.best is None or not answer.best.outliers:
        return None
    part = part_named(parts, answer.best.part)
    if part is None:
        return None
    image = mirror_part(part)
    found = _searched(search, readings, [part, image])
    best = found.best if found is not None else None
    if best is None or best.part != image.name or best.outliers or best.probability < 1 - NOTABLE:
        return None
    return MirrorQuestion(part.name, best.probability)


def _about_offset(
    readings: Readings, parts: Sequence[Part], search: Search, settings: Settings
) -> OffsetQuestion | None:
    """Return the finding that all readings fit if one distance is added along all directions; None if they do not."""
    sd = _OFFSET * max(sizes_of(parts))
    found = _searched(search, readings, parts, sd)
    for _ in range(_AIMED if _is_bare(readings).any() else 0):
        found = None if found is None else _searched(search, _aimed(found, readings, parts), parts, sd)
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
    """Return which touches have neither direction nor normal ``(n,)``, so that an offset has no direction yet."""
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
