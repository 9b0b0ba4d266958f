"""Interface of policies, which choose the next reading: input, choice and protocol."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np

from tanteo.geometry.typing import FloatArray, Vectors
from tanteo.planning.candidates import Candidates
from tanteo.planning.probe import Probe
from tanteo.planning.shared import SharedAhead
from tanteo.planning.state import SensingState
from tanteo.words import Finding

SharedOf: TypeAlias = Callable[[Candidates], SharedAhead | None]
"""Function that returns the shared errors of candidates, or None if they have none."""


@dataclass(frozen=True, slots=True, eq=False)
class DecisionContext:
    """Input of a policy.

    Attributes:
        state: posterior of the session.
        candidates: candidate readings, at least one.
        probe: sensor model.
        place: position of the probe, world frame ``(3,)`` [m]; None before the first reading.
        tolerance: tolerance of the goal [m], beyond which more accuracy has no value; None without one.
        count: number of readings so far.
        seed: seed of policies with random choices.
        part_only: whether the goal demands the identity of the part but not its pose.
        part_open: whether the goal demands the identity of the part, which is not certain enough yet.
        feature: feature to which the tolerance applies; None for the corners of the part's box.
        shared: function that returns the shared errors of candidates; None if only the probe models them.
    """

    state: SensingState
    candidates: Candidates
    probe: Probe
    place: Vectors | None
    tolerance: float | None
    count: int
    seed: int
    part_only: bool = False
    part_open: bool = False
    feature: str | None = None
    shared: SharedOf | None = None

    def travel(self) -> FloatArray:
        """Return the distance from the probe to every candidate's start ``(C,)`` [m]; 0 before the first reading."""
        if self.place is None:
            return np.zeros(len(self.candidates))
        return np.asarray(np.linalg.norm(self.candidates.origins - self.place, axis=1))

    def seconds(self) -> FloatArray:
        """Return the duration of every candidate including travel ``(C,)`` [s]."""
        return self.probe.seconds + self.travel() / self.probe.speed

    def aims(self) -> Vectors:
        """Return the points at which the candidates should hit the surface, world frame ``(C, 3)`` [m]."""
        return self.candidates.aims


@dataclass(frozen=True, slots=True)
class Choice:
    """Choice of a policy.

    Attributes:
        index: index of the chosen candidate.
        gain: expected information [nats]; NaN if the policy does not compute it.
        reason: reason of the choice, for the user.
        seconds: duration of the reading [s]; None if the policy does not consider durations.
    """

    index: int
    gain: float
    reason: Finding
    seconds: float | None = None


class Policy(Protocol):
    """Rule that chooses the next reading."""

    @property
    def name(self) -> str:
        """Name of the policy on the command line."""
        ...

    def choose(self, context: DecisionContext) -> Choice:
        """Return the chosen candidate.

        Args:
            context: posterior, candidates and goal.
        """
        ...
