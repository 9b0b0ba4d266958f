"""List the bores and bosses of a part that a hand can approach: those that end in a flat face, by rim or wall."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tanteo.hand.acquisition.approach_view import FACING, ApproachView
from tanteo.hand.acquisition.in_sight import InSight
from tanteo.parts import Rim, round_features
from tanteo.parts.faces import RoundFeature

_SHARE = 0.05
"""Standard deviation of the radius of a part's bore or boss, as a fraction of it."""

_BESIDE, _START = 0.002, 0.018
"""Distances from a rim at which its face must be accessible, and at which crossings start [m]."""

_RADII, _IN_SIGHT = 12, 9
"""Number of radii that are checked, and smallest number of accessible ones."""


def rims(view: ApproachView) -> Iterator[InSight]:
    """Yield the rims of bores and bosses, including the circles of chamfers.

    Args:
        view: part and direction of approach.
    """
    for one, rim, plane in _open(view):
        yield _in_sight(view, f"rim of {one.name}", rim, plane, hole=one.hole)


def walls(view: ApproachView) -> Iterator[InSight]:
    """Yield the walls of bores and bosses that are cylinders up to their rim.

    Args:
        view: part and direction of approach.
    """
    for one, rim, plane in _open(view):
        if one.surface == "cylinder":
            yield _in_sight(view, one.name, rim, plane, hole=one.hole)


def _open(view: ApproachView) -> Iterator[tuple[RoundFeature, Rim, int]]:
    """Yield the bores and bosses with an end that faces the hand, its rim, and the index of its plane."""
    row = {int(f): k for k, f in enumerate(view.part.planes.faces)}
    for one in round_features(view.part):
        for rim in one.rims:
            planes = [row[f] for f in rim.faces if f in row]
            if rim.open and planes and rim.axis @ view.towards >= FACING and _clear(view, rim, planes[0], one.hole):
                yield one, rim, planes[0]


def _clear(view: ApproachView, rim: Rim, plane: int, hole: bool) -> bool:
    """Return whether the face around a rim is accessible on most radii, and the centre of a bore is not covered."""
    away = 2 * view.part.diagonal
    over = view.surface.cast(rim.centre + away * rim.axis, -rim.axis).distances if hole else np.inf
    return _RADII * _beside(view, rim, plane, _BESIDE, hole) >= _IN_SIGHT and bool(over > away * (1 - 1e-6))


def _beside(view: ApproachView, rim: Rim, plane: int, far: float, hole: bool) -> float:
    """Return the fraction of radii on which the face is accessible at a distance from the rim [m]."""
    turns = np.arange(_RADII) * (2 * np.pi / _RADII)
    out = np.stack([np.cos(turns), np.sin(turns)], axis=1) @ view.part.planes.Ts_part_feature[plane][:3, :2].T
    r = rim.radius + far if hole else max(rim.radius - far, 0.0)
    return float(np.mean([view.open(plane, rim.centre + r * u) for u in out]))


def _in_sight(view: ApproachView, name: str, rim: Rim, plane: int, *, hole: bool) -> InSight:
    """Return a rim or wall with its value, which decreases with the obstructed starts of crossings on its face.

    For a boss the radius counts instead of the width, because a sensor crosses from its centre.
    """
    more = {"radius": rim.radius, "convex": not hole, "radius_share": _SHARE}
    free = 0.05 + _beside(view, rim, plane, _START, hole)
    value = free * view.value(plane, rim.centre, (2.0 if hole else 1.0) * rim.radius)
    return InSight(name, [int(view.part.planes.faces[plane])], rim.centre, (rim.axis,), value, more)
