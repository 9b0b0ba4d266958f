"""The posterior around a maximum where one heavy-tailed density does not find its way.

With noise of a tenth of the part, or readings that slide over an edge, the posterior about a maximum has many sheets:
its mass can be fifty times that of the curvature, and lies beside other maxima of the same part. As of a rough pose
(:mod:`sheets`), draws from densities all over it tell masses and moments; here the rough pose is the maximum itself,
some times as uncertain as its curvature says, and no part of the posterior.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from tanteo.lie import SE3
from tanteo.matching.freedom import pose_scale
from tanteo.matching.prior import in_box
from tanteo.matching.priors import Priors
from tanteo.surface_search.adapted_draws import effective
from tanteo.surface_search.given_pose import GivenPose, Posterior, given_pose
from tanteo.surface_search.mode import Mode
from tanteo.surface_search.nodes import Nodes, Rough, about
from tanteo.surface_search.polish import Polished
from tanteo.surface_search.sheets import HOPELESS, LEAST, MOST_MAXIMA, all_over, pieces_of
from tanteo.surface_search.touches import FreePaths, Touches
from tanteo.typing import BoolArray, Covariances, FloatArray, IntArray, Tangents, Transforms

_WIDER = 3.0
"""So many times as wide as by its curvature the maximum is looked around."""

_MOST_TURN = 1.0
"""Standard deviation of the attitude then [rad]: of more, draws would meet themselves behind a full turn."""

_BESIDE = 9.0
"""Squared Mahalanobis distance in that within which another maximum is one of those around."""


def modes_around(
    touches: Touches, free: FreePaths, mode: Mode, left: Sequence[int], priors: Priors
) -> tuple[list[Mode], list[int]]:
    """Modes by draws from all around a maximum, and the maxima that they replace; itself where that tells nothing.

    That is of parts with a continuous symmetry, of rough poses, and where too few draws count.

    Args:
        touches: all readings that met something.
        free: all paths on which nothing was met.
        mode: the maximum.
        left: other maxima of the part that may be part of what is around it; what is about any other is not.
        priors: rate of clutter, the size of the workspace, and what is known of the pose.
    """
    part, found, T = mode.target.part, mode.found, mode.found.Ts[mode.k]
    covariance = _WIDER**2 * mode.covariance
    known = priors.pose is not None and priors.pose.T_world_part is not None
    if known or part.symmetry.continuous or np.linalg.eigvalsh(covariance[3:, 3:])[-1] > _MOST_TURN**2:
        return [mode], []
    rows, maxima, near = _maxima(mode, left, covariance)
    around = Rough(touches, mode.target, priors, partial(given_pose, touches, free, mode.target, priors), T, covariance)
    peaks, tops = about(around, maxima.Ts)
    own = replace(around, posterior=_own(around.posterior, peaks, near, T, part.symmetry.Ts))
    if not np.isfinite(own.posterior(maxima.Ts[:1], maxima.z[:1]).log[0]):
        return [mode], []  # it lies in the shade of another, or in the way of a beam
    drawn = all_over(own, maxima.Ts[:near])
    log_anywhere = float(np.linalg.slogdet(pose_scale(priors.radius, part.centroid))[1])
    drawn = replace(drawn, tops=tops.first(near), log_weights=drawn.log_weights - log_anywhere)
    inside = in_box(priors.pose, part, drawn.Ts)
    if effective(np.where(inside, drawn.log_weights, -np.inf)) < LEAST:
        return [mode], []
    rest = mode.log_mass - float(found.log_evidence[mode.k])
    pieces = pieces_of(part, maxima.take(np.arange(near)), drawn, inside)
    return [Mode(mode.target, maxima, p.k, p.log_mass + rest, p.moments) for p in pieces], [int(k) for k in rows[:near]]


def _maxima(mode: Mode, left: Sequence[int], covariance: Covariances) -> tuple[IntArray, Polished, int]:
    """The maxima of a part, those around one first; as they are beside it; how many are around it.

    Of the poses that symmetry makes one with a maximum, the nearest is beside.

    Args:
        mode: the maximum, which comes first.
        left: which others may be around it.
        covariance: in which distances are meant ``(6, 6)``.
    """
    found, turns = mode.found, mode.target.part.symmetry.Ts
    x = SE3.log(SE3.inverse(found.Ts[mode.k]) @ found.Ts[:, None] @ turns)
    squared = np.einsum("sji,ik,sjk->sj", x, np.linalg.inv(covariance), x)
    gap, turn = squared.min(axis=1), turns[squared.argmin(axis=1)]
    gap[mode.k], near = -1.0, np.isin(np.arange(len(gap)), [mode.k, *left]) & (gap < _BESIDE)
    hopeful = np.flatnonzero((found.log_evidence > found.log_evidence[mode.k] - HOPELESS) | (gap < 0))
    rows = hopeful[np.lexsort([gap[hopeful], ~near[hopeful]])][:MOST_MAXIMA]
    some, turn = found.take(rows), turn[rows]
    Ad, D = SE3.adjoint(turn), some.z.shape[1]
    both = np.tile(np.eye(6 + D), (len(rows), 1, 1))
    both[:, :6, :6] = Ad
    information = np.swapaxes(both, 1, 2) @ some.information @ both
    maxima = replace(some, Ts=some.Ts @ turn, information=information, rows=some.rows @ Ad)
    return rows, maxima, int(near[rows].sum())


def _own(posterior: Posterior, peaks: Nodes, near: int, T: Transforms, turns: Transforms) -> Posterior:
    """The posterior of all rigid motions, where it is that around one maximum; nothing elsewhere.

    Args:
        posterior: of the part.
        peaks: densities about all maxima.
        near: how many of them are around the one; what is about the others is theirs.
        T: the one ``(4, 4)``.
        turns: of the part's symmetry: what is nearer to another of these poses is the same once more.
    """

    def at(Ts: Transforms, z: FloatArray) -> GivenPose:
        found, x = posterior(Ts, z), peaks.perturbations(Ts)
        own = (peaks.nearest(x) < near) & _unturned(SE3.inverse(T) @ Ts, turns)
        return replace(found, log=np.where(own, found.log + _log_volume(x), -np.inf))

    return at


def _unturned(gaps: Transforms, turns: Transforms) -> BoolArray:
    """Which relative poses ``(S, 4, 4)`` no symmetry makes a smaller turn."""
    if len(turns) == 1:
        return np.ones(len(gaps), dtype=bool)
    angles = np.linalg.norm(SE3.log(gaps @ turns[:, None])[..., 3:], axis=-1)
    return np.asarray(angles.argmin(axis=0) == 0)


def _log_volume(x: Tangents) -> FloatArray:
    """Log of the volume of rigid motions that perturbations ``(S, 6)`` stand for, over that at none."""
    half = np.linalg.norm(x[:, 3:], axis=1) / 2
    return np.asarray(2 * np.log(np.sinc(half / np.pi)))
