"""What is known at some point of a session, as the answer that :func:`tanteo.identify` gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import chdtrc

from tanteo.active import Belief, Stop, worst_corner
from tanteo.active.places import places_of
from tanteo.errors import InputError
from tanteo.limits import SUSPECT
from tanteo.matching import Hypothesis, PosePrior, Recognition
from tanteo.matching.prior import prior_residuals
from tanteo.matching.results import Status
from tanteo.matching.verdict import CONFIDENCE, doubt, verdict
from tanteo.session.moved import moved
from tanteo.session.values import Step, Told
from tanteo.surface_search.answer import as_hypothesis, worst_reading
from tanteo.surface_search.explained import chi_square
from tanteo.surface_search.off_part import face_elsewhere
from tanteo.surface_search.said import p_of_prior
from tanteo.typing import Transforms

ALPHA = 0.01
"""An answer whose joint test has a smaller p-value is not accepted, if nothing else is said."""

NOTHING = "No part explains the readings: check them, the rough pose and the parts."
"""What is said where no part is left."""

_ANEW = " A new session with a wider rough pose can be told the same readings."

_DRAWS = 64
"""Poses of the belief from which the one is looked for that agrees best with readings and rough pose."""

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
    hypotheses = tuple(
        as_hypothesis(touches, mode, PosePrior(start.Ts[row], start.covariances[row]))
        for mode, row in zip(belief.modes[:top], belief.rows, strict=False)
    )
    shares = [(mode.target.part.name, mode.probability) for mode in belief.modes]
    enough = bool(stop.reached(belief))
    least = _least(stop, float(belief.of_parts().max(initial=0.0)) if enough else 1.0)
    prior_p = p_of_start(belief)
    status, message = verdict(
        hypotheses, belief.unknown, alpha,
        worst=_worst(belief, prior_p), shares=shares, prior_p=prior_p, least=least, known=enough,
    )  # fmt: skip
    placed = stop.tolerance is not None and (enough or stop.chance(belief) >= CONFIDENCE)
    if status == "ambiguous" and (placed or enough):
        status = "recognized" if placed else "ambiguous"
        message = _in_some_pose(hypotheses[0], belief, stop, shares)
    message += face_elsewhere(touches, belief.modes[0], belief.unknown, start.priors)
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
    touches, start = belief.touches, belief.start
    if touches is None or not belief.modes or belief.modes[0].probability < _HALF:
        return 1.0
    best, own = belief.modes[0], np.flatnonzero(start.part == belief.part[0])
    there = np.repeat(belief.poses[:1], len(own), axis=0)
    row = own[np.argmin(np.sum(prior_residuals(start.prior(own), best.target.part, there) ** 2, axis=1))]
    pose = PosePrior(start.Ts[row], start.covariances[row])
    return p_of_prior(touches, belief.free, best, replace(start.priors, pose=pose), _likely(belief))


def _likely(belief: Belief) -> Transforms | None:
    """Draws of the part of the likeliest mode, the heaviest of them ``(S, 4, 4)``; None where none were made."""
    if belief.draws is None:
        return None
    own = np.flatnonzero(belief.part[belief.draws.mode] == belief.part[0])
    return belief.draws.Ts[own[np.argsort(-belief.draws.weights[own], kind="stable")[:_DRAWS]]]


def _worst(belief: Belief, prior_p: float) -> str:
    """The reading that contradicts the likeliest hypothesis most, unless the rough pose contradicts it more."""
    best, touches = belief.modes[0], belief.touches
    chi2, fixed = chi_square(best.found, best.k)
    dof = fixed + len(best.free)
    return worst_reading(touches, best) if touches is not None and dof > 0 and chdtrc(dof, chi2) < prior_p else ""


def moved_words(belief: Belief) -> str:
    """A sentence if the readings that the likeliest hypothesis leaves aside are together in time; empty if not."""
    if belief.touches is None or not belief.modes:
        return ""
    best = belief.modes[0]
    words = moved(belief.touches.ids, best.found.belongs[best.k] <= _HALF)
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
