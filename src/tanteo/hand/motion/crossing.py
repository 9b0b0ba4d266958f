"""Cross an edge and return, and locate where each frontal sensor lost and found the surface.

A beam is a cone. While its spot slides over an edge, a growing fraction of the readings misses the surface. The edge is
at the middle of this transition, not at the first miss: the sum of the steps whose reading is on the surface. With step
length ``s`` and spot radius ``rho``, its variance is ``s rho 128 / (45 pi^2) + s^2 / 12``. The first term is ``s``
times the integral of ``F (1 - F)`` over the crossing, where ``F`` is the fraction of a disc beyond a line.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from tanteo.geometry.typing import BoolArray, Transforms, Vectors
from tanteo.hand.motion.following import level
from tanteo.hand.motion.steering import Ending, Motion, Rules, Steering
from tanteo.hand.motion.track import Crease, Surface, Track, crease_angle, crease_of
from tanteo.hand.robot import HIT, NEAR, HandReading, Robot
from tanteo.hand.twists import translation_twist
from tanteo.sensors import error_model
from tanteo.words.findings import BendsAway, EdgeCrossed, EdgeNotRepeated, NoEdge, NotUnderSensors

STRIDE = 0.01
"""Step of the hand between two readings during a crossing, as a fraction of the stand-off."""

_HALF_MEAN_DIFFERENCE = 128 / (45 * math.pi**2)
"""Integral of F (1 - F) for a disc of radius one: half the mean difference of two points of it along an axis."""

_BESIDE = 12
"""Number of readings on the surface next to the edge whose mean is the range there."""

_DROP = 0.15
"""Increase of a range, as a fraction of the stand-off, at which the sensor is off the surface."""

_BEYOND = 2e-3
"""Distance beyond its spot that a sensor moves before the edge counts as crossed [m]."""

_WHOLE = 0.95
"""Smallest fraction of the readings before the spot that must be on the surface; below it, the spot slides along
another edge."""

_NEAR = 0.3
"""Largest deviation of a surface from the stand-off, as a fraction of it; beyond it is a different surface."""

_MOSTLY = 0.8
"""Smallest fraction of the readings at rest that must be on the surface for a sensor over it."""


@dataclass(frozen=True, slots=True, eq=False)
class EdgeEvent:
    """Pose of the hand at which the axis of one sensor passed over an edge.

    Attributes:
        sensor: index of the sensor on the rig.
        T_world_hand: reported pose of the hand at that instant ``(4, 4)``.
        distance: range to the surface at the edge [m].
        along_sd: standard deviation of that range without the sensor's shared errors [m].
        across_sd: standard deviation of the position along the crossing [m].
        outwards: whether the sensor left the surface; otherwise it returned.
    """

    sensor: int
    T_world_hand: Transforms
    distance: float
    along_sd: float
    across_sd: float
    outwards: bool


@dataclass(frozen=True, slots=True, eq=False)
class Crossing:
    """Result of one crossing, out and back.

    Attributes:
        motion: ending of the motion; ``reached`` if at least one sensor crossed both ways.
        events: events of the sensors that crossed the edge.
        creases: events of the sensors below which the surface bent away instead.
    """

    motion: Motion
    events: tuple[EdgeEvent, ...]
    creases: tuple[Crease, ...] = ()

    @property
    def seen(self) -> tuple[int, ...]:
        """Return the indices of the sensors that crossed, each once."""
        return tuple(dict.fromkeys(e.sensor for e in self.events))


def cross_edge(
    robot: Robot, direction: Vectors, reach: float, standoff: float, rules: Rules, *, spread: float = 0.015
) -> Crossing:
    """Move straight until both frontal sensors are off the surface or the reach is exceeded, then move straight back.

    The hand keeps its orientation, so align it with the surface before. Ranges do not control the motion, but the
    steering still slows it down near obstacles.

    Args:
        robot: robot with the hand over the surface.
        direction: direction towards the edge, perpendicular to z ``(3,)``, hand frame.
        reach: largest distance to move [m].
        standoff: height above the surface [m].
        rules: limits of the motion.
        spread: distance to move on after one sensor has crossed, for the other one [m].

    Returns:
        ``reached`` with the events of every sensor that crossed both ways; ``nothing`` if there is no edge within the
        reach, or the surface only bends; ``lost`` if neither sensor is over the surface, or the ways out and back
        disagree; ``limit``; ``timeout``.
    """
    heading = level(direction)
    run = Steering("cross edge", robot, rules)
    surface = _surface(run, standoff)
    if np.isnan(surface.ranges).all():
        return Crossing(run.end("lost", NotUnderSensors(both=False)), ())
    speed = min(rules.speed, STRIDE * standoff / robot.period)
    out, ended = _leave(run, heading * speed, surface, reach, spread)
    back = _come_back(run, -heading * speed, out[0]) if ended != "timeout" else []
    events, creases = list[EdgeEvent](), list[Crease]()
    for number in np.flatnonzero(~np.isnan(surface.ranges)):
        hits = [_event_of(run, int(number), leg, surface) for leg in (out, back[::-1])]
        creases += [m for m in hits if isinstance(m, Crease)]
        # a sensor that only left or only returned has passed something else than this edge
        if isinstance(hits[0], EdgeEvent) and isinstance(hits[1], EdgeEvent):
            events += [hits[0], replace(hits[1], outwards=False)]
    if events:
        motion = run.end("reached", EdgeCrossed(len(events), len(events) // 2))
    elif creases:
        motion = run.end("nothing", BendsAway(crease_angle(creases)))
    elif ended == "nothing":
        motion = run.end("nothing", NoEdge(reach))
    elif ended:
        motion = run.end(ended)
    else:
        motion = run.end("lost", EdgeNotRepeated())
    return Crossing(motion, tuple(events), tuple(creases))


def _event_of(run: Steering, number: int, leg: list[HandReading], surface: Surface) -> EdgeEvent | Crease | None:
    """Return the edge or crease that one sensor passed on a leg that begins over the surface, or None."""
    if len(leg) < 2 * _BESIDE:
        return None
    sensor = run.hand.frontal[number]
    track = Track.of(leg, sensor, float(surface.ranges[number]), float(surface.slack[number]))
    gap = 2 * float(surface.spots[number]) + 0.5 * _BEYOND
    crease = crease_of(sensor, number, track, surface, gap)
    if crease is not None:
        return crease
    last = track.last_on(gap)
    if last is None or track.on[: last + 1].sum() < _BESIDE:
        return None
    return _event(sensor, number, track, surface, last)


def _surface(run: Steering, standoff: float) -> Surface:
    """Measure the surface under the frontal sensors by a few readings at rest."""
    pair = list(run.hand.frontal)
    readings = [run.sensed.ranges[pair]]
    for _ in range(_BESIDE - 1):
        run.step(np.zeros(6))
        readings.append(run.sensed.ranges[pair])
    table = np.array(readings)
    hits = (np.abs(table - standoff) < _NEAR * standoff).mean(axis=0) > _MOSTLY
    ranges = np.array([np.median(c[np.isfinite(c)]) if m else np.nan for c, m in zip(table.T, hits, strict=True)])
    model = error_model(run.hand.rig)
    every = np.full(len(model), standoff)
    every[pair] = np.where(hits, ranges, standoff)
    sds = model.law.sigma(every)[pair]
    spots = np.tan(model.beam_half_angle[pair]) * every[pair]
    return Surface(ranges, np.maximum(_DROP * standoff, 6 * sds), sds, spots)


def _dropped(surface: Surface, sensed: HandReading, pair: tuple[int, int]) -> BoolArray:
    """Return which of the two sensors miss the surface: a longer range, none, or a grazed side face."""
    ranges, states = sensed.ranges[list(pair)], sensed.states[list(pair)]
    return np.asarray(np.where(states == HIT, ranges > surface.ranges + surface.slack, states != NEAR))


def _leave(
    run: Steering, velocity: Vectors, surface: Surface, reach: float, spread: float
) -> tuple[list[HandReading], Ending | None]:
    """Move outwards until both sensors have been off the surface for more than their spots, or one for long enough.

    Returns:
        The readings, and the reason for a premature end: None, ``nothing`` beyond the reach, ``limit`` or ``timeout``.
    """
    leg, pair = [run.sensed], run.hand.frontal
    start, speed = run.sensed.T_world_hand, float(np.linalg.norm(velocity))
    known = ~np.isnan(surface.ranges)
    off = np.zeros(2)
    while True:
        if ending := run.step(translation_twist(velocity)):
            return leg, ending
        leg.append(run.sensed)
        off = np.where(_dropped(surface, run.sensed, pair) & known, off + speed * run.fraction * run.robot.period, 0.0)
        beyond = off > 2 * surface.spots + _BEYOND
        gone = float(np.linalg.norm(run.sensed.T_world_hand[:3, 3] - start[:3, 3]))
        if beyond[known].all() or (beyond.any() and off.max() > spread):
            return leg, None
        if gone > reach:
            return leg, "nothing"


def _come_back(run: Steering, velocity: Vectors, first: HandReading) -> list[HandReading]:
    """Move straight back to the start of the crossing and return the readings."""
    leg, pace = [run.sensed], velocity / np.linalg.norm(velocity)
    while True:
        left = first.T_world_hand[:3, 3] - run.sensed.T_world_hand[:3, 3]
        if float(run.sensed.T_world_hand[:3, :3] @ pace @ left) < 0 or run.step(translation_twist(velocity)):
            return leg
        leg.append(run.sensed)


def _event(sensor: int, number: int, track: Track, surface: Surface, last: int) -> EdgeEvent | None:
    """Return where one sensor passed the edge; None if it was not fully over the surface before."""
    ways, on, spot = track.ways, track.on, float(surface.spots[number])
    # Sum the steps whose reading is on the surface, from well before the spot reaches the edge. Misses before that
    # lie on another edge nearby.
    shares = np.gradient(ways)
    begin = int(np.searchsorted(ways, ways[last] - 3 * spot - _BEYOND))
    place = float(ways[begin] - 0.5 * shares[begin] + shares[begin : last + 1] @ on[begin : last + 1])
    inner = (ways < place - 1.2 * spot) & (ways > place - 3 * spot - _BEYOND)
    if not inner.any() or on[inner].mean() < _WHOLE:
        return None
    stride = float(np.median(shares[max(last - _BESIDE, 0) : last + 1]))
    near = np.flatnonzero(on[: last + 1])[-_BESIDE:]
    return EdgeEvent(
        sensor=sensor,
        T_world_hand=track.pose_at(place),
        distance=float(track.ranges[near].mean()),
        along_sd=float(surface.sds[number]) / math.sqrt(len(near)),
        across_sd=crossing_sd(stride, spot),
        outwards=True,
    )


def crossing_sd(stride: float, spot: float) -> float:
    """Return the standard deviation of an edge's position [m] for a step and a spot radius [m] (see the module)."""
    return math.sqrt(_HALF_MEAN_DIFFERENCE * stride * spot + stride**2 / 12)
