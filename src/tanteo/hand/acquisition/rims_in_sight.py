"""Bores and bosses of a part that a hand can come to: those that end in a flat face, as their rim or their wall."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tanteo.hand.acquisition.in_sight import InSight
from tanteo.hand.acquisition.look import FACING, Look
from tanteo.parts import Rim, RoundFeature, round_features

_SHARE = 0.05
"""How well the radius of a part's bore or boss is known, as a share of it."""

_BESIDE, _START = 0.002, 0.018
"""Beside a rim its face has to be in sight, so far from it, and from how far crossings of it start [m]."""

_RADII, _IN_SIGHT = 12, 9
"""Radii on which that is looked at, and on how many it has to be."""


def rims(look: Look) -> Iterator[InSight]:
    """Rims of bores and bosses, the circles of chamfers among them."""
    for one, rim, plane in _open(look):
        yield _in_sight(look, f"rim of {one.name}", rim, plane, hole=one.hole)


def walls(look: Look) -> Iterator[InSight]:
    """Walls of bores and bosses that are cylinders up to their rim."""
    for one, rim, plane in _open(look):
        if one.surface == "cylinder":
            yield _in_sight(look, one.name, rim, plane, hole=one.hole)


def _open(look: Look) -> Iterator[tuple[RoundFeature, Rim, int]]:
    """Bores and bosses with an end that faces the hand, and the row of the plane in which it lies."""
    row = {int(f): k for k, f in enumerate(look.part.planes.faces)}
    for one in round_features(look.part):
        for rim in one.rims:
            planes = [row[f] for f in rim.faces if f in row]
            if rim.open and planes and rim.axis @ look.towards >= FACING and _clear(look, rim, planes[0], one.hole):
                yield one, rim, planes[0]


def _clear(look: Look, rim: Rim, plane: int, hole: bool) -> bool:
    """Whether the face beside the rim is in sight nearly all around, and of a bore nothing is over its middle."""
    away = 2 * look.part.diagonal
    over = look.surface.cast(rim.centre + away * rim.axis, -rim.axis).distances if hole else np.inf
    return _RADII * _beside(look, rim, plane, _BESIDE, hole) >= _IN_SIGHT and bool(over > away * (1 - 1e-6))


def _beside(look: Look, rim: Rim, plane: int, far: float, hole: bool) -> float:
    """Share of the radii on which the face is in sight so far from the rim [m]."""
    turns = np.arange(_RADII) * (2 * np.pi / _RADII)
    out = np.stack([np.cos(turns), np.sin(turns)], axis=1) @ look.part.planes.Ts_part_feature[plane][:3, :2].T
    r = rim.radius + far if hole else max(rim.radius - far, 0.0)
    return float(np.mean([look.open(plane, rim.centre + r * u) for u in out]))


def _in_sight(look: Look, name: str, rim: Rim, plane: int, *, hole: bool) -> InSight:
    """A rim or wall, worth the less the less room crossings have to start on its face.

    Of a boss the radius counts, as far as a sensor comes from its middle, and not its width.
    """
    more = {"radius": rim.radius, "convex": not hole, "radius_share": _SHARE}
    room = 0.05 + _beside(look, rim, plane, _START, hole)
    value = room * look.value(plane, rim.centre, (2.0 if hole else 1.0) * rim.radius)
    return InSight(name, [int(look.part.planes.faces[plane])], rim.centre, (rim.axis,), value, more)
