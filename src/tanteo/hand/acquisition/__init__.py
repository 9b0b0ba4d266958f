"""Acquire a face, edge, corner, bore or boss from a rough guess, as a feature with covariance (paper, section 3).

The guess may come from an image, a belief or a user; errors of 30 mm and 60 degrees are acceptable. The hand scans
from a distance, selects the surface patch that matches the guess, and senses it with the motions of
:mod:`tanteo.hand.motion`. The readings are recorded, and :func:`features_of` computes identical features from a run
and from its file.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
