"""What is said of the parts that were found: status and message, what they rest on, what was not searched."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.answers import Hypothesis, Priors, Status, verdict
from tanteo.features import SharedError
from tanteo.inference.candidates import Candidates
from tanteo.inference.diagnostics import (
    against_labels,
    around_words,
    face_elsewhere,
    left_out,
    mostly_on,
    not_on_it,
    scattered,
)
from tanteo.inference.fit_at_mode import GoodnessOfFit
from tanteo.inference.limits import what_limits
from tanteo.inference.narrowing import Narrowed
from tanteo.inference.posterior import Posterior
from tanteo.inference.prior_check import PriorCheck

_PATCH = 0.2
"""Share of the part's size that measurements have to reach over, or the pose to be roughly known, for one answer."""

_CLOSE = (
    "the readings lie so close together that other places may look like it: sense farther apart, or say --pose-prior."
)

_MAY_MISS = 0.05
"""Probability of poses that the search met only once from which the answer says that others may fit."""


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What was found, before it is put into words.

    Attributes:
        candidates: all parts.
        chosen: those that were searched.
        posterior: over them.
        found: the modes with the measurements at each, best first.
        hypotheses: as many of them as are reported.
        check: how the prior of the pose agrees.
        worst: what contradicts the best one most, in words.
    """

    candidates: Candidates
    chosen: Narrowed
    posterior: Posterior
    found: list[GoodnessOfFit]
    hypotheses: tuple[Hypothesis, ...]
    check: PriorCheck
    worst: str


def verdict_of(outcome: Outcome, significance: float, shared: Sequence[SharedError]) -> tuple[Status, str]:
    """Status and message: the verdict, what it rests on, and what is odd about the measurements."""
    posterior, found, hypotheses, check = outcome.posterior, outcome.found, outcome.hypotheses, outcome.check
    unknown, priors = posterior.unknown, posterior.problem.priors
    status, message = verdict(
        hypotheses,
        unknown,
        significance,
        worst=outcome.worst,
        shares=[(one.mode.prepared.part.name, one.mode.probability) for one in found],
        prior_p=check.p,
        elsewhere=check.elsewhere,
        same=outcome.candidates.names_alike(found[0].mode.prepared.part) if found else (),
    )
    if status == "unknown" and not check.elsewhere:
        status, message = _known_after_all(message, hypotheses, outcome.chosen, posterior)
    if status == "recognized":
        status, message = _doubted(message, found[0], priors)
    if hypotheses and status == "recognized":
        message += what_limits(found[0], shared) + left_out(hypotheses[0], priors)
    if found and status != "insufficient":
        message += face_elsewhere(posterior.problem.points, found[0], unknown, priors)
    message += around_words(found[0]) if found else ""
    message += _missed(posterior.missing, status) + _not_searched(outcome.chosen, posterior, status)
    message += scattered(hypotheses[0], outcome.worst) if hypotheses and status != "unknown" else ""
    return status, message


def _known_after_all(
    message: str, hypotheses: tuple[Hypothesis, ...], chosen: Narrowed, posterior: Posterior
) -> tuple[Status, str]:
    """An unknown object that may be one of the parts that were not searched, or that lies beside the best."""
    if posterior.left_out > 0.5 * posterior.unknown > 0:
        return "ambiguous", _among_unsearched(hypotheses, chosen, posterior)
    if hypotheses and mostly_on(hypotheses[0], posterior.unknown):
        return "unknown", not_on_it(hypotheses[0], posterior.unknown)
    return "unknown", message


def _doubted(message: str, best: GoodnessOfFit, priors: Priors) -> tuple[Status, str]:
    """A part that was recognised, unless its readings lie close together or contradict its labels."""
    if _close_together(best):
        return "ambiguous", f"{message[:-1]}, if there: {_CLOSE}"
    doubt = against_labels(best, priors)
    return ("ambiguous", doubt) if doubt else ("recognized", message)


def _not_searched(chosen: Narrowed, posterior: Posterior, status: str) -> str:
    """That parts which were not searched may explain the readings as well, where that matters."""
    if status == "recognized" or not _MAY_MISS < posterior.left_out < 0.5:
        return ""
    return (
        f" {len(chosen.others):,} parts were not searched, which together may explain the readings with a probability "
        f"of up to {100 * posterior.left_out:.0f} %: more readings, or labelled ones, tell."
    )


def _among_unsearched(hypotheses: tuple[Hypothesis, ...], chosen: Narrowed, posterior: Posterior) -> str:
    """That so little was sensed that very many parts may explain it."""
    best = f"It may be {hypotheses[0].part}, or" if hypotheses else "It may be"
    return (
        f"{best} one of {len(chosen.others):,} parts that were not searched, as the readings hardly discriminate them "
        f"(up to P = {posterior.left_out:.2f}): sense more places, with normals or labels if the sensor gives them."
    )


def _close_together(best: GoodnessOfFit) -> bool:
    """Whether the points are of a small patch, which many a part has twice, and nothing else says where it is."""
    problem = best.mode.objective.problem
    known = problem.priors.pose is not None and problem.priors.pose.T_world_part is not None
    placed = known or bool(problem.pose_factors)
    points = problem.points.take(problem.around.others)
    off = np.linalg.norm(points.points - np.median(points.points, axis=0), axis=1)
    return not placed and 2 * float(np.quantile(off, 0.75)) < _PATCH * best.mode.prepared.part.diagonal


def _missed(once: float, status: str) -> str:
    """What the search may have missed, where that matters: others than the poses that are listed."""
    if status not in ("ambiguous", "insufficient") or once <= _MAY_MISS:
        return ""
    return f" {100 * once:.0f} % of the probability is in poses that the search met only once: others may fit."
