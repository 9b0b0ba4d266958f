"""Acquire a face, edge, corner, bore or boss from a rough guess, as a feature with covariance (paper, section 3).

The guess may come from an image, a belief or a user; errors of 30 mm and 60 degrees are acceptable. The hand scans from
a distance, selects the surface patch that matches the guess, and senses it with the motions of :mod:`tanteo.motion`.
The readings are recorded, and :func:`features_of` computes identical features from a run and from its file.
"""

from tanteo.acquisition.by_kind import SENSE
from tanteo.acquisition.circle import sense_circle
from tanteo.acquisition.cylinder import sense_cylinder
from tanteo.acquisition.edge import sense_edge
from tanteo.acquisition.guesses import RADIUS_SHARE, EdgeGuess, FaceGuess, RoundGuess, VertexGuess
from tanteo.acquisition.plane import sense_plane
from tanteo.acquisition.predicted import Predicted, predicted
from tanteo.acquisition.record import features_of, plane_as_published
from tanteo.acquisition.rim import least_radius
from tanteo.acquisition.run import Acquired, Outcome
from tanteo.acquisition.vertex import sense_vertex

__all__ = [
    "RADIUS_SHARE", "SENSE", "Acquired", "EdgeGuess", "FaceGuess", "Outcome", "Predicted", "RoundGuess", "VertexGuess",
    "features_of", "least_radius", "plane_as_published", "predicted", "sense_circle", "sense_cylinder", "sense_edge",
    "sense_plane", "sense_vertex",
]  # fmt: skip
