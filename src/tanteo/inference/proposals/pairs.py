"""Initial poses from pairs of points: two points are put on two places of the surface that are as far apart."""

from __future__ import annotations

from typing import final

import numpy as np

from tanteo import _core
from tanteo.inference.prepared import PreparedPart
from tanteo.inference.problem import Problem
from tanteo.inference.proposals.proposer import BITS, InitialPoses, Proposer, SearchState
from tanteo.inference.scales import pair_tilt
from tanteo.measurements import ContactPoints
from tanteo.typing import Indices


@final
class PointPairs(Proposer):
    """Pairs of points on pairs of surface places; each pair of points is an independent source."""

    name = "pairs of points"

    def propose(self, problem: Problem, part: PreparedPart, state: SearchState) -> InitialPoses:
        """Propose from the next pairs of points of this round."""
        objective, effort, pairs = state.objective, state.effort, state.pairs
        count = min(effort.pairs, len(pairs))
        places = effort.places * effort.pairs // max(count, 1)  # few points have few pairs
        found, sources = [np.zeros((0, 4, 4))], [np.zeros(0, dtype=np.int64)]
        for i in range(state.round * count, (state.round + 1) * count):
            pair = np.ascontiguousarray(pairs[[i % len(pairs)]])
            Ts, _ = _core.propose(
                part.shape, objective.core, objective.rows, pair, places, problem.settings.search.spins,
                objective.scales.blur, objective.scales.blur, pair_tilt(problem), effort.kept,
                int(state.rng.integers(2**63)),
            )  # fmt: skip
            found.append(Ts)
            sources.append(np.full(len(Ts), 1 << (i % BITS), dtype=np.int64))
        return InitialPoses(np.concatenate(found), np.concatenate(sources), keep=effort.maximized)


def far_pairs(points: ContactPoints, rows: Indices, count: int) -> Indices:
    """Return pairs of points that are far apart ``(count, 2)``, no point in many of them: one outlier spoils few."""
    p = points.points[rows]
    gaps = np.linalg.norm(p[:, None] - p, axis=-1)
    first, second = np.triu_indices(len(p), 1)
    order = np.argsort(-gaps[first, second], kind="stable")
    used, most, out = np.zeros(len(p), dtype=int), 1 + 2 * count // max(len(p), 1), []
    for k in order:
        i, j = first[k], second[k]
        if used[i] < most and used[j] < most and gaps[i, j] > 0:
            out.append((rows[i], rows[j]))
            used[[i, j]] += 1
        if len(out) == count:
            break
    return np.array(out, dtype=np.int32).reshape(-1, 2)
