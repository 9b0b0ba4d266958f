"""CAD parts: reading files, faces and other features of the geometry, distances to the surface."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
