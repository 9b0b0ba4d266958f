"""Sensing motions without contact (paper, section 3; Sagues, Montano and Neira 1989; Montano and Sagues 1991).

Each motion is a function of a :class:`~tanteo.hand.Robot` that returns a :class:`Motion`: a status, a message and the
log of all readings. Before every command, :class:`Steering` scales the velocity down so that nothing that a sensor
measures comes nearer than the clearance, and no part of the hand leaves its workspace. The package contains no
estimation.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
