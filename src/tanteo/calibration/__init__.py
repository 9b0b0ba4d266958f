"""Calibration of range sensors: beams, noise and outliers from readings of planes at known poses of the hand.

``calibrate(readings)`` needs nothing but the log; the planes are unknown, too. ``calibrated_rig`` makes a rig of what
was found, and ``plane_angle`` the angle between two of the planes.
"""

from tanteo.calibration.calibrate import calibrate
from tanteo.calibration.result import BeamFit, Calibration, Outlier, PlaneFit, plane_angle
from tanteo.calibration.rig import calibrated_rig

__all__ = ["BeamFit", "Calibration", "Outlier", "PlaneFit", "calibrate", "calibrated_rig", "plane_angle"]
