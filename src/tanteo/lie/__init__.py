"""Compute with rotations and rigid motions as arrays: modules ``SO3`` and ``SE3``, and ``maximize`` for fits on them.

Rotations are ``(*batch, 3, 3)`` and rigid motions ``(*batch, 4, 4)`` arrays. Composition is ``@``, and adjacent frame
names cancel: ``T_world_part = T_world_hand @ T_hand_sensor @ T_sensor_part``. Tangents are ``[v, w]``, translation
first, and perturb on the right: ``T = T_mean @ SE3.exp(xi)``.
"""

from tanteo.lie import se3 as SE3
from tanteo.lie import so3 as SO3
from tanteo.lie.maximize import maximize

__all__ = ["SE3", "SO3", "maximize"]
