"""What is known at some point of a session, as the answer that :func:`tanteo.identify` gives."""

from __future__ import annotations

from tanteo.active import Belief, Stop
from tanteo.matching import PosePrior, Recognition
from tanteo.matching.verdict import verdict
from tanteo.surface_search.answer import as_hypothesis


def answered(belief: Belief, stop: Stop, seed: int, top: int, alpha: float) -> Recognition:
    """Status, message and hypotheses; poses that differ by less than the tolerance that was asked for are one.

    Args:
        belief: what is known.
        stop: what was asked for.
        seed: recorded in the answer.
        top: hypotheses to report.
        alpha: an answer whose joint test has a smaller p-value is not accepted.
    """
    touches, start = belief.touches, belief.start
    if touches is None or not len(touches):
        message = "No reading has met a part yet."
        return Recognition("insufficient", message, (), 1.0 - float(belief.weights.sum()), {}, seed)
    hypotheses = tuple(
        as_hypothesis(touches, mode, PosePrior(start.Ts[row], start.covariances[row]))
        for mode, row in zip(belief.modes[:top], belief.rows, strict=False)
    )
    status, message = verdict(hypotheses, belief.unknown, alpha)
    if status == "ambiguous" and stop.tolerance is not None and stop.reached(belief):
        within = f"less than the tolerance of {1e3 * stop.tolerance:.3g} mm"
        status, message = "recognized", f"{hypotheses[0].part}; the poses that it may have differ by {within}."
    return Recognition(status, message, hypotheses, belief.unknown, {}, seed)
