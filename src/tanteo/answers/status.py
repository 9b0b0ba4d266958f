"""From hypotheses to a verdict: which status, and in which words."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from tanteo.answers.results import Hypothesis, Status
from tanteo.limits import SUSPECT

CONFIDENCE = 0.95
"""Posterior from which one answer is given as the answer."""

_NAMED = 5
"""So many parts are named in a message, the rest are counted."""

_SAME, _LIKELY = 1e-3, 0.3
"""Relative difference of figures up to which two parts fit alike: rounding of their files, another frame; and of their
probabilities, which samples tell."""


def verdict(
    hypotheses: tuple[Hypothesis, ...],
    unknown: float,
    significance: float,
    *,
    cut: bool = False,
    as_published: bool = False,
    worst: str = "",
    shares: Sequence[tuple[str, float]] = (),
    prior_p: float = 1.0,
    elsewhere: str = "",
    least: float = CONFIDENCE,
    known: bool = False,
    same: Collection[str] | None = None,
) -> tuple[Status, str]:
    """Status and sentence of an answer.

    Args:
        hypotheses: best first.
        unknown: probability of the unknown object.
        significance: least p-value of an answer.
        cut: whether the search dropped something.
        as_published: the paper has no joint test, so the p-value does not reject.
        worst: what contradicts the best hypothesis most, in words; empty if no reading is far off.
        shares: part and probability of all modes, where not all of them are hypotheses.
        prior_p: p-value of what was known of the pose beforehand, asked by itself, of a part that fits without it:
            among many readings that agree with each other the joint test does not see it.
        elsewhere: the part that explains what was sensed far better where it was not said to be; empty if none does.
        least: probability from which one answer is given; the words say it where it is below what is usual.
        known: which part it is is known as surely as was asked for, in whatever pose.
        same: names of parts of the shape of the best one; all that fit alike, if not given.
    """
    note = " The search was cut short: sense fewer, better spread features." if cut else ""
    doubted = prior_p < SUSPECT or (
        hypotheses and hypotheses[0].p_value < significance and prior_p < significance and not worst
    )
    if elsewhere or (hypotheses and doubted):
        closest = elsewhere or hypotheses[0].part
        return "unknown", (
            f"The closest part is {closest}, but it is not where it was said to be (p = {prior_p:.2g}): "
            "check the prior pose beforehand, or leave it out and compare." + note
        )
    several = unknown < 0.5 and len({name for name, _ in shares}) > _NAMED  # each has little of what is not unknown
    if not hypotheses or (unknown > max(h.probability for h in hypotheses) and not known and not several):
        return "unknown", _unknown_message(hypotheses, unknown) + note
    best = hypotheses[0]
    if best.p_value < significance and not as_published:
        most = f", most of all {worst}" if worst else ""
        return "unknown", (
            f"The closest part is {best.part}, but the readings contradict it (p = {best.p_value:.2g}){most}: "
            "check the sensor's standard deviation, the tolerance and the units." + note
        )
    if best.unobserved:
        help_ = best.advice or "sense a face or an edge that resists it"
        stays = "stays" if len(best.unobserved) == 1 else "stay"
        return "insufficient", f"{best.part} fits, but {' and '.join(best.unobserved)} {stays} free: {help_}." + note
    if best.probability < least:
        return "ambiguous", _ambiguous_message(hypotheses, unknown, shares, same) + note
    sure, else_ = doubt(best, unknown, shares or [(h.part, h.probability) for h in hypotheses])
    located = f"located to {1e3 * best.corner_sd:.2g} mm (largest corner sd)"
    return "recognized", f"{best.part}{sure}, {located}{else_}." + note


def doubt(
    best: Hypothesis, unknown: float, shares: Sequence[tuple[str, float]], *, any_pose: bool = False
) -> tuple[str, str]:
    """How probable an answer is and what else it may be, in words; both empty for an answer as sure as is usual.

    Args:
        best: the answer.
        unknown: probability of the unknown object.
        shares: part and probability of all modes, that of the answer first.
        any_pose: all poses of its part are the answer.
    """
    P, others = best.probability, dict[str, float]()
    for name, share in shares[1:]:
        if name == best.part and any_pose:
            P += share
            continue
        what = f"{name} in another pose" if name == best.part else name
        others[what] = others.get(what, 0.0) + share
    if P >= CONFIDENCE:
        return "", ""
    others["an unknown part"] = unknown
    words = [f"{name} (P = {share:.2f})" for name, share in sorted(others.items(), key=lambda o: -o[1]) if share > 0.01]
    else_ = ", ".join(words[:_NAMED][:-1]) + (" or " if len(words[:_NAMED]) > 1 else "") + (words[:_NAMED] or [""])[-1]
    return f" (P = {P:.2f})", f"; it may also be {else_}" if else_ else ""


def _unknown_message(hypotheses: tuple[Hypothesis, ...], unknown: float) -> str:
    if not hypotheses:
        return "None of the parts explains the readings: add the part's file, or check units and standard deviations."
    best = hypotheses[0]
    return (
        f"None of the parts is the best explanation (P = {unknown:.2f}); the closest is {best.part} "
        f"(P = {best.probability:.2f}): sense more of it, or add the part's file."
    )


def _ambiguous_message(
    hypotheses: tuple[Hypothesis, ...],
    unknown: float,
    shares: Sequence[tuple[str, float]],
    of_its_shape: Collection[str] | None,
) -> str:
    best, *others = hypotheses
    alike = [h for h in others if _fit_alike(best, h, _SAME if of_its_shape is None else _LIKELY)]
    itself = [h for h in others if (h.part, h.file) == (best.part, best.file)]
    near = max(0.1 * best.corner_sd, 1e-9)
    if any(np.allclose(h.T_world_part, best.T_world_part, rtol=0.0, atol=near) for h in itself):
        return f"{best.part} was given more than once, and no reading can tell it from itself: leave the others out."
    alike = [h for h in alike if h not in itself and (of_its_shape is None or h.part in of_its_shape)]
    same = f" {best.part} and {alike[0].part} fit exactly alike: if they are one part, leave one out." if alike else ""
    shares = shares or [(h.part, h.probability) for h in hypotheses]
    names = list(dict.fromkeys([hypotheses[0].part, *(name for name, P in shares if P > 0.01)]))
    if len(names) > _NAMED:
        names = [*names[: _NAMED - 1], f"one of {len(names) - _NAMED + 1} others"]
    if len(names) > 1:
        return f"It may be {', '.join(names[:-1])} or {names[-1]}: sense a face where they differ.{same}"
    if unknown > 0.01 and hypotheses[0].probability + unknown > 0.99:
        return f"{names[0]} fits, but so may an unknown part (P = {unknown:.2f}): sense one more place."
    return f"It is {names[0]}, in one of several poses: sense a face that is not where its others would put it."


def _fit_alike(one: Hypothesis, other: Hypothesis, as_likely: float) -> bool:
    """Whether two hypotheses differ in nothing but the part and, it may be, its frame: as likely, as well explained."""
    first, second = ([h.chi2, h.rms] for h in (one, other))
    likely = np.isclose(one.probability, other.probability, rtol=as_likely)
    return bool(likely and np.allclose(first, second, rtol=_SAME, atol=1e-9))
