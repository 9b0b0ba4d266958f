"""Drivers of CNC machines and robots behind one safe interface, and probing programs."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
