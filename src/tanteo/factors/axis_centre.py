"""Centres of circles on the axis of a hole or boss, from a measured centre or a sensed circle or cylinder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tanteo.factors.factor import FeaturePart, Landmark, register_factor
from tanteo.factors.line_points import line_points
from tanteo.factors.round_centre import MADE, RoundCentre, centre_of, size_of
from tanteo.features import Feature
from tanteo.features.kinds import CIRCLE, CYLINDER
from tanteo.geometry.typing import FloatArray
from tanteo.parts import Part, round_features

_EXTENSION = 0.5
"""Extension of the range of proposed heights at each end, as a fraction of the wall's length (decision 70)."""


@register_factor("centre")
@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AxisCentre(RoundCentre):
    """Centre of a circle on the axis of a hole or boss, at any height; the axis has either sign.

    Only the position across the axis counts. Devices report the height of the probe, of a reference plane or zero, so
    the height along the axis carries no information.
    """

    core: ClassVar[str] = "axis_centre"
    codimension: ClassVar[int] = 2
    is_line: ClassVar[bool] = True
    feature_kinds: ClassVar[tuple[str, ...]] = (CIRCLE.name, CYLINDER.name)

    @classmethod
    def from_feature(cls, view: tuple[Feature, ...], name: str, jacobian: FloatArray) -> FeaturePart:
        """Return the centre of a circle with its axis, or two points of a cylinder's axis, one with its radius."""
        feature = view[0]
        if feature.kind is CIRCLE:
            return centre_of(cls, feature, jacobian, MADE)
        T = np.array(feature.T_world_feature)
        T[:3, :3] = np.roll(T[:3, :3], -(feature.kind.axis or 0), axis=1)  # the axis first
        (first, second), cov, jacobians = line_points(feature, T, jacobian)
        size, side = size_of(feature, MADE)
        factors = cls(at=first, cov=cov, sensed_size=size, material_side=side), cls(at=second, cov=cov)
        return list(zip(factors, jacobians, strict=True))

    @classmethod
    def landmarks(cls, part: Part) -> list[Landmark]:
        """Return the axes of holes and bosses, each as probable as any other.

        The ends are those of the wall with an extension; initial poses put centres between them.
        """
        rounds, out = round_features(part), list[Landmark]()
        for number, one in enumerate(rounds):
            sizes = float(one.radii.min()), float(one.radii.max())
            beyond = _EXTENSION * (one.ends[1] - one.ends[0])
            ends = one.ends + np.stack([-beyond, beyond])
            out.append(Landmark(ends, sizes, 1 / len(rounds), one.hole, number, one.name, is_line=True))
        return out
