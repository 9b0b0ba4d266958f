"""Carry out a sensing session with a robot hand: from a rough initial idea of a part to its identity and pose.

The hand must not touch anything. It keeps clear of every pose that the belief still allows, of the bounds of its
workspace and, by its sensors, of obstacles on the way. The package does not import the simulator.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
