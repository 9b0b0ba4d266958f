"""The hand and the few things that a motion needs of a robot: pose, readings, velocity.

A :class:`Hand` is a rig of range sensors on a body of spheres; a :class:`Robot` carries it and takes one velocity
command a period. The simulator implements :class:`Robot`, and so can a driver. This room knows no estimator.
"""

from tanteo.hand.robot import FREE, LOST, MET, NEAR, Body, Hand, HandReading, Robot, gripper_body
from tanteo.hand.twists import about, advance, gap, shift, turn
from tanteo.hand.workspace import ForbiddenBox, Workspace

__all__ = [
    "FREE", "LOST", "MET", "NEAR", "Body", "ForbiddenBox", "Hand", "HandReading", "Robot", "Workspace", "about",
    "advance", "gap", "gripper_body", "shift", "turn",
]  # fmt: skip
