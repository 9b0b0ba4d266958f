"""Locate edge events in the world, fit a line to them, and check that the face ends at that line.

Three positions on three edges may lie on one line by chance, and then seem to verify each other. The beams of the
crossings between these positions show the error: the face ends before that line, or continues beyond it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tanteo.features import Feature
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Vectors
from tanteo.hand.acquisition.run import SensingRun
from tanteo.hand.acquisition.seen import Cloud, cloud_of
from tanteo.hand.motion.crossing import EdgeEvent
from tanteo.hand.motion.track import Crease
from tanteo.hand.robot import Hand
from tanteo.sensors import error_model
from tanteo.words.findings import EdgesMixed, FaceEndsElsewhere, FewEdgeCrossings, Finding, PlaceBeside

Line = tuple[FloatArray, FloatArray]
"""Point and unit direction of a line, each ``(3,)``."""

_APART = 0.0025
"""Smallest rms distance of positions from their mean that determines a direction [m]."""

_SAME = 0.004
"""Distance from the line of the other events above which an event lies on another edge [m]."""

ONE_PLACE = 0.005
"""Distance along an edge below which two events have the same position [m]."""

_CONTROLLED = 0.9
"""Largest leverage of one position on the line; above it, the other positions cannot verify it."""

_MANY = 5
"""Number of positions from which one may be rejected: the remaining four verify each other."""

_GATE = 3.3
"""Standardized residual above which a position lies on another edge."""


def place_of(hand: Hand, event: EdgeEvent | Crease) -> FloatArray:
    """Return the position of an event in the world ``(3,)`` [m].

    Args:
        hand: hand whose sensor recorded the event.
        event: edge event or crease.
    """
    T = event.T_world_hand
    local = hand.origins[event.sensor] + event.distance * hand.axes[event.sensor]
    return np.asarray(T[:3, :3] @ local + T[:3, 3])


def line_through(hand: Hand, events: Sequence[EdgeEvent]) -> Line | None:
    """Return the line through events; None if they all have the same position.

    Args:
        hand: hand whose sensors recorded the events.
        events: edge events.
    """
    if not events:
        return None
    places = np.array([place_of(hand, e) for e in events])
    middle = places.mean(axis=0)
    _, size, axes = np.linalg.svd(places - middle)
    if size[0] / math.sqrt(len(places)) < _APART:
        return None
    return middle, axes[0]


def distance_from(hand: Hand, event: EdgeEvent, line: Line) -> float:
    """Return the distance of an event from a line [m].

    Args:
        hand: hand whose sensor recorded the event.
        event: edge event.
        line: line in the world.
    """
    away = place_of(hand, event) - line[0]
    return float(np.linalg.norm(away - (away @ line[1]) * line[1]))


def on_line(hand: Hand, events: Sequence[EdgeEvent], line: Line) -> list[EdgeEvent]:
    """Return the events that may lie on the edge of a line.

    Args:
        hand: hand whose sensors recorded the events.
        events: edge events.
        line: line in the world.
    """
    return [e for e in events if distance_from(hand, e, line) < _SAME]


def agreeing(
    hand: Hand, events: Sequence[EdgeEvent], along: FloatArray, outwards: FloatArray, total: int = 0
) -> tuple[list[EdgeEvent], Finding | None]:
    """Return the events of one edge: without the position that lies on another edge, if four consistent ones remain.

    Beside the end of an edge, a crossing hits the next edge. If enough positions verify each other, the one whose
    standardized residual exceeds the gate is rejected (data snooping; Baarda 1968). A few of many events on several
    edges lie on one line by chance, so the line must contain most of the events.

    Args:
        hand: hand whose sensors recorded the events.
        events: events near the line of the edge.
        along: direction of the edge ``(3,)``.
        outwards: direction across the edge ``(3,)``.
        total: number of all events, including those far from the line.

    Returns:
        The events, and why they do not lie on one straight edge; empty if they do.
    """
    why, worst = doubt(hand, events, along, outwards)
    rest = [e for e, out in zip(events, worst, strict=True) if not out]
    if (
        not worst.any()
        or count_places(hand, rest, along) < _MANY - 1
        or doubt(hand, rest, along, outwards)[0] is not None
    ):
        rest = list(events)
    else:
        why = None
    if why is None and 2 * len(rest) < total:
        why = EdgesMixed(total, len(rest))
    return rest, why


def count_places(hand: Hand, events: Sequence[EdgeEvent], along: FloatArray) -> int:
    """Return the number of different positions of events along an edge.

    Args:
        hand: hand whose sensors recorded the events.
        events: edge events.
        along: direction of the edge ``(3,)``.
    """
    return len(np.unique(_places(hand, events, along)))


def _places(hand: Hand, events: Sequence[EdgeEvent], along: FloatArray) -> IntArray:
    """Return the index of each event's position along an edge ``(n,)``."""
    x = np.array([place_of(hand, e) for e in events]).reshape(-1, 3) @ along
    order, group = np.argsort(x), np.zeros(len(events), dtype=np.int64)
    group[order[1:]] = np.cumsum(np.diff(x[order]) > ONE_PLACE)
    return group


def doubt(
    hand: Hand, events: Sequence[EdgeEvent], along: FloatArray, outwards: FloatArray
) -> tuple[Finding | None, BoolArray]:
    """Return why events do not lie on one straight edge, and the mask of the events at the worst position.

    Events at one position, in both directions, hit the same corner or step, so only the other positions can verify it.
    The leverage is the fraction of a position's error that the line absorbs; the rest is in its residual (Baarda 1968).

    Args:
        hand: hand whose sensors recorded the events.
        events: edge events.
        along: direction of the edge ``(3,)``.
        outwards: direction across the edge ``(3,)``.

    Returns:
        Message, empty if the events are consistent, and mask ``(n,)``.
    """
    spots, group = np.array([place_of(hand, e) for e in events]).reshape(-1, 3), _places(hand, events, along)
    counts, none = np.bincount(group), np.zeros(len(events), dtype=bool)
    if len(events) == 0 or len(counts) < 3:
        return FewEdgeCrossings(len(events), alone=False), none
    x, y, variance = (
        np.bincount(group, weights=v) / counts for v in (spots @ along, spots @ outwards, _variances(hand, events))
    )
    A = np.stack([np.ones_like(x), x - x.mean()], axis=1) / np.sqrt(variance)[:, None]
    H = A @ np.linalg.solve(A.T @ A, A.T)
    leverages = np.diag(H)
    if leverages.max() > _CONTROLLED:
        return FewEdgeCrossings(len(events), alone=True), none
    residuals = np.abs(y / np.sqrt(variance) - H @ (y / np.sqrt(variance))) / np.sqrt(1 - leverages)
    worst = int(np.argmax(residuals))
    if residuals[worst] <= _GATE:
        return None, none
    return PlaceBeside(float(residuals[worst]), "line"), group == worst


def _variances(hand: Hand, events: Sequence[EdgeEvent]) -> FloatArray:
    """Return the variance of each event's position across the edge ``(n,)`` [m^2].

    It is half the variance of an event, because each position is crossed in both directions, plus that of the mounting.
    """
    unit = error_model(hand.rig).cov_unit
    out = []
    for e in events:
        C = unit[e.sensor]
        out.append(0.5 * e.across_sd**2 + max(C[0, 0], C[1, 1]) + e.distance**2 * max(C[3, 3], C[4, 4]))
    return np.array(out)


_SPOT, _PLACE = 1.2, 1e-3
"""Distance from an edge, in radii of the spot and additional [m], within which a beam may hit or miss the face."""

_BEFORE, _BEYOND, _LEAST = 3.0, 2.0, 2e-3
"""Distances before and beyond an edge that are checked, in radii of the spot, and additional distance [m]; farther away
the face may have another edge."""

_DROP = 0.15
"""Excess of a range, as a fraction of the stand-off, from which the beam has left the face."""

_OFTEN = 3
"""Number of contradicting beams that reject an edge; one may contradict it by chance."""


def against(
    run: SensingRun, face: Feature, edge: Feature, crossed: Vectors, outwards: FloatArray
) -> FaceEndsElsewhere | None:
    """Return why the beams of the crossings contradict an edge of a face; None if they do not.

    Args:
        run: running acquisition.
        face: sensed face.
        edge: fitted edge.
        crossed: positions of the crossings ``(n, 3)`` [m].
        outwards: direction out of the face, across the edge ``(3,)``.
    """
    cloud = cloud_of(run.hand, [m for m in run.motions if m.name == "cross edge"])
    cloud = cloud.keep(cloud.ahead)
    foot, way = _on_face(cloud, face)
    spot, slack = way * cloud.slopes, np.maximum(_DROP * run.standoff, 6 * cloud.sds)
    on_face = cloud.hit & (np.abs(cloud.ranges - way) < slack)
    missed = ~cloud.hit | (cloud.ranges > way + slack)
    origin, along = edge.T_world_feature[:3, 3], edge.T_world_feature[:3, 0]
    x, y, places = (foot - origin) @ along, (foot - origin) @ outwards, (crossed - origin) @ along
    between = (x > places.min() + spot) & (x < places.max() - spot)
    clear = between & (np.abs(y) > _SPOT * spot + _PLACE)
    ends = clear & missed & (y < 0) & (-y < _BEFORE * spot + _LEAST)
    goes_on = clear & on_face & (y > 0) & (y < _BEYOND * spot + _LEAST)
    for wrong, beyond in ((ends, False), (goes_on, True)):
        if np.count_nonzero(wrong) >= _OFTEN:
            return FaceEndsElsewhere(beyond)
    return None


def _on_face(cloud: Cloud, face: Feature) -> tuple[Vectors, FloatArray]:
    """Return the intersections of the beams' axes with a plane ``(n, 3)``, and their distances ``(n,)`` [m]."""
    point, normal = face.T_world_feature[:3, 3], face.T_world_feature[:3, 2]
    way = ((point - cloud.starts) @ normal) / np.minimum(cloud.beams @ normal, -1e-6)
    return cloud.starts + way[:, None] * cloud.beams, way
