"""What a box says of maxima, which may lie outside of it if their distributions reach in.

Inside, all places are alike, so nothing pulls a climb there; a maximum counts by the share of its distribution that has
the part's centroid in the box, and what is outside is left out of its moments.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from tanteo.localization import pose_information
from tanteo.matching.box import SURE, left_by
from tanteo.matching.freedom import pose_scale
from tanteo.matching.prior import in_box
from tanteo.matching.priors import Priors
from tanteo.parts import Part
from tanteo.surface_search.moments import Moments
from tanteo.typing import BoolArray, FloatArray, Transforms

_UNIFORM = 12.0
"""Information on a coordinate of the pose, over its extent, of one that is anywhere."""


def log_within(priors: Priors, part: Part, Ts: Transforms, information: FloatArray) -> FloatArray:
    """Log of the share of each maximum's distribution that a box leaves ``(S,)``; 0 without a box.

    Args:
        priors: what is known of the pose, and the size of the workspace, anywhere in which a free motion leads.
        part: the part.
        Ts: the maxima ``(S, 4, 4)``.
        information: on their poses and shared errors ``(S, 6 + D, 6 + D)``.
    """
    if priors.pose is None or priors.pose.box is None or not len(Ts):
        return np.zeros(len(Ts))
    scale = pose_scale(priors.radius, part.centroid)
    values, vectors = np.linalg.eigh(scale.T @ pose_information(information) @ scale)
    root = scale @ vectors / np.sqrt(np.maximum(values, _UNIFORM))[:, None]
    return left_by(priors.pose.box, part, Ts, root @ np.swapaxes(root, 1, 2)).log_share


def within(priors: Priors, part: Part) -> Callable[[Transforms], BoolArray] | None:
    """Which poses are in the box; None without one."""
    return None if priors.pose is None or priors.pose.box is None else partial(in_box, priors.pose, part)


def cut(priors: Priors, part: Part, T: Transforms, moments: Moments) -> Moments:
    """Moments of what a box leaves, and its share; the same if that is all, or if they are of that already.

    Args:
        priors: what is known of the pose.
        part: the part.
        T: the maximum ``(4, 4)``.
        moments: of the posterior about it.
    """
    if priors.pose is None or priors.pose.box is None or moments.share < 1:
        return moments
    about, mean = np.outer(moments.mean, moments.mean), moments.mean[None]
    Cs = np.stack([moments.covariance, moments.covariance_given_shared]) - about
    left = left_by(priors.pose.box, part, np.stack([T, T]), Cs, np.concatenate([mean, mean]))
    share = float(np.exp(left.log_share[0]))
    if share > SURE:
        return moments
    about = np.outer(left.means[0], left.means[0])
    log_mass = moments.log_mass + float(left.log_share[0])
    return replace(
        moments,
        mean=left.means[0],
        covariance=left.covariances[0] + about,
        covariance_given_shared=left.covariances[1] + about,
        log_mass=log_mass,
        share=share,
    )
