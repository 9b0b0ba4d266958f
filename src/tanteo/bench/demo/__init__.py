"""Provide ``tanteo demo``: an image leaves two parts possible, a beam discriminates them, others locate the part."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
