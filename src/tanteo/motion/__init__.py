"""Motions that sense without touching (paper, section 3; Sagues, Montano and Neira 1989; Montano and Sagues 1991).

Each is a function over a :class:`~tanteo.hand.Robot` that ends in a :class:`Motion`: a status, a sentence and the log
of all that was sensed. Before every command :class:`Steering` slows it so that no sensor comes nearer to what it sees
than the clearance, and no part of the hand to the bounds of its workspace. This room knows no estimator.
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
