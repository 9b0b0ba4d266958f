"""Model the robot hand: range sensors, body, workspace, and the interface that motions need of a robot.

A :class:`Hand` is a rig of range sensors on a body of spheres. A :class:`Robot` carries it, takes one velocity command
per period and returns readings; the simulator and real drivers implement it. The package contains no estimation.
"""

from tanteo.hand.robot import FREE, LOST, MET, NEAR, Body, Hand, HandReading, Robot, gripper_body
from tanteo.hand.twists import about, advance, gap, shift, turn
from tanteo.hand.workspace import ForbiddenBox, Workspace

__all__ = [
    "FREE", "LOST", "MET", "NEAR", "Body", "ForbiddenBox", "Hand", "HandReading", "Robot", "Workspace", "about",
    "advance", "gap", "gripper_body", "shift", "turn",
]  # fmt: skip
