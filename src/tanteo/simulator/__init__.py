"""The truth: a scene of solids, and a hand that moves and senses in it with seeded errors.

Nothing here knows an estimator, a matcher or a policy; what leaves this room is what a real robot would say
(:class:`~tanteo.hand.HandReading`), and :func:`clearances` for a judge.
"""

from tanteo.simulator.scene import Scene, Solid, box, clearances
from tanteo.simulator.simulated import Cell, SimulatedHand

__all__ = ["Cell", "Scene", "SimulatedHand", "Solid", "box", "clearances"]
