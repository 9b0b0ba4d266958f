"""Whether the part is where it was said to be: what was said of the pose, against the readings.

Near the answer distances tell. If what was said is far off, the answer is a pose that fits badly where the part is not,
and only a search without it finds the one that fits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from tanteo.lie import SE3
from tanteo.localization import pose_information, weak_motions
from tanteo.matching.part_motions import part_scale
from tanteo.matching.prior import prior_rows
from tanteo.matching.priors import Priors
from tanteo.matching.results import Hypothesis
from tanteo.surface_search.explained import explained
from tanteo.surface_search.likelihood import log_posterior
from tanteo.surface_search.mode import Mode
from tanteo.surface_search.polish import polish
from tanteo.surface_search.touches import FreePaths, Touches
from tanteo.surface_search.weighed import Weighed
from tanteo.surface_search.within import log_within
from tanteo.typing import FloatArray, Transforms

_DOUBT = 0.05
"""P-values of the answer, and of what was said, above which a search without it is not worth its time."""

_ASIDE = 0.5
"""Probability of being on the surface up to which a reading is left aside."""

_DRAWS = 32
"""Poses about a mode from which the one is looked for that agrees best with both."""


@dataclass(frozen=True, slots=True)
class Said:
    """How what was said of the pose agrees with the readings.

    Attributes:
        p: p-value of it; 1 if nothing was said.
        elsewhere: the part that explains the readings far better where it was not said to be; empty if none does.
    """

    p: float = 1.0
    elsewhere: str = ""


def what_was_said(
    weighed: Weighed,
    free: FreePaths,
    best: Hypothesis | None,
    priors: Priors,
    without: Callable[[], Weighed],
    alpha: float,
) -> Said:
    """Whether what was said of the pose is contradicted: near the answer, or by an answer without it.

    Where it is true, readings are ``1 / alpha`` times denser without it than with it in at most ``alpha`` of all cases,
    whatever their distribution, because both densities integrate to one.

    Args:
        weighed: the answer.
        free: paths on which nothing was met.
        best: its first hypothesis; None if there is none.
        priors: what is assumed beforehand.
        without: the answer if nothing had been said of the pose, which is looked for if there is doubt.
        alpha: least p-value.
    """
    if priors.pose is None:
        return Said()
    fits = best is not None and best.probability >= weighed.unknown
    p = p_of_prior(weighed.touches, free, weighed.modes[0], priors) if weighed.modes else 1.0
    if best is not None and fits and not best.outliers and min(p, best.p_value, _share(weighed, priors)) > _DOUBT:
        return Said(p)
    other = without()
    if not other.modes or other.modes[0].probability < other.unknown or not _explains(other.modes[0], priors):
        return Said(p if fits else 1.0)
    bound = float(np.exp(min(weighed.log_total - other.log_total, 0.0)))
    if bound < alpha:
        return Said(min(p, bound), other.modes[0].target.part.name)
    return Said(p)


def _share(weighed: Weighed, priors: Priors) -> float:
    """Of the first mode, in the box, by its curvature: also where a motion is free, of which no moments are known."""
    found, rows = weighed.modes[0].found, [weighed.modes[0].k]
    return float(np.exp(log_within(priors, weighed.modes[0].target.part, found.Ts[rows], found.information[rows])[0]))


def _explains(mode: Mode, priors: Priors) -> bool:
    """Whether the readings are of the part, there, with no more strays than are to be expected."""
    return explained(mode.found.take(np.array([mode.k])), priors.clutter)


def p_of_prior(touches: Touches, free: FreePaths, mode: Mode, priors: Priors, draws: Transforms | None = None) -> float:
    """P-value of what was known of the pose beforehand, beside the readings near an answer: 1 without.

    Without it the readings fit somewhere near as well or better: by how much, beside the squared distance of the pose
    from what was said, is chi-square of as many degrees as both say something of. A box is as probable as the share of
    the pose that it leaves, if the part is at its border. What was said is looked at where it agrees better with the
    readings: at the answer, or at a maximum beside it; the likeliest one may leave a reading aside that it need not.

    Args:
        touches: the readings.
        free: paths on which nothing was met.
        mode: the answer.
        priors: what is assumed beforehand.
        draws: poses as the posterior has them ``(S, 4, 4)``; about the mode as its moments say if not given.
    """
    target, T, z = mode.target, mode.found.Ts[[mode.k]], mode.found.z[[mode.k]]
    share = 1.0 if mode.moments is None else mode.moments.share
    known = prior_rows(priors.pose, target.part, T)[0].shape[1]
    if not known:
        return share
    alone = replace(priors, pose=None)
    apart = polish(touches, free, T, target, alone)
    left = weak_motions(pose_information(apart.information[0]), part_scale(target.part))  # there it is as it was said
    best = log_posterior(touches, free, apart.Ts, apart.z, target, alone)[0]

    def p(Ts: Transforms, zs: FloatArray) -> float:
        off = np.sum(prior_rows(priors.pose, target.part, Ts)[0] ** 2, axis=1)
        off += 2 * (best - log_posterior(touches, free, Ts, zs, target, alone))
        return float(chdtrc(max(known - len(left), 1), max(off.min(), 0.0)))

    there = p(T, z)
    if there < _DOUBT and mode.found.belongs[mode.k].min() <= _ASIDE:  # which a pose beside it, as probable, need not
        about = _about(mode) if draws is None else draws
        others = polish(touches, free, np.concatenate([apart.Ts, about]), target, priors)
        there = max(there, p(others.Ts, others.z))
    return min(share, there)


def _about(mode: Mode) -> Transforms:
    """Poses as a mode that is not normal says they are distributed ``(S, 4, 4)``; none of one that is."""
    if mode.moments is None:
        return np.zeros((0, 4, 4))
    values, vectors = np.linalg.eigh(mode.covariance)  # what symmetry leaves free may have none
    draws = np.random.default_rng(1991).normal(size=(_DRAWS, 6)) * np.sqrt(values.clip(0.0)) @ vectors.T
    return np.asarray(mode.T_world_part @ SE3.exp(draws))
