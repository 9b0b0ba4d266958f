"""Verdict on hypotheses: the status of an answer and the finding that states its reason."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from tanteo.defaults import SIGNIFICANCE, TOP
from tanteo.geometry.limits import NOTABLE, SUSPECT
from tanteo.posterior.answers.results import Hypothesis, Status
from tanteo.words import Finding
from tanteo.words.findings import (  # fmt: skip
    Contradicted,
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

CONFIDENCE = 1 - NOTABLE
"""Posterior probability from which one hypothesis is the answer."""

_NAMED = TOP
"""Number of parts that a message names; it states the number of the others."""

_LISTED = SIGNIFICANCE
"""Probability above which a message names an alternative: below, it is rejected at the significance level."""

_SAME_FIT, _SAME_PROBABILITY = 1e-3, 0.3
"""Relative differences up to which two parts are equivalent: of goodness of fit, for rounding in their files and
another frame; and of probability, for the noise of the samples."""


def verdict(
    hypotheses: tuple[Hypothesis, ...],
    unknown: float,
    significance: float,
    *,
    as_published: bool = False,
    worst: WorstReading | None = None,
    shares: Sequence[tuple[str, float]] = (),
    prior_p: float = 1.0,
    elsewhere: str = "",
    least: float = CONFIDENCE,
    known: bool = False,
    same: Collection[str] | None = None,
    missed: float = 0.0,
    mirrored: Collection[str] = (),
) -> tuple[Status, Finding]:
    """Return the status of an answer and the finding that states its reason.

    Args:
        hypotheses: hypotheses, best first.
        unknown: probability of the unknown object.
        significance: p-value below which the joint test rejects a hypothesis.
        as_published: whether to omit the joint test, as the paper does.
        worst: the reading that contradicts the best hypothesis most; None if no reading is far off.
        shares: part and probability of all modes, if some modes are not hypotheses.
        prior_p: p-value of the prior pose alone, for a part that fits without it. Where many readings agree with each
            other the joint test does not detect a wrong prior.
        elsewhere: name of the part that explains the readings far better away from the prior pose; empty if none does.
        least: probability from which one hypothesis is the answer.
        known: whether the part is certain enough if all of its poses count together.
        same: names of the parts with the shape of the best one; None if all parts that fit equally count as such.
        missed: probability of poses of the parts that the search missed.
        mirrored: names of the parts that are mirror images of the best one.
    """
    doubted = prior_p < SUSPECT or (
        hypotheses and hypotheses[0].p_value < significance and prior_p < significance and worst is None
    )
    if elsewhere or (hypotheses and doubted):
        return "unknown", PriorContradicted(elsewhere or hypotheses[0].part, prior_p, significance)
    several = unknown < 0.5 and len({name for name, _ in shares}) > _NAMED  # several known parts share the rest
    if not hypotheses:
        return "unknown", NoPart()
    best = hypotheses[0]
    of_parts: dict[str, float] = {}
    for name, share in shares or [(h.part, h.probability) for h in hypotheses]:
        of_parts[name] = of_parts.get(name, 0.0) + share
    # poses along a motion that the readings leave free are pieces of one region
    likeliest = max(of_parts.values() if best.unobserved else (h.probability for h in hypotheses))
    if unknown > likeliest + missed and not known and not several:
        return "unknown", UnknownObject(unknown, best.part, best.probability)
    if best.p_value < significance and not as_published:
        return "unknown", Contradicted(best.part, best.p_value, worst, significance)
    if best.unobserved:
        return "insufficient", FreeMotions(best.part, best.unobserved, best.advice)
    if best.probability < least:
        return "ambiguous", _ambiguous(hypotheses, unknown, shares, same, mirrored)
    sure, others = doubt(best, unknown, shares or [(h.part, h.probability) for h in hypotheses])
    return "recognized", Located(best.part, sure, best.corner_sd, others)


def doubt(
    best: Hypothesis, unknown: float, shares: Sequence[tuple[str, float]], *, any_pose: bool = False
) -> tuple[float, tuple[tuple[str, float], ...]]:
    """Return the probability of an answer, and its alternatives; NaN and none if it exceeds the default confidence.

    Args:
        best: the answer.
        unknown: probability of the unknown object.
        shares: part and probability of all modes, that of the answer first.
        any_pose: whether the answer includes all poses of its part.
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
    same_shape: Collection[str] | None,
    mirrored: Collection[str],
) -> Finding:
    best, *others = hypotheses
    tolerance = _SAME_FIT if same_shape is None else _SAME_PROBABILITY
    equivalent = [
        h
        for h in others
        if np.isclose(best.probability, h.probability, rtol=tolerance)
        and np.allclose([best.chi2, best.rms], [h.chi2, h.rms], rtol=_SAME_FIT, atol=1e-9)
    ]
    itself = [h for h in others if (h.part, h.file) == (best.part, best.file)]
    near = max(0.1 * best.corner_sd, 1e-9)
    if any(np.allclose(h.T_world_part, best.T_world_part, rtol=0.0, atol=near) for h in itself):
        return GivenTwice(best.part)
    equivalent = [h for h in equivalent if h not in itself and (same_shape is None or h.part in same_shape)]
    shares = shares or [(h.part, h.probability) for h in hypotheses]
    names = list(dict.fromkeys([best.part, *(name for name, P in shares if P > _LISTED)]))
    if len(names) > 1:
        kept = len(names) if len(names) <= _NAMED else _NAMED - 1
        equal = equivalent[0].part if equivalent else ""
        mirror = next((name for name in names[1:] if name in mirrored), "")
        return SeveralParts(tuple(names[:kept]), len(names) - kept, equal, mirror)
    if unknown > _LISTED and best.probability + unknown > 1 - _LISTED:
        return MayBeUnknown(best.part, unknown, best.outliers)
    of_part = sum(P for name, P in shares if name == best.part)
    listed = [h.probability for h in hypotheses if h.part == best.part and h.probability > _LISTED]
    is_complete = len(listed) > 1 and of_part - sum(listed) < _LISTED
    return SeveralPoses(best.part, of_part, poses=len(listed) if is_complete else 0)
