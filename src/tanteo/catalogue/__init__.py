"""Many parts: reading folders with a cache, catalogues on disk, and processes that share the work."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
