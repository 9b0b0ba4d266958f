"""Readers of CAD files: STEP, STL, OBJ, PLY, 3MF and others, and repair of meshes."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
