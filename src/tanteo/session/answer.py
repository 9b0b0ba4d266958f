"""What is known at some point of a session, as the answer that :func:`tanteo.identify` gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tanteo.active import Belief, Stop, worst_corner
from tanteo.active.places import places_of
from tanteo.answers import Hypothesis, PosePrior, Recognition
from tanteo.answers.pose_prior import prior_residuals
from tanteo.answers.results import Status
from tanteo.answers.verdict import CONFIDENCE, doubt, verdict
from tanteo.errors import InputError
from tanteo.inference import Explained, as_hypothesis, explained, face_elsewhere, p_of_prior, worst_reading
from tanteo.limits import SUSPECT
from tanteo.measurements import ContactPoints
from tanteo.session.moved import moved
from tanteo.session.values import Step, Told
from tanteo.special import chi2_survival

ALPHA = 0.01
"""An answer whose joint test has a smaller p-value is not accepted, if nothing else is said."""

NOTHING = "No part explains the readings: check them, the rough pose and the parts."
"""What is said where no part is left."""

_ANEW = " A new session with a wider rough pose can be told the same readings."

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
    if not belief.modes:
        return Recognition("unknown", NOTHING, (), belief.unknown, {}, seed)
    found = [explained(mode) for mode in belief.modes[:top]]
    hypotheses = tuple(
        as_hypothesis(touches, one, PosePrior(start.Ts[row], start.covariances[row]))
        for one, row in zip(found, belief.rows, strict=False)
    )
    shares = [(mode.prepared.part.name, mode.probability) for mode in belief.modes]
    enough = bool(stop.reached(belief))
    least = _least(stop, float(belief.of_parts().max(initial=0.0)) if enough else 1.0)
    prior_p = p_of_start(belief)
    status, message = verdict(
        hypotheses, belief.unknown, alpha,
        worst=_worst(touches, found[0], prior_p), shares=shares, prior_p=prior_p, least=least, known=enough,
    )  # fmt: skip
    placed = stop.tolerance is not None and (enough or stop.chance(belief) >= CONFIDENCE)
    if status == "ambiguous" and (placed or enough):
        status = "recognized" if placed else "ambiguous"
        message = _in_some_pose(hypotheses[0], belief, stop, shares)
    message += face_elsewhere(touches, found[0], belief.unknown, start.priors)
    message += _ANEW if status == "unknown" and prior_p < alpha else ""
    return Recognition(status, message + moved_words(belief), hypotheses, belief.unknown, {}, seed)


def contradiction(belief: Belief, stop: Stop, *, reached: bool) -> str:
    """Why the answer is not accepted, in words, where that is known; empty if nothing contradicts it.

    Before the goal is reached, a part that is known but not where it was said to be does: more readings of it do not
    make the rough pose right. Then, whatever the joint test says.

    Args:
        belief: what is known.
        stop: what was asked for.
        reached: it is known as well as that.
    """
    known = reached or (belief.of_parts().max(initial=0.0) > CONFIDENCE and p_of_start(belief) < SUSPECT)
    answer = answered(belief, stop, 0, 1, ALPHA) if known else None
    return answer.message if answer is not None and answer.status == "unknown" else ""


def p_of_start(belief: Belief) -> float:
    """P-value of the rough pose beside the readings, of several that of the nearest; 1 where no pose is likely."""
    start = belief.start
    if not belief.modes or belief.modes[0].probability < _HALF:
        return 1.0
    best, own = belief.modes[0], np.flatnonzero(start.part == belief.part[0])
    there = np.repeat(belief.poses[:1], len(own), axis=0)
    row = own[np.argmin(np.sum(prior_residuals(start.prior(own), best.prepared.part, there) ** 2, axis=1))]
    pose = PosePrior(start.Ts[row], start.covariances[row])
    return p_of_prior(best, replace(start.priors, pose=pose))


def _worst(points: ContactPoints, best: Explained, prior_p: float) -> str:
    """The reading that contradicts the likeliest hypothesis most, unless the rough pose contradicts it more."""
    chi2, fixed = best.chi_square()
    dof = fixed + len(best.free)
    return worst_reading(points, best) if dof > 0 and chi2_survival(chi2, dof) < prior_p else ""


def moved_words(belief: Belief) -> str:
    """A sentence if the readings that the likeliest hypothesis leaves aside are together in time; empty if not."""
    if belief.touches is None or not belief.modes:
        return ""
    words = moved(belief.touches.ids, ~belief.on_part())
    return f" {words}" if words else ""


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
