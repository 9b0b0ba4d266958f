"""From device to measurement: readings, error models, presets of sensors and robots.

``measure(readings, ...)`` turns what the devices said into points in the world with covariance and shared errors.
This room has never heard of shapes: it knows rays, ranges and covariances.
"""

from tanteo.sensors.checks import KINDS, check_features
from tanteo.sensors.measure import measure
from tanteo.sensors.measurements import FreeBeams, PointMeasurements
from tanteo.sensors.noise import preset_sigma, range_variance, sensed_point, sensor_error_cov
from tanteo.sensors.presets import (
    RobotPreset,
    SensorPreset,
    robot_preset,
    robot_presets,
    sensor_preset,
    sensor_presets,
)
from tanteo.sensors.readings import Readings
from tanteo.sensors.rig import Rig, RigSensor

__all__ = [
    "KINDS",
    "FreeBeams",
    "PointMeasurements",
    "Readings",
    "Rig",
    "RigSensor",
    "RobotPreset",
    "SensorPreset",
    "check_features",
    "measure",
    "preset_sigma",
    "range_variance",
    "robot_preset",
    "robot_presets",
    "sensed_point",
    "sensor_error_cov",
    "sensor_preset",
    "sensor_presets",
]
