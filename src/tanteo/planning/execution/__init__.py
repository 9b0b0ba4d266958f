"""Execution of a sensing session with a robot hand, from a rough prior to the identity and pose of a part.

The hand must not touch anything. It keeps its clearance from every possible pose of the parts, from the bounds of its
workspace and, by its sensors, from obstacles on the path. The package does not import the simulator.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
