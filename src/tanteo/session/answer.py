"""What is known at some point of a session, as the answer that :func:`tanteo.identify` gives."""

from __future__ import annotations

from tanteo.active import Belief, Stop, chance_within
from tanteo.errors import InputError
from tanteo.matching import PosePrior, Recognition
from tanteo.matching.results import Status
from tanteo.matching.verdict import CONFIDENCE, verdict
from tanteo.surface_search.answer import as_hypothesis

_HALF, _NOWHERE = 0.5, "Beams went free where the part may be: check the rough place and the parts."


def answered(belief: Belief, stop: Stop, seed: int, top: int, alpha: float) -> Recognition:
    """Status, message and hypotheses; poses that differ by less than the tolerance that was asked for are one.

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
    status, message = verdict(hypotheses, belief.unknown, alpha, shares=shares)
    if status == "ambiguous" and stop.tolerance is not None and chance_within(belief, stop.tolerance) >= CONFIDENCE:
        within = f"less than the tolerance of {1e3 * stop.tolerance:.3g} mm"
        status, message = "recognized", f"{hypotheses[0].part}; the poses that it may have differ by {within}."
    return Recognition(status, message, hypotheses, belief.unknown, {}, seed)
