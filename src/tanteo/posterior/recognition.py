"""Recognition from measurements: the part, its pose, and the findings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tanteo.defaults import SIGNIFICANCE, TOP
from tanteo.factors import ContactPoints, FreeRays, PoseFactor
from tanteo.features import SharedError
from tanteo.geometry.limits import NOTABLE
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.parts import Part
from tanteo.posterior.answers.furniture import Furniture
from tanteo.posterior.answers.pose_prior import PosePrior
from tanteo.posterior.answers.priors import Priors, sized
from tanteo.posterior.answers.question import Clock, check_question
from tanteo.posterior.answers.results import Answer, Hypothesis
from tanteo.posterior.candidate_pruning import Active, Unsearched, screen
from tanteo.posterior.candidates import Candidates
from tanteo.posterior.contradictions import plane_of_outliers
from tanteo.posterior.decision import Outcome, outliers_on_plane, verdict_of
from tanteo.posterior.dominant_error import unstated_errors_limit
from tanteo.posterior.fit_at_mode import GoodnessOfFit, goodness_of_fit
from tanteo.posterior.furniture_points import without_pose
from tanteo.posterior.observability_gate import observability_gate
from tanteo.posterior.posterior import Posterior, infer
from tanteo.posterior.prepared import PreparedPart
from tanteo.posterior.prior_check import check_prior
from tanteo.posterior.problem import Problem
from tanteo.posterior.result import as_hypothesis, worst_reading
from tanteo.posterior.sampling.modes import Mode
from tanteo.posterior.settings import DEFAULTS, Settings
from tanteo.sensors.error_states import UnstatedError

_BESIDE = "unstated plane"
"""Name of a table or jaw that the user did not state."""


def identify_points(
    points: ContactPoints,
    rays: FreeRays,
    parts: Sequence[Part] | Sequence[PreparedPart],
    *,
    shared: Sequence[SharedError] = (),
    significance: float = SIGNIFICANCE,
    top: int = TOP,
    priors: Priors | None = None,
    factors: Sequence[PoseFactor] = (),
    seed: int = 0,
    settings: Settings = DEFAULTS,
    unstated: Sequence[UnstatedError] = (),
) -> Answer:
    """Identify the sensed part and estimate its pose, from measurements with or without labels.

    Args:
        points: contact points and beam hits in the world; with directions, normals, tip radii and labels where known.
        rays: free-space rays.
        parts: candidate parts, prepared or not; prepared data is stored with the part.
        shared: shared errors of the points, in the order of their columns, for the text of the answer.
        significance: p-value below which the joint test rejects an answer.
        top: number of hypotheses to report.
        priors: priors of the inference.
        factors: further measurements of the pose, such as images and functions of a user.
        seed: seed of the search and the samples.
        settings: settings of the inference.
        unstated: errors that the points may share although they are not stated; they widen the covariance of the pose.

    Raises:
        InputError: no part, or ``significance`` outside (0, 1).
    """
    parts = check_question(parts, significance, top, seed, priors)
    clock = Clock()
    candidates = Candidates(parts)
    problem = Problem(
        points, rays, sized(priors, float(candidates.radii.max())), pose_factors=tuple(factors), settings=settings,
        typical_area=float(candidates.areas.mean()),
    )  # fmt: skip
    clock.lap("prepare")
    if (few := observability_gate(problem)) is not None:
        return Answer("insufficient", (few,), (), 1.0, clock.laps(), seed, significance=significance)
    odds = candidates.log_odds(problem.priors.whole)
    chosen, posterior = _searched(problem, candidates, odds, seed, clock)
    found, hypotheses = _located(posterior, problem.priors.pose, top, unstated)
    clock.lap("locate")
    plane = plane_of_outliers(found[0], hypotheses[0].corner_sd) if found and hypotheses else None
    if plane is not None and plane.is_certain and posterior.unknown > NOTABLE:
        # a table or a jaw explains its readings for every object: they are no evidence against the part
        beside = replace(Furniture.of_table(plane.table, plane.table.point, problem.priors.radius), name=_BESIDE)
        known = replace(problem.priors, furniture=(*problem.priors.furniture, beside))
        answer = identify_points(
            points, rays, parts, shared=shared, significance=significance, top=top, priors=known, factors=factors,
            seed=seed, settings=settings, unstated=unstated,
        )  # fmt: skip
        return answer.adding(outliers_on_plane(points, plane))
    worst = worst_reading(points, found[0]) if found else None
    alone = replace(posterior.problem, priors=without_pose(points, problem.priors))
    check = check_prior(
        posterior,
        hypotheses[0] if hypotheses else None,
        lambda: _answer(alone, candidates, screen(alone, candidates, odds), seed),
        significance,
    )
    if check.other is not None:  # the prior is wrong: report the pose that fits without it
        found, hypotheses = _located(check.other, None, top, unstated)
        share = 1 - posterior.unknown
        hypotheses = tuple(replace(h, probability=h.probability * share) for h in hypotheses)
    clock.lap("compare")
    limit = None
    if hypotheses and unstated:
        without = as_hypothesis(points, found[0], problem.priors.pose if check.other is None else None).corner_sd
        limit = unstated_errors_limit(hypotheses[0].corner_sd, without, settings.checks.limiting_share)
    shown = check.other or posterior
    outcome = Outcome(candidates, chosen, posterior, shown.modes, found, hypotheses, check, worst, limit, plane)
    status, findings = verdict_of(outcome, significance, shared)
    return Answer(
        status, findings, hypotheses, posterior.unknown, clock.laps(), seed, significance=significance,
        parts=_of_parts(shown.modes, 1.0 if check.other is None else 1 - posterior.unknown),
        missed_probability=shown.missing * (1 - posterior.unknown),
    )  # fmt: skip


def _of_parts(modes: Sequence[Mode], share: float) -> tuple[tuple[str, float], ...]:
    """Return the probability of each part over all of its poses, most probable first."""
    shares: dict[str, float] = {}
    for mode in modes:
        name = mode.prepared.part.name
        shares[name] = shares.get(name, 0.0) + share * mode.probability
    return tuple(sorted(shares.items(), key=lambda share: -share[1]))


def _searched(
    problem: Problem, candidates: Candidates, odds: FloatArray, seed: int, clock: Clock
) -> tuple[Active, Posterior]:
    """Return the active parts and their posterior; more parts are searched if these do not explain the points."""
    chosen = screen(problem, candidates, odds)
    problem = replace(problem, odds=candidates.named(odds, [*chosen.rows, *chosen.others] if odds.any() else ()))
    clock.lap("narrow")
    posterior = _answer(problem, candidates, chosen, seed)
    if chosen.pruned_by_properties and posterior.unknown > 0.5:  # mass or size may be wrong
        chosen = screen(problem, candidates, odds, every=True)
        posterior = _answer(problem, candidates, chosen, seed)
    clock.lap("search")
    return chosen, posterior


def _located(
    posterior: Posterior, pose: PosePrior | None, top: int, unstated: Sequence[UnstatedError]
) -> tuple[list[GoodnessOfFit], tuple[Hypothesis, ...]]:
    """Return the goodness of fit of the best and all probable modes, and the best modes as hypotheses."""
    count = max(top, sum(mode.probability > NOTABLE for mode in posterior.modes))
    found = [goodness_of_fit(mode) for mode in posterior.modes[:count]]
    return found, tuple(as_hypothesis(posterior.problem.points, one, pose, unstated) for one in found[:top])


def _answer(problem: Problem, candidates: Candidates, chosen: Active, seed: int) -> Posterior:
    """Return the posterior of the active parts."""
    parts = [candidates.prepared(int(row)).at(problem.resolution) for row in chosen.rows]
    known = [_proposed(problem, candidates, chosen, int(row)) for row in chosen.rows]
    rest = set(chosen.others.tolist())

    def similar(part: PreparedPart) -> list[PreparedPart]:
        rows = [row for row in candidates.similar(part, chosen.others, problem.settings.pruning) if row in rest]
        rest.difference_update(rows)
        return [candidates.prepared(row).at(problem.resolution) for row in rows]

    centroid = candidates.centroids.mean(axis=0)
    log_ratio = chosen.unsearched if chosen.bound else None
    return infer(
        problem, parts, len(candidates), centroid, np.random.default_rng(seed),
        known=known,
        exhaustive=chosen.exhaustive,
        unsearched=Unsearched(len(rest), log_ratio, chosen.discount, similar, chosen.bound and not chosen.exhaustive),
    )  # fmt: skip


def _proposed(problem: Problem, candidates: Candidates, chosen: Active, row: int) -> Transforms | None:
    """Return initial poses of a part: from measurements, pose factors and an outline; None if there are none."""
    whole, found = problem.priors.whole, chosen.known.get(row)
    proposed = [factor.poses(candidates.prepared(row).part) for factor in problem.pose_factors]
    if whole is not None and whole.outline is not None:
        proposed.append(whole.outline.poses(candidates.parts, row, problem.settings.search.negligible))
    known = [] if found is None else [found]
    known += [Ts for Ts in proposed if len(Ts)]
    return np.concatenate(known) if known else None
