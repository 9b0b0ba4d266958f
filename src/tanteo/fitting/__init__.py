"""Fits of features to points, and of the pose of a part to paired features."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
