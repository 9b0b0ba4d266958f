"""What is known of the object from all readings so far, and which reading should be next."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from tanteo.active import Probe, Stop, from_hypotheses
from tanteo.answers import Answer, Priors
from tanteo.parts import Part
from tanteo.recognition import identify
from tanteo.sensors import Readings, concatenate
from tanteo.session import Action, Done, Sensing, Session

_NOTHING_YET = Done(False, "No reading has come yet, and nobody says where the part is (--pose-prior).")


class Knowledge(Protocol):
    """What takes readings and has an answer."""

    def tell(self, readings: Readings) -> Answer:
        """Take readings, and say what they make of it."""

    def ask(self) -> Action | Done:
        """The next reading to make, or why there is none."""

    def readings(self) -> Readings | None:
        """All that was told."""

    def reset(self) -> None:
        """Forget all: another object lies there, or the same elsewhere."""


@dataclass(slots=True, eq=False)
class Prior:
    """A session: where the part may be is known beforehand.

    Attributes:
        make: a new one.
    """

    make: Callable[[], Session]
    _session: Session = field(init=False)

    def __post_init__(self) -> None:
        self.reset()

    def tell(self, readings: Readings) -> Answer:
        """Take readings into the session."""
        self._session.tell(readings)
        return self._session.answer()

    def ask(self) -> Action | Done:
        """What the session asks."""
        return self._session.ask()

    def readings(self) -> Readings | None:
        """All that it was told."""
        return self._session.readings

    def reset(self) -> None:
        """A new session."""
        self._session = self.make()


@dataclass(slots=True, eq=False)
class Anywhere:
    """Nothing is known beforehand: all readings are looked at together, each time.

    Attributes:
        parts: that it may be.
        probe: what senses.
        sensing: how readings are made into measurements.
        stop: when nothing more is asked.
        priors: of the unknown object and of outliers.
        seed: of the search.
    """

    parts: Sequence[Part]
    probe: Probe
    sensing: Sensing
    stop: Stop
    priors: Priors | None = None
    seed: int = 0
    _readings: Readings | None = field(init=False, default=None)
    _answer: Answer | None = field(init=False, default=None)

    def tell(self, readings: Readings) -> Answer:
        """Look for the part with all readings."""
        sensing = self.sensing
        joined = readings if self._readings is None else concatenate([self._readings, readings])
        self._answer = identify(
            joined, self.parts, sensor=sensing.sensor, sd=sensing.sd, tolerance=sensing.tolerance,
            robot=sensing.robot, tip_sd=sensing.tip_sd, bias_sd=sensing.bias_sd, rig=sensing.rig, priors=self.priors,
            seed=self.seed, conventions=False,
        )  # fmt: skip
        self._readings = joined
        return self._answer

    def ask(self) -> Action | Done:
        """What would tell most between the hypotheses there are."""
        if self._answer is None or not self._answer.hypotheses:
            return _NOTHING_YET
        start = from_hypotheses(self._answer.hypotheses, self.parts, self.priors)
        return Session(start, self.probe, self.sensing, stop=self.stop, seed=self.seed).ask()

    def readings(self) -> Readings | None:
        """All that was told."""
        return self._readings

    def reset(self) -> None:
        """Forget all."""
        self._readings = self._answer = None
