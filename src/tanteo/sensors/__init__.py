"""Convert device readings to measurements: readings, error models, presets of sensors and robots.

``measure(readings, ...)`` converts readings to points in the world with covariance and shared errors. For simulators,
``emit`` (with ``error_model``, ``draw_units``, ``draw_aims``) generates readings of true ranges with errors drawn from
the model that ``measure`` assumes. This package uses rays, ranges and covariances, and no part geometry.
"""

from tanteo.sensors.anomalies import find_repeated, find_stuck
from tanteo.sensors.checks import check_features
from tanteo.sensors.devices import Device, misspelt
from tanteo.sensors.emission import (
    Status,
    UnitErrors,
    draw_base,
    draw_touch_bias,
    draw_units,
    emit,
    emit_touches,
    reported_poses,
)
from tanteo.sensors.figures import ErrorModel, error_model
from tanteo.sensors.measure import measure, unstated_sd
from tanteo.sensors.measurements import FreeBeams, PointMeasurements
from tanteo.sensors.noise import (
    blend,
    cone_rays,
    draw_aims,
    edge_bias,
    edge_shift,
    edge_variance,
    range_variance,
    sensed_point,
    sensor_error_cov,
)
from tanteo.sensors.presets import (
    NoiseLaw,
    RobotPreset,
    SensorPreset,
    robot_preset,
    robot_presets,
    sensor_preset,
    sensor_presets,
)
from tanteo.sensors.reading_kinds import SIZES, ReadingKind, centre_notes, reading_kind, reading_kinds
from tanteo.sensors.readings import Readings, check_readings_kind, concatenate, thinned
from tanteo.sensors.rig import Rig, RigSensor

__all__ = [
    "SIZES",
    "Device",
    "ErrorModel",
    "FreeBeams",
    "NoiseLaw",
    "PointMeasurements",
    "ReadingKind",
    "Readings",
    "Rig",
    "RigSensor",
    "RobotPreset",
    "SensorPreset",
    "Status",
    "UnitErrors",
    "blend",
    "centre_notes",
    "check_features",
    "check_readings_kind",
    "concatenate",
    "cone_rays",
    "draw_aims",
    "draw_base",
    "draw_touch_bias",
    "draw_units",
    "edge_bias",
    "edge_shift",
    "edge_variance",
    "emit",
    "emit_touches",
    "error_model",
    "find_repeated",
    "find_stuck",
    "measure",
    "misspelt",
    "range_variance",
    "reading_kind",
    "reading_kinds",
    "reported_poses",
    "robot_preset",
    "robot_presets",
    "sensed_point",
    "sensor_error_cov",
    "sensor_preset",
    "sensor_presets",
    "thinned",
    "unstated_sd",
]  # fmt: skip
