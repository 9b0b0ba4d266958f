"""Centres of spheres."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tanteo.factors.factor import FeaturePart, Landmark, register_factor
from tanteo.factors.round_centre import MADE, RoundCentre, centre_of, point_landmarks
from tanteo.features import Feature
from tanteo.features.kinds import SPHERE
from tanteo.geometry.typing import FloatArray
from tanteo.parts import Part


@register_factor("sphere_centre")
@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SphereCentre(RoundCentre):
    """Centre of a sphere."""

    core: ClassVar[str] = "sphere_centre"
    codimension: ClassVar[int] = 3
    feature_kinds: ClassVar[tuple[str, ...]] = (SPHERE.name,)

    @classmethod
    def from_feature(cls, view: tuple[Feature, ...], name: str, jacobian: FloatArray) -> FeaturePart:
        """Return one factor: the centre with its sensed radius."""
        return centre_of(cls, view[0], jacobian, MADE)

    @classmethod
    def landmarks(cls, part: Part) -> list[Landmark]:
        """Return the centres of spheres, each as probable as any other."""
        return point_landmarks(part, "sphere")
