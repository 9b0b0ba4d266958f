"""Centres of tori with axis and two radii: a ring, the groove of a seal, a rounded rim."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tanteo.factors.factor import FeaturePart, Landmark, register_factor
from tanteo.factors.round_centre import MADE, RoundCentre, centre_of
from tanteo.features import Feature
from tanteo.features.kinds import FeatureKind, register_kind
from tanteo.geometry.typing import FloatArray, Vectors
from tanteo.parts import Part
from tanteo.parts.faces import Face

TORUS = register_kind(
    FeatureKind(
        "torus", (0, 1, 2, 3, 4), "origin at the centre, z along its axis", (1.0, -1.0, -1.0), size_name="radius"
    )
)
"""A sensed torus: ``size`` is the radius of its centre line, ``second_size`` that of its tube."""

_SAME = 1e-6
"""Faces whose centres and radii differ by no more are one torus that the CAD kernel has split [m]."""


@register_factor("torus_centre")
@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TorusCentre(RoundCentre):
    """Centre of a torus: normal density about it; the axis has either sign."""

    core: ClassVar[str] = "torus_centre"
    codimension: ClassVar[int] = 3
    feature_kinds: ClassVar[tuple[str, ...]] = (TORUS.name,)

    @classmethod
    def from_feature(cls, view: tuple[Feature, ...], name: str, jacobian: FloatArray) -> FeaturePart:
        """Return one factor: the centre with its axis, and the radii of ring and tube."""
        return centre_of(cls, view[0], jacobian, MADE)

    @classmethod
    def landmarks(cls, part: Part) -> list[Landmark]:
        """Return the centres of the toroidal faces, each torus as probable as any other."""
        tori = list[_Torus]()
        for face in part.faces:
            one = _torus_of(face)
            if one is not None and not any(one.is_same(other) for other in tori):
                tori.append(one)
        return [
            Landmark(
                np.stack([one.centre, one.centre + one.axis]), (one.radius, one.radius), 1 / len(tori), one.hole,
                number, one.name, others=(one.tube, one.tube),
            )
            for number, one in enumerate(tori)
        ]  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class _Torus:
    name: str
    centre: Vectors
    axis: Vectors
    radius: float
    tube: float
    hole: bool

    def is_same(self, other: _Torus) -> bool:
        """Return whether both are halves of one torus."""
        apart = max(float(np.abs(self.centre - other.centre).max()), abs(self.radius - other.radius))
        return self.hole == other.hole and max(apart, abs(self.tube - other.tube)) < _SAME


def _torus_of(face: Face) -> _Torus | None:
    centre, axis, radius, tube = face.axis_point, face.axis_direction, face.radius, face.minor_radius
    if face.surface != "torus" or centre is None or axis is None or radius is None or tube is None:
        return None
    return _Torus(face.name, centre, axis, radius, tube, not face.convex)
