"""A hand with proximity sensors: robots, non-contact motions, acquisition of features, a simulator."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
