"""Find patterns of equal holes with parallel axes: bolt circles, rows and grids."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from tanteo.geometry.typing import FloatArray
from tanteo.parts.faces.rounds import RoundFeature, round_features
from tanteo.parts.part import Part

PatternKind: TypeAlias = Literal["bolt circle", "grid", "row", "irregular"]

_LEAST = 3
"""Smallest number of equal holes in a pattern."""

_SAME = 1e-4
"""Tolerance for equal radii and positions, as a fraction of the diagonal."""

_PARALLEL = 1e-3
"""Angle below which axes are parallel [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class HolePattern:
    """Pattern of equal holes with parallel axes.

    Attributes:
        kind: kind of the pattern: ``bolt circle`` (evenly around a centre), ``grid`` or ``row`` (equal steps),
            otherwise ``irregular``.
        holes: indices into :func:`round_features`.
        hole_radius: radius of each hole [m].
        axis: common unit axis ``(3,)``.
        centre: centre of the pattern in the plane normal to the axis, at the mean height of the holes ``(3,)`` [m].
        radius: radius of a bolt circle [m]; None for other kinds.
        steps: distance between adjacent holes of a row ``(1,)`` or a grid ``(2,)`` [m]; empty for other kinds.
    """

    kind: PatternKind
    holes: tuple[int, ...]
    hole_radius: float
    axis: FloatArray
    centre: FloatArray
    radius: float | None = None
    steps: tuple[float, ...] = ()


def hole_patterns(part: Part) -> tuple[HolePattern, ...]:
    """Return the patterns of three or more equal holes of a part.

    Args:
        part: the part.
    """
    rounds = round_features(part)
    near = _SAME * part.diagonal
    left = [k for k, one in enumerate(rounds) if one.hole and one.surface == "cylinder"]
    found = []
    while left:
        first = rounds[left[0]]
        group = [k for k in left if _equal_holes(first, rounds[k], near)]
        left = [k for k in left if k not in group]
        if len(group) >= _LEAST:
            found.append(_pattern(rounds, group, near))
    return tuple(found)


def _equal_holes(a: RoundFeature, b: RoundFeature, near: float) -> bool:
    parallel = float(np.linalg.norm(np.cross(a.axis, b.axis))) < _PARALLEL
    return parallel and abs(float(a.radii[0] - b.radii[0])) < near


def _pattern(rounds: tuple[RoundFeature, ...], group: list[int], near: float) -> HolePattern:
    axis = rounds[group[0]].axis
    radius = float(rounds[group[0]].radii[0])
    centres = np.array([rounds[k].centre for k in group])
    across = np.linalg.svd(axis[None])[2][1:]
    flat = centres @ across.T
    height = float(np.mean(centres @ axis))
    flat = flat[np.sort(np.unique(np.round(flat / near), axis=0, return_index=True)[1])]  # coaxial holes count once

    def at(middle: FloatArray) -> FloatArray:
        return np.asarray(middle @ across + height * axis)

    middle = flat.mean(axis=0)
    if (circle := _circle(flat, middle, near)) is not None:
        return HolePattern("bolt circle", tuple(group), radius, axis, at(middle), circle)
    steps = _lattice(flat, near)
    kind: PatternKind = "irregular" if steps is None else ("grid", "row")[len(steps) == 1]
    return HolePattern(kind, tuple(group), radius, axis, at(middle), None, steps or ())


def _circle(flat: FloatArray, middle: FloatArray, near: float) -> float | None:
    """Return the radius of the circle on which points are evenly spaced; None if they are not."""
    off = flat - middle
    radii = np.linalg.norm(off, axis=1)
    if len(flat) < _LEAST or np.ptp(radii) > 2 * near or radii.min() < near:
        return None
    turns = np.sort(np.arctan2(off[:, 1], off[:, 0]))
    gaps = np.diff(np.r_[turns, turns[0] + 2 * np.pi])
    return float(radii.mean()) if np.ptp(gaps) * radii.mean() < 4 * near else None


def _lattice(flat: FloatArray, near: float) -> tuple[float, ...] | None:
    """Return the steps of a row or of a complete rectangular grid; None if the points form neither."""
    if len(flat) < _LEAST:
        return None
    gaps = np.linalg.norm(flat[:, None] - flat, axis=-1) + np.where(np.eye(len(flat)), np.inf, 0.0)
    i, j = np.unravel_index(int(np.argmin(gaps)), gaps.shape)
    x = (flat[j] - flat[i]) / gaps[i, j]
    found = [_levels(flat @ along, near) for along in (x, np.array([-x[1], x[0]]))]
    places = [levels for levels in found if levels is not None]
    if len(places) < 2 or len(places[0]) * len(places[1]) != len(flat):
        return None
    return tuple(float(levels[1] - levels[0]) for levels in places if len(levels) > 1)


def _levels(values: FloatArray, near: float) -> FloatArray | None:
    """Return the distinct values if their steps are equal; None otherwise."""
    values = np.sort(values)
    levels = values[np.r_[True, np.diff(values) > 2 * near]]
    steps = np.diff(levels)
    return levels if not len(steps) or np.ptp(steps) < 4 * near else None
