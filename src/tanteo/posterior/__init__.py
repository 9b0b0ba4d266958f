"""Posterior over parts, poses and the unknown object: proposals, maximization, sampling and answers."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
