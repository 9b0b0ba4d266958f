"""Faces of a part: planes, cylinders, cones, spheres and tori, found in exact geometry or in a mesh."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
