"""Motions that sense without touching (paper, section 3; Sagues, Montano and Neira 1989; Montano and Sagues 1991).

Each is a function over a :class:`~tanteo.hand.Robot` that ends in a :class:`Motion`: a status, a sentence and the log
of all that was sensed. Before every command :class:`Steering` slows it so that no sensor comes nearer to what it sees
than the clearance, and no part of the hand to the bounds of its workspace. This room knows no estimator.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.motion.approaching import approach, retreat
    from tanteo.motion.bending import Bend, how_far
    from tanteo.motion.control import Loop
    from tanteo.motion.crossing import Crossing, EdgeEvent, cross_edge
    from tanteo.motion.following import follow, settle, settled
    from tanteo.motion.looking import look, looked
    from tanteo.motion.result import Ending, Motion
    from tanteo.motion.steering import Rules, Steering
    from tanteo.motion.travelling import go_to

__all__ = [
    "Bend",
    "Crossing",
    "EdgeEvent",
    "Ending",
    "Loop",
    "Motion",
    "Rules",
    "Steering",
    "approach",
    "cross_edge",
    "follow",
    "go_to",
    "how_far",
    "look",
    "looked",
    "retreat",
    "settle",
    "settled",
]

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {
        "approaching": "approach retreat",
        "bending": "Bend how_far",
        "control": "Loop",
        "crossing": "Crossing EdgeEvent cross_edge",
        "following": "follow settle settled",
        "looking": "look looked",
        "result": "Ending Motion",
        "steering": "Rules Steering",
        "travelling": "go_to",
    },
)
