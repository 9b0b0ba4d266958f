"""Initial poses from other parts: twins and variants share their frames (decision 52)."""

from __future__ import annotations

from typing import final

from tanteo.inference.prepared import PreparedPart
from tanteo.inference.problem import Problem
from tanteo.inference.proposals.proposer import InitialPoses, Proposer, SearchState


@final
class PosesOfOtherParts(Proposer):
    """The best poses of the leading other parts."""

    name = "poses of other parts"

    def propose(self, problem: Problem, part: PreparedPart, state: SearchState) -> InitialPoses:
        """Propose the poses that the race passes on."""
        return InitialPoses.unproposed(state.others)
