"""Initial poses from factors of the pose: the edges of an image, a function of a user."""

from __future__ import annotations

from typing import final

import numpy as np

from tanteo.inference.prepared import PreparedPart
from tanteo.inference.problem import Problem
from tanteo.inference.proposals.proposer import InitialPoses, Proposer, SearchState


@final
class FactorPoses(Proposer):
    """Poses that factors of the pose suggest, once and without blur, for they are near a maximum."""

    name = "poses of factors"

    def propose(self, problem: Problem, part: PreparedPart, state: SearchState) -> InitialPoses:
        """Propose the poses of all factors of the pose in the first round."""
        if state.round or not problem.pose_factors:
            return InitialPoses.none()
        return InitialPoses.exhaustive(np.concatenate([factor.poses(part.part) for factor in problem.pose_factors]))
