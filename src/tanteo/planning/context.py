"""What a policy decides on, what it decides, and what it is."""

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
"""The shared errors of candidates; None where there are none, or nothing is known of them yet."""


@dataclass(frozen=True, slots=True, eq=False)
class DecisionContext:
    """What a policy decides on.

    Attributes:
        state: what is known.
        candidates: one at least.
        probe: what senses.
        place: where the probe is, world ``(3,)`` [m]; None before the first reading.
        tolerance: of the corners, beyond which nothing more needs to be known [m]; None for none.
        count: readings made so far.
        seed: of policies that draw.
        part_only: nobody asks where the part is, only which one.
        part_open: which part it is was asked for and is not known yet.
        feature: name of one that has to keep the tolerance instead of the corners.
        shared: errors that the readings share, of any candidates; None where only the probe says it.
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
        """From where the probe is to the start of every candidate ``(C,)`` [m]; none before the first reading."""
        if self.place is None:
            return np.zeros(len(self.candidates))
        return np.asarray(np.linalg.norm(self.candidates.origins - self.place, axis=1))

    def seconds(self) -> FloatArray:
        """Time that each candidate takes, travelling included ``(C,)``."""
        return self.probe.seconds + self.travel() / self.probe.speed

    def aims(self) -> Vectors:
        """Where the candidates are expected to meet the surface, world ``(C, 3)`` [m]."""
        return self.candidates.aims


@dataclass(frozen=True, slots=True)
class Choice:
    """One candidate.

    Attributes:
        index: of the candidate.
        gain: what it is expected to tell [nats]; NaN where the policy does not ask.
        reason: why the policy chose it.
        seconds: that this takes; None where the policy does not weigh it.
    """

    index: int
    gain: float
    reason: Finding
    seconds: float | None = None


class Policy(Protocol):
    """A rule that chooses the next reading."""

    @property
    def name(self) -> str:
        """As on the command line."""
        ...

    def choose(self, context: DecisionContext) -> Choice:
        """One of the candidates."""
        ...
