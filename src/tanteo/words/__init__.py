"""Typed findings of an answer, and the one place that puts them into sentences."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
