"""Maxima from samples of the pose prior, moved onto the surface; and bases along a ridge of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tanteo import _core
from tanteo.inference.peaks import FAINT, SAME, Objective, Peaks
from tanteo.inference.proposals import best_of_prior
from tanteo.typing import IntArray, Transforms

_GROUP, _LEFT_OUT = 8, 4
"""Draws that are moved onto the surface by the same points, of which one in so many is left out."""

RIDGE, _PIECE, _FEW = 40, 0.5, 12
"""Poses along a ridge, and the length of the piece of each in standard deviations of all; fewer than the last tell no
spread in six directions."""


def sample_prior(objective: Objective, groups: IntArray, rng: np.random.Generator) -> Peaks:
    """Maxima to which the best of many samples of the prior lead.

    A third is moved onto the surface by all points, the others by some: a point near an edge that is taken for one of
    the face beyond it holds all poses that are settled with it.

    Args:
        objective: the part and the problem.
        groups: of each draw, one bit; as many draws ``(N,)``.
        rng: of the samples.
    """
    Ts = best_of_prior(
        objective.core, objective.problem, objective.prepared, objective.rows, objective.scales, len(groups), rng
    )
    Ts = Ts[rng.permutation(len(Ts))]
    third = len(Ts) // 3 + 1
    peaks = objective.look(Ts[:third], groups[:third], third)
    some = np.array_split(np.arange(third, len(Ts)), max((len(Ts) - third) // _GROUP, 1))
    settled = [_settled_by_some(objective, Ts[rows], groups[rows], rng) for rows in some]
    starts, of = (np.concatenate(each) for each in zip(*settled, strict=True))
    return peaks.join(objective.maximize(starts, groups=of, fine=True))


def _settled_by_some(
    objective: Objective, Ts: Transforms, groups: IntArray, rng: np.random.Generator
) -> tuple[Transforms, IntArray]:
    """Poses moved onto the surface by some of the points, a quarter of them left out by chance."""
    n = len(objective.rows)
    rows = np.sort(rng.choice(objective.rows, n - n // _LEFT_OUT if n >= _LEFT_OUT else n, replace=False))
    return replace(objective, rows=rows.astype(np.int32)).settle(Ts, groups, max(len(Ts), 1))


def along_ridge(objective: Objective, Ts: Transforms) -> Peaks:
    """Bases of components along a ridge: poses moved onto the surface, each a small piece of the region of all.

    Few precise measurements leave a thin bent sheet of poses. The curvature at one maximum follows it nowhere else; at
    many places of it, each for a part of its length, it does.

    Args:
        objective: the part and the problem.
        Ts: poses that are spread as the ridge is, but for the last measurements ``(S, 4, 4)``.
    """
    Ts, _ = objective.settle(Ts, np.zeros(len(Ts), dtype=np.int64), len(Ts))
    zs, shape = np.zeros((len(Ts), objective.problem.states)), objective.prepared.shape
    logs, _, information = _core.slopes(shape, objective.core, Ts, zs)
    some = np.flatnonzero(logs > logs.max() - FAINT)
    if len(some) < _FEW:
        return Peaks.none(objective.problem.states)
    x = _core.offsets(Ts[some[0]], np.ascontiguousarray(Ts[some]), shape.centre)
    information = np.array(information[some])
    curved = np.linalg.inv(objective.of_pose(information[:1])[0])
    if np.einsum("ni,ij,nj->n", x, np.linalg.inv(curved), x).max() < SAME:
        return Peaks.none(objective.problem.states)
    information[:, :6, :6] += np.linalg.inv(np.cov(x.T) + curved) / _PIECE**2
    rest = np.full(len(some), -np.inf), np.zeros(len(some), dtype=np.int64)
    return Peaks(np.ascontiguousarray(Ts[some]), zs[some], logs[some], information, *rest)
