"""Initial poses from sensed planes and normals: they are put on all faces of the part that fit them."""

from __future__ import annotations

from typing import final

import numpy as np

from tanteo.inference.prepared import PreparedPart
from tanteo.inference.problem import Problem
from tanteo.inference.proposals.plane_votes import plane_poses
from tanteo.inference.proposals.proposer import InitialPoses, Proposer, SearchState
from tanteo.inference.scales import scores_of


@final
class PlanePoses(Proposer):
    """Labelled planes and sensed normals on faces, once, for these are all poses that they allow."""

    name = "sensed planes on faces"

    def propose(self, problem: Problem, part: PreparedPart, state: SearchState) -> InitialPoses:
        """Propose the poses nearest to all points, unless earlier stages proposed all that planes allow."""
        objective, count = state.objective, state.effort.maximized
        if state.round or (state.known is not None and state.exhaustive) or not len(objective.rows):
            return InitialPoses.none()
        Ts = np.ascontiguousarray(plane_poses(state.planes, part, problem.settings))
        if len(Ts) > count:
            costs = scores_of(problem, objective.core, part, objective.rows, Ts, objective.scales)
            Ts = Ts[np.argsort(costs, kind="stable")[:count]]
        return InitialPoses.exhaustive(Ts)
