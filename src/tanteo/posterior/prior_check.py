"""Agreement of the prior pose with the measurements.

If the prior pose is slightly wrong, its distance from the answer shows it. If it is far off, the answer is a pose near
it that fits badly, and only a search without the prior finds the right one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tanteo import _core
from tanteo.fitting.localization import pose_information, weak_motions
from tanteo.geometry.limits import NOTABLE, SUSPECT
from tanteo.geometry.special import chi2_survival
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.posterior.answers.part_motions import part_scale
from tanteo.posterior.answers.pose_prior import in_box, prior_rows
from tanteo.posterior.answers.priors import Priors
from tanteo.posterior.answers.results import Hypothesis
from tanteo.posterior.fit_at_mode import GoodnessOfFit, goodness_of_fit
from tanteo.posterior.furniture_points import without_pose
from tanteo.posterior.outliers import are_unexpected, beta_binomial_tail
from tanteo.posterior.posterior import Posterior
from tanteo.posterior.sampling.modes import Mode
from tanteo.posterior.sampling.peaks import Objective


@dataclass(frozen=True, slots=True)
class PriorCheck:
    """Agreement of the prior pose with the measurements.

    Attributes:
        p: p-value of the prior pose; 1 without a prior.
        other: posterior without the prior, if a part explains the measurements far better at another pose; else None.
    """

    p: float = 1.0
    other: Posterior | None = None

    @property
    def elsewhere(self) -> str:
        """Return the name of the part that explains the measurements better at another pose; empty without one."""
        return self.other.modes[0].prepared.part.name if self.other is not None else ""


def check_prior(
    posterior: Posterior, best: Hypothesis | None, without: Callable[[], Posterior], significance: float
) -> PriorCheck:
    """Check whether measurements contradict the prior of the pose, near the answer or by a better answer without it.

    If the prior is true, the density without it exceeds that with it by a factor ``1 / significance`` in at most a
    fraction ``significance`` of all cases, for any distribution, because both densities integrate to one.

    Args:
        posterior: the posterior.
        best: first hypothesis; None if there is none.
        without: function that returns the posterior without the prior, called if there is doubt.
        significance: significance level.
    """
    priors = posterior.problem.priors
    if priors.pose is None:
        return PriorCheck()
    fits = best is not None and best.probability + posterior.missing >= posterior.unknown
    p = p_of_prior(posterior.modes[0], priors) if posterior.modes else 1.0
    n, own = len(posterior.problem.furniture.others), posterior.problem.settings.search
    doubtful = best is None or are_unexpected(len(best.outliers), n, priors.outlier_rate, own)
    if best is not None and fits and not doubtful and min(p, best.p_value, _share(posterior)) > NOTABLE:
        return PriorCheck(p)
    if not posterior.problem.settings.checks.of_prior:
        return PriorCheck(p if fits else 1.0)
    other = without()
    if not other.modes or other.modes[0].probability + other.missing < other.unknown:
        return PriorCheck(p if fits else 1.0)
    if not is_good_fit(goodness_of_fit(other.modes[0]), priors.outlier_rate):
        return PriorCheck(p if fits else 1.0)
    bound = float(np.exp(min(posterior.log_evidence - other.log_evidence, 0.0)))
    if bound < significance:
        return PriorCheck(min(p, bound), other)
    return PriorCheck(p)


def is_good_fit(one: GoodnessOfFit, rate: float) -> bool:
    """Return whether the residuals of a mode are noise, and its outliers no more than the rate explains."""
    outliers, n = int(np.sum(one.outliers)), len(one.outliers)
    if beta_binomial_tail(outliers, n, rate) <= NOTABLE:
        return False
    return one.misfit().p_value > SUSPECT


def _share(posterior: Posterior) -> float:
    """Return the fraction of the first mode without the box that is inside the box; 1 without a box."""
    pose, mode = posterior.problem.priors.pose, posterior.modes[0]
    if pose is None or pose.box is None:
        return 1.0
    alone = _alone(mode, posterior.problem.priors)
    peak = alone.maximize(mode.T_peak[None], fine=True)
    L = np.linalg.cholesky(np.linalg.inv(alone.of_pose(peak.information[0])))
    prior_samples = np.random.default_rng(1991).normal(size=(256, 6)) @ L.T
    Ts = _core.place(np.repeat(peak.Ts[:1], len(prior_samples), axis=0), prior_samples, alone.prepared.shape.centre)
    return float(np.mean(in_box(pose, alone.prepared.part, Ts)))


def _alone(mode: Mode, priors: Priors) -> Objective:
    """Return the objective of a mode without the prior of the pose."""
    problem = mode.objective.problem
    problem = replace(problem, priors=without_pose(problem.points, priors), mixtures={})
    return replace(mode.objective, problem=problem, core=problem.compiled(mode.prepared))


def p_of_prior(mode: Mode, priors: Priors) -> float:
    """Return the p-value of the prior of the pose given the measurements near an answer; 1 without a prior.

    Without the prior the measurements fit as well or better at a pose nearby. The gain in log density and the squared
    distance of that pose from the prior are together chi-square, with as many degrees of freedom as both constrain. The
    prior is evaluated where it agrees best with the measurements: at the answer or at one of its samples.

    Args:
        mode: mode of the answer.
        priors: priors of the inference.
    """
    part = mode.prepared.part
    share = _box_share(mode, priors)
    known = prior_rows(priors.pose, part, mode.T_peak[None])[0].shape[1]
    if not known:
        return share
    alone = _alone(mode, priors)
    apart = alone.maximize(mode.T_peak[None], mode.z[None], fine=True)
    left = weak_motions(pose_information(apart.information[0]), part_scale(part))
    best = float(apart.logs[0])
    zs = np.array(mode.z)
    if alone.problem.scale_sd > 0:
        zs[-1] = apart.zs[0, -1]  # noise of the measurements alone: a wrong prior is no noise

    def off(Ts: Transforms, zs: FloatArray) -> FloatArray:
        rows = prior_rows(priors.pose, part, Ts)[0]
        logs = _core.log_densities(mode.prepared.shape, alone.core, np.ascontiguousarray(Ts), np.ascontiguousarray(zs))
        return np.asarray(np.sum(rows**2, axis=1) + 2 * (best - logs))

    heavy = np.argsort(-mode.weights, kind="stable")[: alone.problem.settings.samples.heaviest]
    Ts = np.concatenate([mode.T_peak[None], mode.Ts[heavy]])
    least = off(Ts, np.repeat(zs[None], len(Ts), axis=0)).min()
    return min(share, chi2_survival(least, max(known - len(left), 1)))


def _box_share(mode: Mode, priors: Priors) -> float:
    """Return the fraction of a mode that is inside the box; 1 without a box."""
    if priors.pose is None or priors.pose.box is None:
        return 1.0
    return float(mode.weights @ in_box(priors.pose, mode.prepared.part, mode.Ts))
