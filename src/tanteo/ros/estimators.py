"""Estimators of the ROS node: the answer from all readings so far, and the next reading."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from tanteo.parts import Part
from tanteo.planning import Action, Done, Probe, Sensing, Session, Stop
from tanteo.planning.start import from_hypotheses
from tanteo.posterior import Answer, Priors
from tanteo.recognition import identify
from tanteo.sensors import Readings, concatenate
from tanteo.words.findings import NoPriorPose


class Estimator(Protocol):
    """Interface of an estimator, with the ask-and-tell methods of sequential optimizers."""

    def tell(self, readings: Readings) -> Answer:
        """Add readings and return the updated answer."""

    def ask(self) -> Action | Done:
        """Return the next reading to make, or the reason why there is none."""

    def readings(self) -> Readings | None:
        """Return all readings so far, or None."""

    def reset(self) -> None:
        """Discard all readings, for another object or another pose."""


@dataclass(slots=True, eq=False)
class SessionEstimator:
    """Estimator with prior poses, which updates a session.

    Attributes:
        make: function that creates a new session.
    """

    make: Callable[[], Session]
    _session: Session = field(init=False)

    def __post_init__(self) -> None:
        self.reset()

    def tell(self, readings: Readings) -> Answer:
        """Add readings to the session and return the updated answer."""
        self._session.tell(readings)
        return self._session.answer()

    def ask(self) -> Action | Done:
        """Return the next action of the session."""
        return self._session.ask()

    def readings(self) -> Readings | None:
        """Return all readings of the session, or None."""
        return self._session.readings

    def reset(self) -> None:
        """Start a new session."""
        self._session = self.make()


@dataclass(slots=True, eq=False)
class JointEstimator:
    """Estimator without prior poses, which recognizes the part from all readings together.

    Attributes:
        parts: candidate parts.
        probe: sensor model for planning.
        sensing: noise model of the readings.
        stop: goal that limits the choice of the next reading.
        priors: priors of the unknown object and of outliers; None for the defaults.
        seed: seed of the search.
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
        """Identify the part from all readings, the new ones included."""
        sensing = self.sensing
        joined = readings if self._readings is None else concatenate([self._readings, readings])
        self._answer = identify(
            joined, self.parts, sensor=sensing.sensor, sd=sensing.sd, tolerance=sensing.tolerance,
            robot=sensing.robot, tip_sd=sensing.tip_sd, bias_sd=sensing.bias_sd,
            shared_errors=sensing.shared_errors, rig=sensing.rig, priors=self.priors,
            seed=self.seed, conventions=False,
        )  # fmt: skip
        self._readings = joined
        return self._answer

    def ask(self) -> Action | Done:
        """Return the reading with the most information about the current hypotheses, or the reason for none."""
        if self._answer is None or not self._answer.hypotheses:
            return Done(False, (NoPriorPose(),))
        start = from_hypotheses(self._answer.hypotheses, self.parts, self.priors)
        return Session(start, self.probe, self.sensing, stop=self.stop, seed=self.seed).ask()

    def readings(self) -> Readings | None:
        """Return all readings so far, or None."""
        return self._readings

    def reset(self) -> None:
        """Discard all readings."""
        self._readings = self._answer = None
