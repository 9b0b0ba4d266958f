"""Where edge events are in the world, the line that they are on, and whether the face ends there.

Three places of three edges are on one line by chance now and then, and then control each other. What the crossings met
between these places tells: there the face ends before that line, or goes on beyond it.
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
from tanteo.words.findings import EdgeMetRarely, EdgesMixed, FaceEndsElsewhere, Finding, PlaceBeside

Line = tuple[FloatArray, FloatArray]
"""A point and a direction ``(3,)``."""

_APART = 0.0025
"""Root mean square of the distances from their middle that places need to have a direction [m]."""

_SAME = 0.004
"""Events farther than this from the line of the others are of another edge [m]."""

ONE_PLACE = 0.005
"""Events nearer to each other than this along an edge are at one place [m]."""

_CONTROLLED = 0.9
"""Largest leverage of one place on the line: beyond, the others hardly show that it is of another edge."""

_MANY = 5
"""Of so many places one may be of another edge: four are left, which control each other."""

_GATE = 3.3
"""A place that is farther from the line of all, in standard deviations of its residual, is of another edge."""


def place_of(hand: Hand, event: EdgeEvent | Crease) -> FloatArray:
    """Where an event was ``(3,)`` [m]."""
    T = event.T_world_hand
    local = hand.origins[event.sensor] + event.distance * hand.axes[event.sensor]
    return np.asarray(T[:3, :3] @ local + T[:3, 3])


def line_through(hand: Hand, events: Sequence[EdgeEvent]) -> Line | None:
    """The line through events; None if they are all at one place."""
    if not events:
        return None
    places = np.array([place_of(hand, e) for e in events])
    middle = places.mean(axis=0)
    _, size, axes = np.linalg.svd(places - middle)
    if size[0] / math.sqrt(len(places)) < _APART:
        return None
    return middle, axes[0]


def distance_from(hand: Hand, event: EdgeEvent, line: Line) -> float:
    """Of an event from a line [m]."""
    away = place_of(hand, event) - line[0]
    return float(np.linalg.norm(away - (away @ line[1]) * line[1]))


def on_line(hand: Hand, events: Sequence[EdgeEvent], line: Line) -> list[EdgeEvent]:
    """Those of some events that may be of the same edge as a line."""
    return [e for e in events if distance_from(hand, e, line) < _SAME]


def agreeing(
    hand: Hand, events: Sequence[EdgeEvent], along: FloatArray, outwards: FloatArray, met: int = 0
) -> tuple[list[EdgeEvent], Finding | None]:
    """Events without the one place, of five or more, that is of another edge, if the others then are of one.

    Beside the end of an edge a crossing meets the next one. Where enough places control each other, the one whose
    residual is beyond the gate is known to be the wrong one (data snooping; Baarda 1968). Of many events of several
    edges a few are on one line by chance: most of what was met has to be of the one edge.

    Args:
        hand: That met them.
        events: Near the line of the edge.
        along: Direction of the edge ``(3,)``.
        outwards: Across it ``(3,)``.
        met: How many there were, with those that are not near the line.

    Returns:
        The events, and what speaks against all of them being of one straight edge; empty if nothing does.
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
    if why is None and 2 * len(rest) < met:
        why = EdgesMixed(met, len(rest))
    return rest, why


def count_places(hand: Hand, events: Sequence[EdgeEvent], along: FloatArray) -> int:
    """At how many places along an edge events are."""
    return len(np.unique(_places(hand, events, along)))


def _places(hand: Hand, events: Sequence[EdgeEvent], along: FloatArray) -> IntArray:
    """The number of the place of each event along an edge."""
    x = np.array([place_of(hand, e) for e in events]).reshape(-1, 3) @ along
    order, group = np.argsort(x), np.zeros(len(events), dtype=np.int64)
    group[order[1:]] = np.cumsum(np.diff(x[order]) > ONE_PLACE)
    return group


def doubt(
    hand: Hand, events: Sequence[EdgeEvent], along: FloatArray, outwards: FloatArray
) -> tuple[Finding | None, BoolArray]:
    """What speaks against one straight edge, and which events are of the one place that is beside it.

    Events at one place, there and back, meet the same corner or step: only the other places can tell. The share of a
    place's own error that the line takes over is its leverage; the rest shows in its residual (Baarda 1968).
    """
    spots, group = np.array([place_of(hand, e) for e in events]).reshape(-1, 3), _places(hand, events, along)
    counts, none = np.bincount(group), np.zeros(len(events), dtype=bool)
    if len(events) == 0 or len(counts) < 3:
        return EdgeMetRarely(len(events), alone=False), none
    x, y, variance = (
        np.bincount(group, weights=v) / counts for v in (spots @ along, spots @ outwards, _variances(hand, events))
    )
    A = np.stack([np.ones_like(x), x - x.mean()], axis=1) / np.sqrt(variance)[:, None]
    H = A @ np.linalg.solve(A.T @ A, A.T)
    leverages = np.diag(H)
    if leverages.max() > _CONTROLLED:
        return EdgeMetRarely(len(events), alone=True), none
    residuals = np.abs(y / np.sqrt(variance) - H @ (y / np.sqrt(variance))) / np.sqrt(1 - leverages)
    worst = int(np.argmax(residuals))
    if residuals[worst] <= _GATE:
        return None, none
    return PlaceBeside(float(residuals[worst]), "line"), group == worst


def _variances(hand: Hand, events: Sequence[EdgeEvent]) -> FloatArray:
    """Of a place across the edge: half that of an event, which comes there and back, and the sensor's mounting."""
    unit = error_model(hand.rig).cov_unit
    out = []
    for e in events:
        C = unit[e.sensor]
        out.append(0.5 * e.across_sd**2 + max(C[0, 0], C[1, 1]) + e.distance**2 * max(C[3, 3], C[4, 4]))
    return np.array(out)


_SPOT, _PLACE = 1.2, 1e-3
"""Within so many radii of its spot, and so far more [m], a beam beside an edge may meet the face or miss it."""

_BEFORE, _BEYOND, _LEAST = 3.0, 2.0, 2e-3
"""A crossing takes care of so many radii before an edge and beyond it, and so far more [m]: farther off there may be
another edge of the same face."""

_DROP = 0.15
"""A range that is longer by this share of the stand-off is off the face."""

_OFTEN = 3
"""Beams that speak against an edge, one of which may be by chance."""


def against(
    run: SensingRun, face: Feature, edge: Feature, crossed: Vectors, outwards: FloatArray
) -> FaceEndsElsewhere | None:
    """What the crossings met that cannot be beside an edge of a face; empty if all can be."""
    cloud = cloud_of(run.hand, [m for m in run.motions if m.name == "cross edge"])
    cloud = cloud.keep(cloud.ahead)
    foot, way = _on_face(cloud, face)
    spot, slack = way * cloud.slopes, np.maximum(_DROP * run.standoff, 6 * cloud.sds)
    met = cloud.met & (np.abs(cloud.ranges - way) < slack)
    missed = ~cloud.met | (cloud.ranges > way + slack)
    origin, along = edge.T_world_feature[:3, 3], edge.T_world_feature[:3, 0]
    x, y, places = (foot - origin) @ along, (foot - origin) @ outwards, (crossed - origin) @ along
    between = (x > places.min() + spot) & (x < places.max() - spot)
    clear = between & (np.abs(y) > _SPOT * spot + _PLACE)
    ends = clear & missed & (y < 0) & (-y < _BEFORE * spot + _LEAST)
    goes_on = clear & met & (y > 0) & (y < _BEYOND * spot + _LEAST)
    for wrong, beyond in ((ends, False), (goes_on, True)):
        if np.count_nonzero(wrong) >= _OFTEN:
            return FaceEndsElsewhere(beyond)
    return None


def _on_face(cloud: Cloud, face: Feature) -> tuple[Vectors, FloatArray]:
    """Where the axes of the beams meet a plane ``(n, 3)``, and after which way ``(n,)`` [m]."""
    point, normal = face.T_world_feature[:3, 3], face.T_world_feature[:3, 2]
    way = ((point - cloud.starts) @ normal) / np.minimum(cloud.beams @ normal, -1e-6)
    return cloud.starts + way[:, None] * cloud.beams, way
