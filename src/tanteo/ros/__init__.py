"""ROS 2 node that identifies and locates a part from messages."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
