"""Edges: cross one, come back from the other side, and say where each frontal sensor lost and found the surface.

A sensor sees by a cone. While its spot slides over an edge, a growing share of its readings misses the surface. Where
the edge is, is not the first reading that misses but the middle: the sum of the ways between the readings that met.
With ways ``s`` and a spot of radius ``rho`` its variance is ``s rho 128 / (45 pi^2) + s^2 / 12``: the first part is
``s`` times the integral of ``F (1 - F)`` over the crossing, ``F`` the share of a disc beyond a line.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from tanteo.hand import MET, NEAR, HandReading, Robot, shift
from tanteo.motion.following import level
from tanteo.motion.steering import Ending, Motion, Rules, Steering
from tanteo.motion.track import Crease, Surface, Track, crease_angle, crease_of
from tanteo.sensors import error_model
from tanteo.typing import BoolArray, Transforms, Vectors

STRIDE = 0.01
"""Way of the hand from reading to reading during a crossing, as a share of the stand-off."""

_HALF_MEAN_DIFFERENCE = 128 / (45 * math.pi**2)
"""Integral of F (1 - F) for a disc of radius one: half the mean difference of two points of it along an axis."""

_BESIDE = 12
"""Readings on the surface next to the event whose mean is the range there."""

_DROP = 0.15
"""A range that is longer by this share of the stand-off is off the surface."""

_BEYOND = 2e-3
"""How far beyond its spot a sensor goes before the edge counts as crossed [m]."""

_WHOLE = 0.95
"""Share of the readings before the spot that must meet the surface; less, and the spot slides along another edge."""

_NEAR = 0.3
"""A surface that is not at the stand-off within this share of it is another one."""

_MOSTLY = 0.8
"""Share of the readings at rest that must meet the surface under a sensor that is over it."""


@dataclass(frozen=True, slots=True, eq=False)
class EdgeEvent:
    """Where the axis of one sensor passed over an edge.

    Attributes:
        sensor: Its number on the rig.
        T_world_hand: The hand's pose at that instant, by the robot ``(4, 4)``.
        distance: Range to the surface at the edge [m].
        along_sd: Standard deviation of that range, apart from what the sensor's readings share [m].
        across_sd: Standard deviation of the place along the crossing [m].
        outwards: It left the surface; otherwise it came back.
    """

    sensor: int
    T_world_hand: Transforms
    distance: float
    along_sd: float
    across_sd: float
    outwards: bool


@dataclass(frozen=True, slots=True, eq=False)
class Crossing:
    """One crossing, there and back.

    Attributes:
        motion: How it ended: ``reached`` if at least one sensor crossed both ways.
        events: Of the sensors that crossed.
        creases: Of the sensors below which the surface turned away instead.
        seen: Their numbers.
    """

    motion: Motion
    events: tuple[EdgeEvent, ...]
    creases: tuple[Crease, ...] = ()

    @property
    def seen(self) -> tuple[int, ...]:
        """Sensors that crossed, each once."""
        return tuple(dict.fromkeys(e.sensor for e in self.events))


def cross_edge(
    robot: Robot, direction: Vectors, reach: float, standoff: float, rules: Rules, *, spread: float = 0.015
) -> Crossing:
    """Go straight until both frontal sensors are off the surface, or the reach is over, and come straight back.

    The hand keeps its orientation: it should have settled square to the surface before. Nothing steers by ranges here,
    the guard of the rules still does.

    Args:
        robot: The hand, over the surface.
        direction: In the hand's frame, across z, towards the edge ``(3,)``.
        reach: How far to go at most [m].
        standoff: Height over the surface [m].
        rules: What to keep to.
        spread: How far to go on after one sensor has crossed, for the other one [m].

    Returns:
        Motion ``reached`` with the events of every sensor that crossed both ways; ``nothing`` within the reach, or
        because the surface only bends; ``lost`` if neither sensor is over the surface, or not in the same way there
        and back; ``limit``; ``timeout``.
    """
    heading = level(direction)
    run = Steering("cross edge", robot, rules)
    surface = _surface(run, standoff)
    if np.isnan(surface.ranges).all():
        return Crossing(run.end("lost", "the surface is under neither frontal sensor"), ())
    speed = min(rules.speed, STRIDE * standoff / robot.period)
    out, ended = _leave(run, heading * speed, surface, reach, spread)
    back = _come_back(run, -heading * speed, out[0]) if ended != "timeout" else []
    events, creases = list[EdgeEvent](), list[Crease]()
    for number in np.flatnonzero(~np.isnan(surface.ranges)):
        met = [_met(run, int(number), leg, surface) for leg in (out, back[::-1])]
        creases += [m for m in met if isinstance(m, Crease)]
        # there and back belong together: a sensor that only left or only came has met something else
        if isinstance(met[0], EdgeEvent) and isinstance(met[1], EdgeEvent):
            events += [met[0], replace(met[1], outwards=False)]
    if events:
        motion = run.end("reached", f"{len(events)} events of {len(events) // 2} sensors")
    elif creases:
        motion = run.end("nothing", f"the surface does not end, it bends away {crease_angle(creases)}")
    elif ended == "nothing":
        motion = run.end("nothing", f"the surface does not end within {1e3 * reach:.3g} mm")
    elif ended:
        motion = run.end(ended)
    else:
        motion = run.end("lost", "the surface ended, but there and back not at one place")
    return Crossing(motion, tuple(events), tuple(creases))


def _met(run: Steering, number: int, leg: list[HandReading], surface: Surface) -> EdgeEvent | Crease | None:
    """What one sensor met on a leg that begins over the surface."""
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
    """From a few readings at rest."""
    pair = list(run.hand.frontal)
    readings = [run.sensed.ranges[pair]]
    for _ in range(_BESIDE - 1):
        run.step(np.zeros(6))
        readings.append(run.sensed.ranges[pair])
    table = np.array(readings)
    met = (np.abs(table - standoff) < _NEAR * standoff).mean(axis=0) > _MOSTLY
    ranges = np.array([np.median(c[np.isfinite(c)]) if m else np.nan for c, m in zip(table.T, met, strict=True)])
    model = error_model(run.hand.rig)
    every = np.full(len(model), standoff)
    every[pair] = np.where(met, ranges, standoff)
    sds = model.law.sigma(every)[pair]
    spots = np.tan(model.beam_half_angle[pair]) * every[pair]
    return Surface(ranges, np.maximum(_DROP * standoff, 6 * sds), sds, spots)


def _dropped(surface: Surface, sensed: HandReading, pair: tuple[int, int]) -> BoolArray:
    """Which of the two sensors look past the surface: to something farther, to nothing, or along a side face."""
    ranges, states = sensed.ranges[list(pair)], sensed.states[list(pair)]
    return np.asarray(np.where(states == MET, ranges > surface.ranges + surface.slack, states != NEAR))


def _leave(
    run: Steering, velocity: Vectors, surface: Surface, reach: float, spread: float
) -> tuple[list[HandReading], Ending | None]:
    """Outwards until both sensors have been off the surface for more than their spots, or one for long enough.

    Returns:
        The readings, and what kept them from it: the end of the reach is ``nothing``.
    """
    leg, pair = [run.sensed], run.hand.frontal
    start, speed = run.sensed.T_world_hand, float(np.linalg.norm(velocity))
    known = ~np.isnan(surface.ranges)
    off = np.zeros(2)
    while True:
        if ending := run.step(shift(velocity)):
            return leg, ending
        leg.append(run.sensed)
        off = np.where(_dropped(surface, run.sensed, pair) & known, off + speed * run.share * run.robot.period, 0.0)
        beyond = off > 2 * surface.spots + _BEYOND
        gone = float(np.linalg.norm(run.sensed.T_world_hand[:3, 3] - start[:3, 3]))
        if beyond[known].all() or (beyond.any() and off.max() > spread):
            return leg, None
        if gone > reach:
            return leg, "nothing"


def _come_back(run: Steering, velocity: Vectors, first: HandReading) -> list[HandReading]:
    """Straight back to where the crossing began."""
    leg, pace = [run.sensed], velocity / np.linalg.norm(velocity)
    while True:
        left = first.T_world_hand[:3, 3] - run.sensed.T_world_hand[:3, 3]
        if float(run.sensed.T_world_hand[:3, :3] @ pace @ left) < 0 or run.step(shift(velocity)):
            return leg
        leg.append(run.sensed)


def _event(sensor: int, number: int, track: Track, surface: Surface, last: int) -> EdgeEvent | None:
    """Where one sensor passed the edge; None if it was not wholly over the surface before."""
    ways, on, spot = track.ways, track.on, float(surface.spots[number])
    # the way over the surface: every reading that met it stands for the way around it, from well before the spot
    # comes to the edge: what is missed before that, beside another edge, says nothing of this one
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
    """Standard deviation of an edge's place [m] from a stride and the radius of the spot [m] (this module's head)."""
    return math.sqrt(_HALF_MEAN_DIFFERENCE * stride * spot + stride**2 / 12)
