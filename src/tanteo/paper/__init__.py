"""The recognition of the 1991 paper: labelled features, constraints and chi-square tests."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
