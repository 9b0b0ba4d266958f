"""From a rough idea of a face, edge, corner, bore or boss to the sensed feature with covariance (paper, section 3).

An idea may come from an image, from a belief or from a person; thirty millimetres and sixty degrees are near enough.
The hand looks around from a distance, takes the patch that fits the idea, and senses it with the motions of
:mod:`tanteo.motion`. What it read is the record: :func:`features_of` makes the same features of it again, to the last
bit, whether it comes from the run or from a file.
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
