"""Values that a session exchanges with its user: noise model, end, steps and observations."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from tanteo.factors import ContactPoints, FreeRays, as_contact_points, as_free_rays
from tanteo.geometry.limits import LEAST_SD, check_length
from tanteo.geometry.typing import Covariances, FloatArray, Transforms
from tanteo.planning.probe import Probe
from tanteo.planning.session.action import Action
from tanteo.planning.state import SensingState
from tanteo.sensors import PointMeasurements, Readings, Rig, measure
from tanteo.sensors.error_states import MOUNTED, ErrorState, UnstatedError, made_surface
from tanteo.sensors.presets import RobotPreset, SensorPreset
from tanteo.values import Value, lock
from tanteo.words import Finding, message_of


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Sensing(Value):
    """Noise model by which a session converts readings into measurements, see :func:`tanteo.sensors.measure`.

    Attributes:
        sensor: sensor preset, or its name, for readings that state no standard deviation.
        robot: preset of the robot's errors, or its name; None for exact poses.
        sd: standard deviation along the beam or normal of readings that state none [m]. The standard deviation across a
            beam follows from its width; across a touch it has the same value.
        tip_sd: standard deviations of the error of the tip's offset, in the hand's frame ``(3,)`` [m].
        rig: mounting of the range sensors on the hand.
        tolerance: standard deviation of the real surface from the CAD surface [m], mostly common to a face; see
            :func:`tanteo.sensors.error_states.made_surface`.
        bias_sd: standard deviation of an offset along the approach [m], one across and one along z of the world, such
            as of the trigger point or the ball's radius.
        shared_errors: further errors that readings share; see :mod:`tanteo.sensors.error_states`.

    Example:
        >>> tanteo.Sensing(sd=3e-4).sd  # the readings' own noise, 0.3 mm
        0.0003
    """

    sensor: SensorPreset | str | None = None
    robot: RobotPreset | str | None = None
    sd: float | None = None
    tip_sd: npt.ArrayLike | None = None
    rig: Rig | None = None
    tolerance: float = 0.0
    bias_sd: float | None = None
    shared_errors: tuple[ErrorState, ...] = ()

    def __post_init__(self) -> None:
        check_length("tolerance", self.tolerance)
        if self.sd is not None:
            check_length("sd", self.sd, LEAST_SD)
        if self.bias_sd is not None:
            check_length("bias_sd", self.bias_sd, LEAST_SD)
        lock(self)

    def measured(
        self, readings: Readings, beam_half_angle: float = np.nan, state: SensingState | None = None
    ) -> PointMeasurements:
        """Convert readings into points in the world frame with covariances, and free-space rays.

        Args:
            readings: readings of the devices.
            beam_half_angle: half angle of beams whose sensor preset states none [rad]; NaN for touches.
            state: posterior whose most probable pose assigns the readings to the faces of a made part, see
                :class:`tanteo.sensors.error_states.FaceOffset`; None to assume no pose.
        """

        def at(faces: tuple[int, ...]) -> PointMeasurements:
            errors = *self.shared_errors, *made_surface(self.tolerance, faces)[0]
            return measure(
                readings, sensor=self.sensor, robot=self.robot, sd=self.sd, tip_sd=self.tip_sd, bias_sd=self.bias_sd,
                shared_errors=errors, rig=self.rig, beam_half_angle=beam_half_angle, angle_sd=MOUNTED,
            )  # fmt: skip

        measured = at(())
        if state is None or not len(state.weights) or self.tolerance == 0 or not len(measured):
            return measured
        k = int(np.argmax(state.weights))
        return at(state.target(k).faces_of_readings(measured, len(readings), state.poses[k]))

    def touches(
        self, readings: Readings, probe: Probe | None = None, state: SensingState | None = None
    ) -> tuple[ContactPoints, FreeRays, tuple[UnstatedError, ...]]:
        """Convert readings into the contact points and free-space rays of the posterior, with their unstated errors.

        Beams have the width of the probe's cone. Free-space rays do not exclude surfaces at a larger incidence than the
        probe detects.

        Args:
            readings: readings of the devices.
            probe: sensor model for planning, for readings without a sensor; None for touches.
            state: posterior whose most probable pose assigns the readings to the faces of a made part.
        """
        beam = None if probe is None or probe.contact else probe
        measured = self.measured(readings, np.nan if beam is None else beam.beam_half_angle, state)
        own_sd = made_surface(self.tolerance)[1]
        touches = as_contact_points(measured, own_sd, readings.ranges.take(measured.rows)).with_places()
        free = as_free_rays(measured, own_sd)
        return touches, free if beam is None else free.up_to(beam.max_incidence), measured.unstated


@dataclass(frozen=True, slots=True)
class Done:
    """End of a session: there is no next reading.

    Attributes:
        reached: whether the goal is reached; otherwise no reading is possible or worth its cost.
        findings: reasons for the end, the verdict first.

    Example:
        >>> from tanteo.words import findings
        >>> tanteo.planning.Done(False, (findings.ReadingLimit(allowed=30, made=30),)).message
        'The limit of readings is reached: 30 were allowed, and 30 were made.'
    """

    reached: bool
    findings: tuple[Finding, ...]

    @property
    def message(self) -> str:
        """Text of the findings."""
        return message_of(self.findings)

    def adding(self, *findings: Finding | None) -> Done:
        """Return the same end with further findings.

        Args:
            findings: findings to append; None is skipped.
        """
        return replace(self, findings=(*self.findings, *(one for one in findings if one is not None)))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Step(Value):
    """Summary of the posterior after one observation.

    Attributes:
        ids: names of the new readings.
        action: action that requested the readings; None if no action did.
        probabilities: posterior probability of every part ``(P,)``.
        unknown: posterior probability of the unknown object.
        T_world_part: most probable pose ``(4, 4)``.
        part: index of the most probable pose's part; -1 if no part explains the readings.
        covariance: covariance of that pose, part frame, right perturbation ``(6, 6)`` [m, rad].
        corner_sd: largest standard deviation of a corner of that part's box, over all its possible poses [m].
        within: probability that all corners, or the feature, are within the goal's tolerance; NaN without a tolerance.
        findings: remarks on the readings for the user.
    """

    ids: tuple[str, ...]
    action: Action | None
    probabilities: FloatArray
    unknown: float
    T_world_part: Transforms
    part: int
    covariance: Covariances
    corner_sd: float
    within: float
    findings: tuple[Finding, ...] = ()

    @property
    def note(self) -> str:
        """Text of the remarks; empty without any."""
        return message_of(self.findings)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Observation(Value):
    """Readings that a session received together, as a record stores them.

    Attributes:
        action: action that requested the readings; None if no action did.
        readings: new readings; None if the session had all of them already.
        findings: remarks on the readings for the user.
    """

    action: Action | None
    readings: Readings | None
    findings: tuple[Finding, ...] = ()
