"""Carry out a sensing session with a robot hand: from a rough initial idea of a part to its identity and pose.

The hand must not touch anything. It keeps clear of every pose that the belief still allows, of the bounds of its
workspace and, by its sensors, of obstacles on the way. The package does not import the simulator.
"""

from tanteo.execution.approach import approach_poses
from tanteo.execution.loop import Executed, Visit, reachable, sense_part
from tanteo.execution.possible import Possible, Room
from tanteo.execution.resting import Furniture
from tanteo.execution.start import HYPOTHESES, hand_probe, part_seen, prior_poses, seen_start
from tanteo.execution.whole import acquirable

__all__ = [
    "HYPOTHESES", "Executed", "Furniture", "Possible", "Room", "Visit", "acquirable", "approach_poses",
    "hand_probe", "part_seen", "prior_poses", "reachable", "seen_start", "sense_part",
]  # fmt: skip
