"""Initial poses that were found before a part was opened: by tables of planes and centres, coarse fields, an image."""

from __future__ import annotations

from typing import final

from tanteo.inference.prepared import PreparedPart
from tanteo.inference.problem import Problem
from tanteo.inference.proposals.proposer import InitialPoses, Proposer, SearchState


@final
class KnownPoses(Proposer):
    """Poses of the earlier stages of the race, in the first round."""

    name = "poses of earlier stages"

    def propose(self, problem: Problem, part: PreparedPart, state: SearchState) -> InitialPoses:
        """Propose the known poses once."""
        if state.round or state.known is None:
            return InitialPoses.none()
        return InitialPoses.exhaustive(state.known) if state.exhaustive else InitialPoses.unproposed(state.known)
