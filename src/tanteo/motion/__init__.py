"""Sensing motions without contact (paper, section 3; Sagues, Montano and Neira 1989; Montano and Sagues 1991).

Each motion is a function of a :class:`~tanteo.hand.Robot` that returns a :class:`Motion`: a status, a message and the
log of all readings. Before every command, :class:`Steering` scales the velocity down so that nothing that a sensor
measures comes nearer than the clearance, and no part of the hand leaves its workspace. The package contains no
estimation.
"""

from tanteo.motion.control import Loop
from tanteo.motion.crossing import Crossing, EdgeEvent, cross_edge
from tanteo.motion.following import approach, follow, retreat, settle, settled
from tanteo.motion.steering import Ending, Motion, Rules, Steering
from tanteo.motion.track import Crease, crease_angle
from tanteo.motion.travelling import dwell, go_to, look, looked, path

__all__ = [
    "Crease", "Crossing", "EdgeEvent", "Ending", "Loop", "Motion", "Rules", "Steering", "approach", "crease_angle",
    "cross_edge", "dwell", "follow", "go_to", "look", "looked", "path", "retreat", "settle", "settled",
]  # fmt: skip
