"""From measurements to the answer: which part they are of, where it is, and in which words that is said."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tanteo.answers import Answer, Clock, Hypothesis, Priors, Status, check_question, sized, verdict
from tanteo.features import SharedError
from tanteo.inference.around import without_pose
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
from tanteo.inference.fit_at_mode import GoodnessOfFit, goodness_of_fit
from tanteo.inference.limits import what_limits
from tanteo.inference.narrowing import Narrowed, narrowed
from tanteo.inference.posterior import Posterior, infer
from tanteo.inference.prepared import PreparedPart
from tanteo.inference.prior_check import check_prior
from tanteo.inference.problem import Problem
from tanteo.inference.result import as_hypothesis, worst_reading
from tanteo.inference.search import LeftOut
from tanteo.measurements import ContactPoints, FreeRays
from tanteo.parts import Part
from tanteo.sensors import CENTRE
from tanteo.typing import FloatArray, Transforms

LEAST = 3
"""Fewer measurements than this fit any surface in any way."""

_PATCH = 0.2
"""Share of the part's size that measurements have to reach over, or the pose to be roughly known, for one answer."""

_CLOSE = (
    "the readings lie so close together that other places may look like it: sense farther apart, or say --pose-prior."
)

_BARELY = 2.0
"""Points that scatter along their longest direction by so many standard deviations, or fewer, are all noise."""

_EQUAL = 1e-6
"""Relative difference of area and volume up to which two parts may be one: rounding of their files."""

_MAY_MISS = 0.05
"""Probability of poses that the search met only once from which the answer says that others may fit."""


def identify_points(
    points: ContactPoints,
    rays: FreeRays,
    parts: Sequence[Part] | Sequence[PreparedPart],
    *,
    shared: Sequence[SharedError] = (),
    significance: float = 0.01,
    top: int = 5,
    priors: Priors | None = None,
    seed: int = 0,
) -> Answer:
    """Which part the measurements are of, and its pose, labelled or not.

    Args:
        points: contact points and beam hits in the world; with directions, normals, tip radii and labels where known.
        rays: on which nothing was met.
        parts: candidates, prepared or not; what is prepared is kept with the part.
        shared: the errors behind ``points.gains``, in that order, for the words of the answer.
        significance: an answer whose joint test has a smaller p-value is not accepted.
        top: number of hypotheses to report.
        priors: what is assumed beforehand.
        seed: of the search and the samples.

    Raises:
        InputError: without parts, or for an ``significance`` outside (0, 1).
    """
    parts = check_question(parts, significance, top, seed, priors)
    clock = Clock()
    candidates = Candidates(parts)
    priors = sized(priors, float(candidates.radii.max()))
    clock.lap("prepare")
    problem = Problem(points, rays, priors)
    if message := _too_little(problem):
        return Answer("insufficient", message, (), 1.0, clock.laps(), seed)
    odds = candidates.log_odds(priors.whole)
    chosen = narrowed(problem, candidates, odds)
    problem = replace(problem, odds=candidates.named(odds, [*chosen.rows, *chosen.others] if odds.any() else ()))
    clock.lap("narrow")
    posterior = _answer(problem, candidates, chosen, seed)
    if chosen.aside and posterior.unknown > 0.5:  # nothing explains the points: what was measured may be of another
        chosen = narrowed(problem, candidates, odds, every=True)
        posterior = _answer(problem, candidates, chosen, seed)
    clock.lap("search")
    found = [goodness_of_fit(mode) for mode in posterior.modes]
    hypotheses = tuple(as_hypothesis(points, one, priors.pose) for one in found[:top])
    clock.lap("locate")
    worst = worst_reading(points, found[0]) if found else ""
    alone = replace(problem, priors=without_pose(points, priors))
    check = check_prior(
        posterior,
        hypotheses[0] if hypotheses else None,
        lambda: _answer(alone, candidates, narrowed(alone, candidates, odds), seed),
        significance,
    )
    if check.other is not None:  # where the prior has it, it fits another pose: it is told where it was felt
        found = [goodness_of_fit(mode) for mode in check.other.modes]
        hypotheses = tuple(
            replace(h, probability=h.probability * (1 - posterior.unknown))
            for h in (as_hypothesis(points, one, None) for one in found[:top])
        )
    clock.lap("compare")
    shares = [(one.mode.prepared.part.name, one.mode.probability) for one in found]
    unknown = posterior.unknown
    status, message = verdict(
        hypotheses, unknown, significance, worst=worst, shares=shares, prior_p=check.p, elsewhere=check.elsewhere,
        same=candidates.names_alike(found[0].mode.prepared.part, _EQUAL) if found else (),
    )  # fmt: skip
    if status == "unknown" and not check.elsewhere:
        status, message = _known_after_all(message, hypotheses, chosen, posterior)
    if status == "recognized":
        status, message = _doubted(message, found[0], priors)
    if hypotheses and status == "recognized":
        message += what_limits(found[0], shared) + left_out(hypotheses[0], priors)
    message += face_elsewhere(points, found[0], unknown, priors) if found and status != "insufficient" else ""
    message += around_words(found[0]) if found else ""
    message += _missed(posterior.missing, status) + _not_searched(chosen, posterior, status)
    message += scattered(hypotheses[0], worst) if hypotheses and status != "unknown" else ""
    return Answer(status, message, hypotheses, unknown, clock.laps(), seed)


def _answer(problem: Problem, candidates: Candidates, chosen: Narrowed, seed: int) -> Posterior:
    """The posterior of the parts that are worth a search."""
    parts = [candidates.prepared(int(row)) for row in chosen.rows]
    hints = [_proposed(problem, candidates, chosen, int(row)) for row in chosen.rows]
    rest = set(chosen.others.tolist())

    def alike(part: PreparedPart) -> list[PreparedPart]:
        rows = [row for row in candidates.alike(part, chosen.others) if row in rest]
        rest.difference_update(rows)
        return [candidates.prepared(row) for row in rows]

    centroid = candidates.centroids.mean(axis=0)
    behind = chosen.left_out if chosen.bound else None
    return infer(
        problem, parts, len(candidates), centroid, np.random.default_rng(seed), hints=hints, certain=chosen.certain,
        left_out=LeftOut(
            len(rest), behind, chosen.discount, alike, untried=chosen.bound and not chosen.certain
        ),
    )  # fmt: skip


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


def _proposed(problem: Problem, candidates: Candidates, chosen: Narrowed, row: int) -> Transforms | None:
    """Poses of a part to begin with: by what was sensed, and where an image shows the outline of the object."""
    whole, found = problem.priors.whole, chosen.hints.get(row)
    if whole is None or whole.outline is None:
        return found
    seen = whole.outline.poses(candidates.parts, row)
    if not len(seen):
        return found
    return seen if found is None else np.concatenate([found, seen])


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
    placed = problem.priors.pose is not None and problem.priors.pose.T_world_part is not None
    points = problem.points.take(problem.around.others)
    off = np.linalg.norm(points.points - np.median(points.points, axis=0), axis=1)
    return not placed and 2 * float(np.quantile(off, 0.75)) < _PATCH * best.mode.prepared.part.diagonal


def _too_little(problem: Problem) -> str:
    """What to do if nothing tells the points from those of a line, or from one point; empty if there is enough."""
    points, named = problem.points.take(problem.around.others), problem.priors.pose is not None
    if not len(points) and len(problem.points):
        of = problem.around.names[problem.around.which[0]]
        return f"All {len(problem.points)} readings are on the {of}: sense the part, on several sides."
    if not len(points):
        return f"No reading met anything: sense {LEAST} places or more, better eight, on several sides."
    line = ", slid along its axis" if CENTRE in points.kinds else ""
    if len(points) == 1 and points.centres.any():
        return (
            f"One centre fits every hole, boss or sphere of its size, and leaves free how the part is tilted, turned "
            f"about it{line}: sense a second one, and a face."
        )
    if len(points) == 2 and points.centres.all() and not (named or points.oriented.any()):
        line = " and slid along its holes" if line else ""
        return (
            f"Two centres leave free how the part is turned about their line{line}: sense a face, at three places, or "
            "a third centre that is not in line with them."
        )
    if points.held < LEAST:
        few = "1 reading fits" if len(points) == 1 else f"{len(points)} readings fit"
        return f"{few} any part: sense {LEAST} places or more, better eight, on several sides."
    if named or points.oriented.any() or np.count_nonzero(points.centres) > 1:
        return ""
    along, across = np.linalg.svd(points.points - points.points.mean(axis=0), compute_uv=False)[:2]
    sd = float(np.median(_along(points)))
    if across > sd * np.sqrt(len(points)):
        return ""
    if along > _BARELY * sd * np.sqrt(len(points)):
        return "The readings lie on one line within their noise: sense places beside it, on several sides."
    noise, what = f"{1e3 * sd:.4g} mm", "standard deviation"
    if points.tolerance > 0:
        noise, what = f"{noise} with the tolerance", "standard deviation, tolerance"
    return (
        f"The noise of the readings (sd {noise}) is as large as the whole set of them, so nothing can be told: check "
        f"{what} and their units, or sense places farther apart."
    )


def _along(points: ContactPoints) -> FloatArray:
    """Standard deviation of each point along its direction, where that is known: a beam's cone is across ``(n,)``."""
    along = np.sqrt(np.einsum("ni,nij,nj->n", points.directions, points.covs, points.directions))
    return np.asarray(np.where(points.directed, along, points.sd))


def _missed(once: float, status: str) -> str:
    """What the search may have missed, where that matters: others than the poses that are listed."""
    if status not in ("ambiguous", "insufficient") or once <= _MAY_MISS:
        return ""
    return f" {100 * once:.0f} % of the probability is in poses that the search met only once: others may fit."
