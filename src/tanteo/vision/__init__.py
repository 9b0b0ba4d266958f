"""Images: a camera's model, edges and outlines as factors, and the objects that an image shows."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
