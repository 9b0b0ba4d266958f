"""What a report shows of the sensed side: measurements, where their beams came from, whose noise is whose."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.answers import PosePrior
from tanteo.sensors import PointMeasurements, Readings
from tanteo.session import Sensing
from tanteo.typing import Covariances, FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Sensed:
    """The readings of a run as the report needs them. World frame, metres.

    Attributes:
        source: Name of the readings' file.
        measured: Points with covariance and shared errors, and the free-space rays.
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


def gather(readings: Readings, sensing: Sensing | None = None, prior: PosePrior | None = None) -> Sensed:
    """Measure the readings as :func:`tanteo.recognition.identify` does, and keep apart what the robot adds.

    Args:
        readings: What the devices said.
        sensing: How they are made into measurements; what the readings say themselves, if not given.
        prior: What was known of the pose beforehand.

    Raises:
        InputError: Options and readings do not fit each other.
        ReadingsError: A range is outside what its device can give.
    """
    sensing = Sensing() if sensing is None else sensing
    measured = sensing.measured(readings)
    alone = measured if sensing.robot is None else replace(sensing, robot=None).measured(readings)
    reach = np.asarray(readings.ranges[measured.rows])
    return Sensed(readings.source, measured, measured.covs - alone.covs, reach, sensing.tolerance, prior)
