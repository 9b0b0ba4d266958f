"""What a report shows of the sensed side: measurements, where their beams came from, whose noise is whose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tanteo.matching import PosePrior
from tanteo.sensors import PointMeasurements, Readings, Rig, RobotPreset, SensorPreset, measure
from tanteo.typing import Covariances, FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Sensed:
    """The readings of a run as the report needs them. World frame, metres.

    Attributes:
        source: Name of the readings' file.
        measured: Points with covariance and shared errors, and the free beams.
        repeatability: The robot's share of ``measured.covs`` ``(n, 3, 3)`` [m^2].
        reach: Length of the beam or path before each point ``(n,)`` [m]; NaN where unknown.
        tolerance: Standard deviation of the made part's surface against its CAD [m].
        prior: What was known of the pose beforehand.
    """

    source: str
    measured: PointMeasurements
    repeatability: Covariances
    reach: FloatArray
    tolerance: float = 0.0
    prior: PosePrior | None = None


def gather(
    readings: Readings,
    *,
    sensor: SensorPreset | str | None = None,
    robot: RobotPreset | str | None = None,
    sd: float | None = None,
    tip_sd: npt.ArrayLike | None = None,
    rig: Rig | None = None,
    tolerance: float = 0.0,
    prior: PosePrior | None = None,
) -> Sensed:
    """Measure the readings as :func:`tanteo.recognition.identify` does, and keep apart what the robot adds.

    Args:
        readings: What the devices said.
        sensor: Preset of readings without an sd of their own.
        robot: Preset of the robot's errors.
        sd: One standard deviation of a point along beam or normal [m], for the same.
        tip_sd: Sds of the tip's offset in the hand's frame [m].
        rig: Where range sensors sit on the hand.
        tolerance: Sd of the made part's surface against its CAD [m].
        prior: What was known of the pose beforehand.

    Raises:
        InputError: Options and readings do not fit each other.
        ReadingsError: A range is outside what its device can give.
    """
    measured = measure(readings, sensor=sensor, robot=robot, sd=sd, tip_sd=tip_sd, rig=rig)
    alone = measured if robot is None else measure(readings, sensor=sensor, sd=sd, tip_sd=tip_sd, rig=rig)
    reach = np.asarray(readings.ranges[measured.rows])
    return Sensed(readings.source, measured, measured.covs - alone.covs, reach, tolerance, prior)
