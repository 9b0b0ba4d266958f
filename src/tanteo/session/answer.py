"""What is known at some point of a session, as the answer that :func:`tanteo.identify` gives."""

from __future__ import annotations

import numpy as np

from tanteo.active import Belief, Stop, worst_corner
from tanteo.active.places import places_of
from tanteo.errors import InputError
from tanteo.matching import Hypothesis, PosePrior, Recognition
from tanteo.matching.results import Status
from tanteo.matching.verdict import CONFIDENCE, doubt, verdict
from tanteo.session.values import Step, Told
from tanteo.surface_search.answer import as_hypothesis

_HALF, _NOWHERE = 0.5, "Beams went free where the part may be: check the rough place and the parts."


def answered(belief: Belief, stop: Stop, seed: int, top: int, alpha: float) -> Recognition:
    """Status, message and hypotheses; poses that differ by less than the tolerance that was asked for are one.

    What is as sure as was asked for is an answer, also where that is less than :func:`tanteo.identify` would give one
    at; the message says how sure it is then, and what else it may be.

    Args:
        belief: what is known.
        stop: what was asked for.
        seed: recorded in the answer.
        top: hypotheses to report.
        alpha: an answer whose joint test has a smaller p-value is not accepted.
    """
    if top < 1:
        raise InputError(f"top: expected 1 or more, got {top}. Use 5.")
    touches, start = belief.touches, belief.start
    if touches is None or not len(touches):
        status: Status = "unknown" if belief.unknown > _HALF else "insufficient"
        message = "No reading has met a part yet." if status == "insufficient" else _NOWHERE
        return Recognition(status, message, (), 1.0 - float(belief.weights.sum()), {}, seed)
    hypotheses = tuple(
        as_hypothesis(touches, mode, PosePrior(start.Ts[row], start.covariances[row]))
        for mode, row in zip(belief.modes[:top], belief.rows, strict=False)
    )
    shares = [(mode.target.part.name, mode.probability) for mode in belief.modes]
    enough = bool(stop.reached(belief))
    least = _least(stop, float(belief.of_parts().max(initial=0.0)) if enough else 1.0)
    status, message = verdict(hypotheses, belief.unknown, alpha, shares=shares, least=least, known=enough)
    placed = stop.tolerance is not None and (enough or stop.chance(belief) >= CONFIDENCE)
    if status == "ambiguous" and (placed or enough):
        status = "recognized" if placed else "ambiguous"
        message = _in_some_pose(hypotheses[0], belief, stop, shares)
    return Recognition(status, message, hypotheses, belief.unknown, {}, seed)


def _least(stop: Stop, part: float) -> float:
    """Probability from which one pose is the answer, where its part has this one: as sure as was asked for, of both."""
    asked = CONFIDENCE if stop.probability is None else stop.probability
    return part * min(CONFIDENCE, max(asked, _HALF))


def _in_some_pose(best: Hypothesis, belief: Belief, stop: Stop, shares: list[tuple[str, float]]) -> str:
    """The part that it is, in whichever of its poses; and whether these differ by less than was asked for."""
    sure, else_ = doubt(best, belief.unknown, shares, any_pose=True)
    if stop.tolerance is None:
        where = "in one of several poses: sense a face that is not where its others would put it"
        return f"It is {best.part}{sure}, {where}{else_}."
    within = f"less than the tolerance of {1e3 * stop.tolerance:.3g} mm"
    feature = places_of(belief.target(0).part, stop.feature).feature
    what = "the poses that it may have differ" if feature is None else f"the places that {feature} may have differ"
    return f"{best.part}{sure}; {what} by {within}{else_}."


def step_of(belief: Belief, stop: Stop, told: Told) -> Step:
    """What is known after something was told."""
    if not len(belief.weights):
        nowhere = np.full((4, 4), np.nan), -1, np.full((6, 6), np.nan), 0.0
        T, part, C, inside = nowhere
    else:
        k = int(np.argmax(belief.weights))
        T, part, C = belief.poses[k], int(belief.part[k]), belief.covariances[k]
        inside = stop.chance(belief)
    ids = () if told.readings is None else told.readings.ids
    known = belief.of_parts(), belief.unknown, T, part, C, worst_corner(belief), float(inside)
    return Step(ids, told.action, *known, told.note)
