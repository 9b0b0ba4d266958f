"""Initial poses of maximizations: proposers, their registry, and tables that bound the evidence of many parts."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
