"""What has to be where it is said to be: all corners of a part's box, or one feature of it by name.

A feature counts in the directions that are its own: a face along its normal, an edge across itself, a vertex in all
directions. Where it slides on itself nothing is seen of it, and nothing is lost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry.typing import Covariances, FloatArray, Vectors
from tanteo.parts import NamedFace, Part, named_class, named_feature
from tanteo.posterior import box_corners, point_moves


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Points of a part, each with the directions in which it counts.

    Attributes:
        name: in words, ``all corners of bracket`` or ``edge 4 of bracket``.
        feature: name of the feature; None for the corners of the box.
        points: in the part frame ``(K, 3)`` [m].
        across: projectors on the directions that count ``(K, 3, 3)``, part frame.
    """

    name: str
    feature: str | None
    points: Vectors
    across: FloatArray

    @property
    def moves(self) -> FloatArray:
        """How the points move with the part's pose, in the directions that count ``(K, 3, 6)``, part frame."""
        return np.asarray(self.across @ point_moves(self.points))

    def sd(self, covariance: Covariances) -> float:
        """Largest standard deviation of a point, in any direction that counts, for one of the pose ``(6, 6)`` [m]."""
        J = self.moves
        return float(np.sqrt(np.linalg.eigvalsh(J @ covariance @ np.swapaxes(J, 1, 2)).max().clip(0.0)))


def places_of(part: Part, feature: str | None = None) -> Places:
    """The places of a feature, or the corners of the part's box.

    Args:
        part: the part.
        feature: ``face 3``, ``edge 4`` or ``vertex 2``, numbered as ``tanteo part show`` does; None for the corners,
            which are taken, too, of a part that has no such feature.
    """
    found = None if feature is None else named_feature(part, feature)
    if found is None:
        corners = box_corners(part)
        return Places(f"all corners of {part.name}", None, corners, np.broadcast_to(np.eye(3), (len(corners), 3, 3)))
    return Places(f"{feature} of {part.name}", feature, *found.places)


def check_feature(feature: str, parts: Sequence[Part] = ()) -> None:
    """Refuse what names no feature, or none that any of the parts has.

    Raises:
        InputError: with the names that there are.
    """
    cls = named_class(feature)
    if cls is None:
        raise InputError(
            f"feature: expected 'face 3', 'edge 4' or 'vertex 2', got '{feature}'. `tanteo part show` lists them."
        )
    if parts and all(named_feature(part, feature) is None for part in parts):
        counts = ", ".join(f"{part.name}: {_range(cls, part)}" for part in parts[:3])
        raise InputError(f"feature: expected one of a part, got '{feature}'. There are, of {counts}.")


def _range(cls: type[NamedFace], part: Part) -> str:
    n = cls.count(part)
    return f"{cls.kind} 0 to {n - 1}" if n else f"no {cls.kind}"
