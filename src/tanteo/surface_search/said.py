"""Whether the part is where it was said to be: what was said of the pose, against the readings.

Near the answer distances tell. If what was said is far off, the answer is a pose that fits badly where the part is not,
and only a search without it finds the one that fits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from tanteo.localization import pose_information, weak_motions
from tanteo.matching.evidence import Priors
from tanteo.matching.part_motions import part_scale
from tanteo.matching.prior import prior_rows
from tanteo.matching.results import Hypothesis
from tanteo.surface_search.explained import explained
from tanteo.surface_search.likelihood import log_posterior
from tanteo.surface_search.mode import Mode
from tanteo.surface_search.polish import polish
from tanteo.surface_search.touches import FreePaths, Touches
from tanteo.surface_search.weighed import Weighed
from tanteo.surface_search.within import log_within

_DOUBT = 0.05
"""P-values of the answer, and of what was said, above which a search without it is not worth its time."""


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


def p_of_prior(touches: Touches, free: FreePaths, mode: Mode, priors: Priors) -> float:
    """P-value of what was known of the pose beforehand, beside the readings near an answer: 1 without.

    Without it the readings fit somewhere near as well or better: by how much, beside the squared distance of the pose
    from what was said, is chi-square of as many degrees as both say something of. A box is as probable as the share of
    the pose that it leaves, if the part is at its border.

    Args:
        touches: the readings.
        free: paths on which nothing was met.
        mode: the answer.
        priors: what is assumed beforehand.
    """
    part, T, z = mode.target.part, mode.found.Ts[[mode.k]], mode.found.z[[mode.k]]
    known = prior_rows(priors.pose, part, T)[0][0]
    share = 1.0 if mode.moments is None else mode.moments.share
    if not len(known):
        return share
    alone = replace(priors, pose=None)
    apart = polish(touches, free, T, mode.target, alone)
    log = log_posterior(touches, free, np.concatenate([T, apart.Ts]), np.concatenate([z, apart.z]), mode.target, alone)
    left = weak_motions(pose_information(apart.information[0]), part_scale(part))  # there it is as it was said to be
    dof = max(len(known) - len(left), 1)
    return min(share, float(chdtrc(dof, max(known @ known + 2 * (log[1] - log[0]), 0.0))))
