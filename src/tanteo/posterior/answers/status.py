"""From hypotheses to a verdict: the status and the findings behind it."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from tanteo.geometry.limits import SUSPECT
from tanteo.posterior.answers.results import Hypothesis, Status
from tanteo.words import Finding
from tanteo.words.findings import (  # fmt: skip
    Contradicted,
    CutShort,
    FreeMotions,
    GivenTwice,
    Located,
    MayBeUnknown,
    NoPart,
    PriorContradicted,
    SeveralParts,
    SeveralPoses,
    UnknownObject,
    WorstReading,
)

CONFIDENCE = 0.95
"""Posterior from which one answer is given as the answer."""

_NAMED = 5
"""So many parts are named in a message, the rest are counted."""

_LISTED = 0.01
"""Probability above which a message names an alternative."""

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
    worst: WorstReading | None = None,
    shares: Sequence[tuple[str, float]] = (),
    prior_p: float = 1.0,
    elsewhere: str = "",
    least: float = CONFIDENCE,
    known: bool = False,
    same: Collection[str] | None = None,
) -> tuple[Status, tuple[Finding, ...]]:
    """Return the status of an answer and the findings behind it, the verdict first.

    Args:
        hypotheses: best first.
        unknown: probability of the unknown object.
        significance: least p-value of an answer.
        cut: whether the search dropped something.
        as_published: the paper has no joint test, so the p-value does not reject.
        worst: the reading that contradicts the best hypothesis most; None if no reading is far off.
        shares: part and probability of all modes, where not all of them are hypotheses.
        prior_p: p-value of the prior pose by itself, of a part that fits without it: among many readings that agree
            with each other the joint test does not find it.
        elsewhere: the part that explains the readings far better away from the prior pose; empty if none does.
        least: probability from which one answer is given; the words state it where it is below the usual one.
        known: whether the part is known with the probability of the goal, in any pose.
        same: names of parts of the shape of the best one; all that fit alike, if not given.
    """
    status, finding = _verdict(
        hypotheses, unknown, significance, as_published, worst, shares, prior_p, elsewhere, least, known, same
    )
    return status, (finding, CutShort()) if cut else (finding,)


def _verdict(
    hypotheses: tuple[Hypothesis, ...],
    unknown: float,
    significance: float,
    as_published: bool,
    worst: WorstReading | None,
    shares: Sequence[tuple[str, float]],
    prior_p: float,
    elsewhere: str,
    least: float,
    known: bool,
    same: Collection[str] | None,
) -> tuple[Status, Finding]:
    doubted = prior_p < SUSPECT or (
        hypotheses and hypotheses[0].p_value < significance and prior_p < significance and worst is None
    )
    if elsewhere or (hypotheses and doubted):
        return "unknown", PriorContradicted(elsewhere or hypotheses[0].part, prior_p, significance)
    several = unknown < 0.5 and len({name for name, _ in shares}) > _NAMED  # each has little of what is not unknown
    if not hypotheses:
        return "unknown", NoPart()
    best = hypotheses[0]
    if unknown > max(h.probability for h in hypotheses) and not known and not several:
        return "unknown", UnknownObject(unknown, best.part, best.probability)
    if best.p_value < significance and not as_published:
        return "unknown", Contradicted(best.part, best.p_value, worst, significance)
    if best.unobserved:
        return "insufficient", FreeMotions(best.part, best.unobserved, best.advice)
    if best.probability < least:
        return "ambiguous", _ambiguous(hypotheses, unknown, shares, same)
    sure, others = doubt(best, unknown, shares or [(h.part, h.probability) for h in hypotheses])
    return "recognized", Located(best.part, sure, best.corner_sd, others)


def doubt(
    best: Hypothesis, unknown: float, shares: Sequence[tuple[str, float]], *, any_pose: bool = False
) -> tuple[float, tuple[tuple[str, float], ...]]:
    """Return how probable an answer is and what else it may be; NaN and nothing where it is as sure as usual.

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
        return float("nan"), ()
    others["an unknown part"] = unknown
    listed = [(name, share) for name, share in sorted(others.items(), key=lambda o: -o[1]) if share > _LISTED]
    return P, tuple(listed[:_NAMED])


def _ambiguous(
    hypotheses: tuple[Hypothesis, ...],
    unknown: float,
    shares: Sequence[tuple[str, float]],
    of_its_shape: Collection[str] | None,
) -> Finding:
    best, *others = hypotheses
    alike = [h for h in others if _fit_alike(best, h, _SAME if of_its_shape is None else _LIKELY)]
    itself = [h for h in others if (h.part, h.file) == (best.part, best.file)]
    near = max(0.1 * best.corner_sd, 1e-9)
    if any(np.allclose(h.T_world_part, best.T_world_part, rtol=0.0, atol=near) for h in itself):
        return GivenTwice(best.part)
    alike = [h for h in alike if h not in itself and (of_its_shape is None or h.part in of_its_shape)]
    shares = shares or [(h.part, h.probability) for h in hypotheses]
    names = list(dict.fromkeys([best.part, *(name for name, P in shares if P > _LISTED)]))
    if len(names) > 1:
        kept = len(names) if len(names) <= _NAMED else _NAMED - 1
        return SeveralParts(tuple(names[:kept]), len(names) - kept, alike[0].part if alike else "")
    if unknown > _LISTED and best.probability + unknown > 1 - _LISTED:
        return MayBeUnknown(best.part, unknown)
    return SeveralPoses(best.part)


def _fit_alike(one: Hypothesis, other: Hypothesis, as_likely: float) -> bool:
    """Whether two hypotheses differ in nothing but the part and, it may be, its frame: as likely, as well explained."""
    first, second = ([h.chi2, h.rms] for h in (one, other))
    likely = np.isclose(one.probability, other.probability, rtol=as_likely)
    return bool(likely and np.allclose(first, second, rtol=_SAME, atol=1e-9))
