"""Simulate the true cell: a scene of solids and a robot hand that moves and senses in it with seeded errors.

The package contains no estimation, matching or planning. It outputs what a real robot would report
(:class:`~tanteo.hand.HandReading`); :func:`clearances` gives the true clearance to evaluations and tests.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
