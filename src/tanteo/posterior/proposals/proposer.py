"""Protocol of proposers of initial poses: their input and their result."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry.typing import BoolArray, Indices, IntArray, Transforms
from tanteo.posterior.prepared import PreparedPart
from tanteo.posterior.problem import Problem
from tanteo.posterior.proposals.sensed_planes import SensedPlanes
from tanteo.posterior.sampling.peaks import Objective, Peaks
from tanteo.posterior.settings import Effort

BITS = 60
"""Numerical: number of independent sources that are counted separately, as bits of a 64-bit number. A maximum that four
of them found counts as surely found, so that more bits change no count that matters."""

EARLIER = 1 << BITS
"""Source of the poses that earlier stages found on coarse fields or an image, independent of those of the search."""

EXHAUSTIVE = (1 << BITS) - 1
"""Sources of exhaustive poses: every bit, so that their maxima count as surely found."""


@dataclass(frozen=True, slots=True, eq=False)
class InitialPoses:
    """Poses at which maximizations start.

    Attributes:
        Ts: poses ``T_world_part`` ``(S, 4, 4)``.
        sources: one bit for each independent source that led to a pose, 0 for a pose that no measurement proposed
            ``(S,)``. A maximum to which few sources led shows that others may be missing (Good 1953).
        refined: which poses are within the noise of a maximum; these are maximized without refinement and blur
            ``(S,)``.
        keep: number of the other poses that are maximized after refinement; None for all.
    """

    Ts: Transforms
    sources: IntArray
    refined: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    keep: int | None = None

    def __post_init__(self) -> None:
        n = len(self.Ts)
        if not len(self.refined):
            object.__setattr__(self, "refined", np.zeros(n, dtype=bool))
        for name, shape in (("Ts", (n, 4, 4)), ("sources", (n,)), ("refined", (n,))):
            if np.shape(getattr(self, name)) != shape:
                raise InputError(f"{name}: expected an array {shape}, got {np.shape(getattr(self, name))}.")
        if not np.isfinite(self.Ts).all():
            raise InputError("Ts: expected finite poses, got nan or inf.")

    def __len__(self) -> int:
        return len(self.Ts)

    @classmethod
    def none(cls) -> InitialPoses:
        """Return no poses."""
        return cls(np.zeros((0, 4, 4)), np.zeros(0, dtype=np.int64))

    @classmethod
    def unproposed(cls, Ts: Transforms) -> InitialPoses:
        """Return poses that no measurement proposed; a maximum that they lead to does not count as found."""
        return cls(Ts, np.zeros(len(Ts), dtype=np.int64))

    @classmethod
    def exhaustive(cls, Ts: Transforms) -> InitialPoses:
        """Return refined poses that are all poses which the measurements allow."""
        return cls.refined_poses(Ts, np.full(len(Ts), EXHAUSTIVE, dtype=np.int64))

    @classmethod
    def refined_poses(cls, Ts: Transforms, sources: IntArray) -> InitialPoses:
        """Return poses that are within the noise of a maximum, with the sources that led to each."""
        return cls(Ts, sources, np.ones(len(Ts), dtype=bool))

    @classmethod
    def joined(cls, each: Sequence[InitialPoses]) -> InitialPoses:
        """Return the poses of several sets as one; ``keep`` is that of the first set."""
        Ts, sources, refined = ([getattr(one, name) for one in each] for name in ("Ts", "sources", "refined"))
        return cls(np.concatenate(Ts), np.concatenate(sources), np.concatenate(refined), each[0].keep)


@dataclass(frozen=True, slots=True, eq=False)
class SearchState:
    """State of the search for one part, which proposers read.

    Attributes:
        objective: the part and the compiled problem, length scales, and points by which poses are refined.
        effort: numbers of poses that the proposers make in this round.
        round: number of the round, from 0.
        rng: generator of all draws.
        pairs: pairs of points that are far apart ``(K, 2)``.
        planes: planes from labels and sensed normals.
        known: poses that earlier stages of candidate pruning or an image found; None if there are none.
        exhaustive: whether the known poses are all poses that the measurements allow.
        best: maxima so far, best first.
        is_doubtful: function that returns whether the best maximum has more outliers than expected.
    """

    objective: Objective
    effort: Effort
    round: int
    rng: np.random.Generator
    pairs: Indices
    planes: SensedPlanes
    known: Transforms | None
    exhaustive: bool
    best: Peaks
    is_doubtful: Callable[[], bool]


class Proposer(ABC):
    """Proposer of initial poses of one part.

    Another distribution provides one by the entry point group ``tanteo.proposals``. Several threads may call it at a
    time, each for another part.

    Attributes:
        name: name in the registry and of the entry point.
    """

    name: str

    @abstractmethod
    def propose(self, problem: Problem, part: PreparedPart, state: SearchState) -> InitialPoses:
        """Propose poses for this round; none if the measurements suggest none.

        Args:
            problem: measurements and priors.
            part: the part.
            state: the search so far.
        """
