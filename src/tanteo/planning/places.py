"""Points of a part to which a tolerance applies: the corners of its box, or one feature by name.

A feature counts in the directions in which its displacement is visible: a face along its normal, an edge across its
direction, and a vertex in all directions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry.typing import Covariances, FloatArray, Vectors
from tanteo.parts import NamedFace, Part, named_class, named_feature
from tanteo.posterior import box_corners
from tanteo.posterior.answers import point_moves


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Points of a part to which a tolerance applies, with the directions in which it applies.

    Attributes:
        name: name of the points for messages, ``all corners of bracket`` or ``edge 4 of bracket``.
        feature: name of the feature; None for the corners of the box.
        points: points, part frame ``(K, 3)`` [m].
        across: projectors on the directions in which the tolerance applies, part frame ``(K, 3, 3)``.
    """

    name: str
    feature: str | None
    points: Vectors
    across: FloatArray

    @property
    def moves(self) -> FloatArray:
        """Jacobian of the points over the pose, in the directions of the tolerance, part frame ``(K, 3, 6)``."""
        return np.asarray(self.across @ point_moves(self.points))

    def sd(self, covariance: Covariances) -> float:
        """Return the largest standard deviation of a point in a direction of the tolerance [m].

        Args:
            covariance: covariance of the pose, part frame ``(6, 6)`` [m, rad].
        """
        J = self.moves
        return float(np.sqrt(np.linalg.eigvalsh(J @ covariance @ np.swapaxes(J, 1, 2)).max().clip(0.0)))


def places_of(part: Part, feature: str | None = None) -> Places:
    """Return the points of a named feature, or the corners of the part's box.

    Args:
        part: the part.
        feature: ``face 3``, ``edge 4`` or ``vertex 2``, numbered as by ``tanteo part show``. If it is None, or the
            part has no such feature, the result has the corners.
    """
    found = None if feature is None else named_feature(part, feature)
    if found is None:
        corners = box_corners(part)
        return Places(f"all corners of {part.name}", None, corners, np.broadcast_to(np.eye(3), (len(corners), 3, 3)))
    return Places(f"{feature} of {part.name}", feature, *found.places)


def check_feature(feature: str, parts: Sequence[Part] = ()) -> None:
    """Check that a name is valid for a feature, and that one of the parts has this feature.

    Args:
        feature: name of the feature.
        parts: parts to check; empty to check the name only.

    Raises:
        InputError: the name is invalid, or no part has the feature; the message lists the features.
    """
    cls = named_class(feature)
    if cls is None:
        raise InputError(
            f"feature: expected 'face 3', 'edge 4' or 'vertex 2', got '{feature}'. `tanteo part show` lists them."
        )
    if parts and all(named_feature(part, feature) is None for part in parts):
        counts = ", ".join(f"{part.name}: {_range(cls, part)}" for part in parts[:3])
        raise InputError(f"feature: expected one of a part, got '{feature}'. Available: {counts}.")


def _range(cls: type[NamedFace], part: Part) -> str:
    n = cls.count(part)
    return f"{cls.kind} 0 to {n - 1}" if n else f"no {cls.kind}"
