"""Calibration of range sensors: beams, noise and outliers from readings of planes at known poses of the hand.

``calibrate(readings)`` needs nothing but the log; the planes are unknown, too. ``calibrated_rig`` makes a rig of what
was found, and ``plane_angle`` the angle between two of the planes.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
