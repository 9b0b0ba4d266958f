"""Recognition from readings without correspondences: every part's surface against every reading."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from tanteo.features import SharedError
from tanteo.matching.model import PartModel
from tanteo.matching.priors import Priors, sized
from tanteo.matching.question import Clock, check_question
from tanteo.matching.results import Recognition
from tanteo.matching.verdict import verdict
from tanteo.parts import Part
from tanteo.surface_search.answer import as_hypothesis, what_limits, worst_reading
from tanteo.surface_search.mode import Mode
from tanteo.surface_search.off_part import face_elsewhere, left_out, mostly_on, not_on_it
from tanteo.surface_search.said import what_was_said
from tanteo.surface_search.target import Target, as_targets
from tanteo.surface_search.touches import FreePaths, Touches
from tanteo.surface_search.weighed import search_and_weigh

_PATCH = 0.2
"""Share of the part's size that readings have to reach over, or the pose to be roughly known, for one answer."""

_CLOSE = "the readings lie so close together that other places may look like it: sense farther apart, or say --near."

_BARELY = 2.0
"""Readings that scatter along their longest direction by so many standard deviations, or fewer, are all noise."""

LEAST = 3
"""Fewer readings than this fit any surface in any way."""

_MAY_MISS = 0.05
"""Probability of poses that the search met only once from which the answer says that others may fit."""


def identify_touches(
    touches: Touches,
    free: FreePaths,
    parts: Sequence[Part] | Sequence[PartModel] | Sequence[Target],
    *,
    shared: Sequence[SharedError] = (),
    alpha: float = 0.01,
    top: int = 5,
    priors: Priors | None = None,
    seed: int = 0,
) -> Recognition:
    """Which part the readings lie on, and its pose, without knowing which face each one met.

    Args:
        touches: points in the world; with directions, normals and tip radii where known.
        free: paths on which nothing was met.
        parts: candidates, or prepared targets (``prepare_target(part)``, which is kept with the part).
        shared: the errors behind ``touches.gains``, in that order, for the words of the answer.
        alpha: an answer whose joint test has a smaller p-value is not accepted.
        top: number of hypotheses to report.
        priors: what is assumed beforehand.
        seed: recorded in the answer; the search itself draws nothing.

    Raises:
        InputError: without parts, or for an ``alpha`` outside (0, 1).
    """
    parts = check_question(parts, alpha, top, seed, priors)
    if len(touches) < LEAST:
        few = "1 reading fits" if len(touches) == 1 else f"{len(touches)} readings fit"
        message = f"{few} any part: sense {LEAST} places or more, better eight, on several sides."
        return Recognition("insufficient", message, (), 1.0, {}, seed)
    if (priors is None or priors.pose is None) and (message := _without_breadth(touches)):
        return Recognition("insufficient", message, (), 1.0, {}, seed)
    clock = Clock()
    priors = sized(priors, max(_part(part).radius for part in parts))
    fitting = [part for part in parts if _large_enough(touches, _part(part))]
    targets = list(as_targets("parts", fitting))
    clock.lap("prepare")
    centroid = np.mean([_part(part).centroid for part in parts], axis=0)
    look = partial(search_and_weigh, touches, free, targets, len(parts), centroid)
    found = look(priors)
    clock.lap("search")
    modes, unknown, touches = found.modes, found.unknown, found.touches
    hypotheses = tuple(as_hypothesis(touches, mode, priors.pose) for mode in modes[:top])
    clock.lap("locate")
    worst = worst_reading(touches, modes[0]) if modes else ""
    without = partial(look, replace(priors, pose=None))
    said = what_was_said(found, free, hypotheses[0] if hypotheses else None, priors, without, alpha)
    clock.lap("compare")
    status, message = verdict(
        hypotheses, unknown, alpha, worst=worst, shares=_shares(modes), prior_p=said.p, elsewhere=said.elsewhere
    )
    if status == "unknown" and hypotheses and mostly_on(hypotheses[0], unknown) and not said.elsewhere:
        message = not_on_it(hypotheses[0], unknown)
    if status == "recognized" and _close_together(touches, modes[0], priors):
        status, message = "ambiguous", f"{message[:-1]}, if there: {_CLOSE}"
    if hypotheses and status == "recognized":
        message += what_limits(modes[0], shared) + left_out(hypotheses[0], priors)
    message += face_elsewhere(touches, modes[0], unknown, priors) if modes and status != "insufficient" else ""
    message += _missed(found.once, status) + _scattered(found.ratio, worst)
    return Recognition(status, message, hypotheses, unknown, clock.laps(), seed)


def _close_together(touches: Touches, best: Mode, priors: Priors) -> bool:
    """Whether the readings are of a small patch, which many a part has twice, and nothing else says where it is."""
    placed = priors.pose is not None and priors.pose.T_world_part is not None
    off = np.linalg.norm(touches.points - np.median(touches.points, axis=0), axis=1)
    return not placed and 2 * float(np.quantile(off, 0.75)) < _PATCH * best.target.part.diagonal


def _without_breadth(touches: Touches) -> str:
    """What to do if nothing tells the readings from points of a line, or from one point; sensed normals would."""
    if touches.oriented.any():
        return ""
    along, across = np.linalg.svd(touches.points - touches.points.mean(axis=0), compute_uv=False)[:2]
    sd = float(np.median(touches.sd))
    if across > sd * np.sqrt(len(touches)):
        return ""
    if along > _BARELY * sd * np.sqrt(len(touches)):
        return "The readings lie on one line within their noise: sense places beside it, on several sides."
    noise, what = f"{1e3 * sd:.4g} mm", "standard deviation"
    if touches.tolerance > 0:
        noise, what = f"{noise} with the tolerance", "standard deviation, tolerance"
    return (
        f"The noise of the readings (sd {noise}) is as large as the whole set of them, so nothing can be told: check "
        f"{what} and their units, or sense places farther apart."
    )


def _shares(modes: Sequence[Mode]) -> list[tuple[str, float]]:
    return [(mode.target.part.name, mode.probability) for mode in modes]


def _missed(once: float, status: str) -> str:
    """What the search may have missed, where that matters: others than the poses that are listed."""
    if status not in ("ambiguous", "insufficient") or once <= _MAY_MISS:
        return ""
    return f" {100 * once:.0f} % of the probability is in poses that the search met only once: others may fit."


def _scattered(ratio: float, worst: str) -> str:
    """That the readings scatter more than stated, if they do, and the worst of them."""
    if ratio <= 1:
        return ""
    says = f" The readings scatter {ratio:.1f} times as much as stated: covariances were widened by that."
    return says + (f" The worst is {worst} even so." if worst else "")


def _part(part: Part | PartModel | Target) -> Part:
    if isinstance(part, Part):
        return part
    assert part.part is not None
    return part.part


def _large_enough(touches: Touches, part: Part) -> bool:
    """Whether the part is as large as the readings' spread, a few strays left aside."""
    centre = np.median(touches.points, axis=0)
    reach = np.sort(np.linalg.norm(touches.points - centre, axis=1) - 4 * touches.sd - touches.radii)
    shared = 4 * np.sqrt(np.sum(touches.gains**2) / max(len(touches), 1))
    return bool(reach[int(0.75 * (len(reach) - 1))] - shared <= part.diagonal)
