"""Cross the rim of a bore or boss along its radii, and fit the circle in the face.

The rim of radius ``R`` curves away on both sides of a crossing cone. The middle of the crossing is therefore nearer to
the axis than the rim by the mean of ``v^2 / 2 R`` over the spot, ``rho^2 / 8 R``. Events are moved outwards by it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.features import Feature
from tanteo.geometry.typing import FloatArray
from tanteo.hand.acquisition.crossings import Search, cross_at
from tanteo.hand.acquisition.edge_events import place_of
from tanteo.hand.acquisition.rim_seen import Disc
from tanteo.hand.acquisition.run import SensingRun
from tanteo.hand.acquisition.ways import moved
from tanteo.hand.motion.crossing import EdgeEvent
from tanteo.hand.motion.steering import Motion
from tanteo.hand.robot import Hand
from tanteo.sensors import error_model
from tanteo.words.findings import FewRimPlaces, Finding, NotCrossed, PlaceBeside

_BEYOND = 2.5e-3
"""Distance of a crossing beyond twice the spot [m]; narrower structures cannot be detected."""

_ON_BOSS = 0.006
"""Smallest distance of each frontal sensor inside of the rim of a boss [m]."""

_SAME = 0.25, 0.006
"""Largest deviation of a position from the expected rim, as a fraction of its radius, and at least [m]."""

_GATE = 3.3
"""Standardized residual above which a position lies on another rim."""

_CONTROLLED = 0.9
"""Largest leverage of one position on the circle; above it, the other positions cannot verify it."""

LEAST_PLACES = 4
"""Smallest number of positions on a rim: a circle fits any three."""

_MOST_OPEN = math.radians(135.0)
"""Largest angle of a rim without a position [rad]; the end of a slot is open for at least 150 degrees."""


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """Position at which one sensor crossed the rim in both directions.

    Attributes:
        events: events of both directions.
        point: mean of their positions ``(3,)`` [m].
        variance: variance of the point along the crossing [m^2].
    """

    events: tuple[EdgeEvent, ...]
    point: FloatArray
    variance: float


def least_radius(hand: Hand, standoff: float, *, convex: bool) -> float:
    """Return the smallest radius of a rim that a hand can acquire [m].

    A bore must be wider than the spot of a beam. A boss must be wide enough for both frontal beams.

    Args:
        hand: hand with its frontal beams.
        standoff: distance of the sensors from the face [m].
        convex: whether the rim is that of a boss; otherwise of a bore.
    """
    return 0.5 * hand.baseline + _ON_BOSS if convex else _spot(hand, standoff) + 0.5 * _BEYOND


def narrowest(run: SensingRun) -> float:
    """Return the smallest diameter of a bore that the frontal beams detect at the stand-off [m]."""
    return 2 * least_radius(run.hand, run.standoff, convex=False)


def _spot(hand: Hand, standoff: float) -> float:
    """Radius of a frontal beam on the face at the stand-off [m]."""
    half_angles = error_model(hand.rig).beam_half_angle[list(hand.frontal)]
    return float(standoff * np.tan(half_angles).max())


def cross_rim(
    run: SensingRun, face: Feature, disc: Disc, out: FloatArray, *, convex: bool, slack: float
) -> tuple[list[Place], Motion]:
    """Cross the rim along one radius, from the face: into a bore, or out over a boss.

    Args:
        run: The run; the face is sensed.
        face: In which the rim lies.
        disc: Where it should be.
        out: Direction of the radius ``(3,)``, unit.
        convex: A boss.
        slack: How far from there it may be [m].

    Returns:
        The places of all sensors that crossed it, and how it ended.
    """
    way = out if convex else -out
    inset, beyond = run.standoff * 0.3 + 0.006 + slack, narrowest(run)
    foot = disc.centre + disc.radius * out - inset * way
    search = Search(inset + slack, inset + 2 * slack + beyond, beyond)
    last = Motion("cross rim", "nothing", NotCrossed(), ())
    # the other sensor rather over the bore or inside the boss, where there is less around; else outside
    for side in (-1.0, 1.0)[: 1 if convex else 2]:
        middle = foot + 0.5 * side * run.hand.baseline * out
        crossing = cross_at(run, face, middle, out, way, search)
        places = [p for p in _places(run, crossing.events, disc, face) if _is_of(p, disc, slack)]
        last = crossing.motion
        if places or last.status not in ("limit", "lost"):
            return places, last
    return [], last


def _places(run: SensingRun, events: Sequence[EdgeEvent], disc: Disc, face: Feature) -> list[Place]:
    """Return the position of each sensor that crossed, with its events moved outwards to the rim."""
    normal, slopes = face.T_world_feature[:3, 2], np.tan(error_model(run.hand.rig).beam_half_angle)
    unit, places = error_model(run.hand.rig).cov_unit, list[Place]()
    for sensor in dict.fromkeys(e.sensor for e in events):
        own = list[EdgeEvent]()
        for event in (e for e in events if e.sensor == sensor):
            away = place_of(run.hand, event) - disc.centre
            away -= (away @ normal) * normal
            distance = float(np.linalg.norm(away))
            shift = (event.distance * slopes[sensor]) ** 2 / (8 * disc.radius)
            own.append(replace(event, T_world_hand=moved(event.T_world_hand, shift / max(distance, 1e-9) * away)))
        C, d = unit[sensor], own[0].distance
        variance = own[0].across_sd ** 2 / len(own) + max(C[0, 0], C[1, 1]) + d**2 * max(C[3, 3], C[4, 4])
        places.append(Place(tuple(own), np.mean([place_of(run.hand, e) for e in own], axis=0), float(variance)))
    return places


def _is_of(place: Place, disc: Disc, slack: float) -> bool:
    off = abs(float(np.linalg.norm(place.point - disc.centre)) - disc.radius)
    return off < max(slack + _SAME[0] * disc.radius, _SAME[1])


def disc_through(places: Sequence[Place], face: Feature, start: Disc) -> Disc | None:
    """Return the circle in the face through three positions or more; None if they do not determine it.

    Args:
        places: positions on the rim.
        face: face of the rim.
        start: approximate circle.
    """
    if len(places) < 3:
        return None
    from scipy.optimize import least_squares  # slow to import

    centre, axes = start.centre, face.T_world_feature[:3, :2]
    points = (np.array([p.point for p in places]) - centre) @ axes
    weights = 1 / np.sqrt([p.variance for p in places])
    found = least_squares(
        lambda x: -_rows(points, x[:2], x[2])[1] * weights,
        [0.0, 0.0, start.radius],
        lambda x: _rows(points, x[:2], x[2])[0] * weights[:, None],
        method="lm",
    )
    values = np.linalg.svd(found.jac, compute_uv=False)
    if values[-1] < 0.05 * values[0]:
        return None
    x, r = found.x[:2], float(found.x[2])
    near = np.linalg.norm(x) < 2 * start.radius + 0.01 and 0.3 * start.radius < r < 3 * start.radius
    return replace(start, centre=centre + axes @ x, radius=r) if near else None


def _rows(points: FloatArray, x: FloatArray, r: float) -> tuple[FloatArray, FloatArray]:
    away = points - x
    distance = np.maximum(np.linalg.norm(away, axis=1), 1e-9)
    return np.column_stack([away / distance[:, None], np.ones(len(points))]), distance - r


def controlled(places: Sequence[Place], face: Feature, disc: Disc) -> tuple[list[Place], Finding | None]:
    """Exclude a position that is not on the rim, if the others suffice to identify it (data snooping; Baarda 1968).

    The position with the largest residual beyond the gate is excluded if at least :data:`LEAST_PLACES` remain.

    Args:
        places: positions on the rim.
        face: face that the rim is on.
        disc: approximate circle.

    Returns:
        The remaining positions, and the finding that contradicts them; None if there is none.
    """
    kept = list(places)
    why, worst = _doubt(kept, face, disc)
    if worst is not None and len(kept) > LEAST_PLACES:
        rest = kept[:worst] + kept[worst + 1 :]
        if _doubt(rest, face, disc)[0] is None:
            return rest, None
    return kept, why


def _doubt(places: list[Place], face: Feature, disc: Disc) -> tuple[Finding | None, int | None]:
    """Return why positions do not determine one circle, and the index of a position that does not fit."""
    if len(places) < LEAST_PLACES:
        return FewRimPlaces(len(places), "few", math.nan), None
    circle = disc_through(places, face, disc)
    if circle is None:
        return FewRimPlaces(len(places), "spread", math.nan), None
    axes, weights = face.T_world_feature[:3, :2], 1 / np.sqrt([p.variance for p in places])
    points = (np.array([p.point for p in places]) - circle.centre) @ axes
    turns = np.sort(np.arctan2(points[:, 1], points[:, 0]))
    open_for = float(np.diff(turns, append=turns[0] + 2 * math.pi).max())
    if open_for > _MOST_OPEN:
        return FewRimPlaces(len(places), "open", open_for), None
    A, residual = _rows(points, np.zeros(2), circle.radius)
    Q = np.linalg.qr(A * weights[:, None])[0]
    leverages = np.sum(Q**2, axis=1)
    if leverages.max() > _CONTROLLED:
        return FewRimPlaces(len(places), "alone", math.nan), None
    standard = np.abs(residual * weights) / np.sqrt(1 - leverages)
    worst = int(np.argmax(standard))
    if standard[worst] <= _GATE:
        return None, None
    return PlaceBeside(float(standard[worst]), "circle"), worst


def turned(face: Feature, first: FloatArray, angle: float) -> FloatArray:
    """Return a direction in a face, rotated about its normal ``(3,)``.

    Args:
        face: face with the normal.
        first: direction before the rotation ``(3,)``; it is projected into the face.
        angle: angle of the rotation [rad].
    """
    normal = face.T_world_feature[:3, 2]
    first = first - (first @ normal) * normal
    first = first / np.linalg.norm(first)
    return np.asarray(math.cos(angle) * first + math.sin(angle) * np.cross(normal, first))
