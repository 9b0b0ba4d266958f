"""What the sensors read while the hand rests, as readings for the belief."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.execution.allowed import OFF
from tanteo.execution.possible import Possible
from tanteo.hand import FREE, MET, Hand, Robot, Sensed
from tanteo.lie import SE3, SO3
from tanteo.sensors import Readings, error_model
from tanteo.typing import Transforms

_SCATTER = 6.0
"""Readings that lie farther apart than so many standard deviations of their noise met a slope or more than one thing:
their mean may be of neither, so each is told then."""

_ALONE = 4
"""How many of them."""

_ALONG, _FARTHEST = 24, 0.3
"""Places along a beam at which is asked what may be there, and how far out [m]."""


def rest(robot: Robot, count: int) -> list[Sensed]:
    """Readings of a hand that stays where it is."""
    return [robot.step(np.zeros(6)) for _ in range(count)]


def as_readings(hand: Hand, log: Sequence[Sensed], name: str) -> Readings | None:
    """The readings of the sensors at rest: one of each, the mean; None if none of them says anything.

    Where those of one sensor disagree more than its noise, it looks over an edge: some of them are taken as they are.
    Readings that are too near or get no echo say nothing, nor does a beam that meets something at times only: its cone
    passes an edge, and to call it free would contradict the poses at which its axis does not.
    """
    model, rows = error_model(hand.rig), list[tuple[str, Transforms, float, float]]()
    T = log[-1].T_world_hand
    for i in range(len(hand.rig.sensors)):
        met = np.array([s.ranges[i] for s in log if s.states[i] == MET])
        free = sum(bool(s.states[i] == FREE) for s in log)
        sensor = hand.rig.sensors[i].name
        if len(met) and not free:
            sd = float(model.law.sigma(np.full(len(model), met.mean()))[i])
            if np.ptp(met) <= _SCATTER * sd:
                rows.append((sensor, T, float(met.mean()), sd / np.sqrt(len(met))))
            else:
                some = np.unique(np.linspace(0, len(met) - 1, _ALONE).round().astype(np.int64))
                rows += [(sensor, T, float(r), float("nan")) for r in met[some]]
        elif free and not len(met):
            rows.append((sensor, T, float("nan"), float("nan")))
    return _readings(rows, name) if rows else None


def of_parts(hand: Hand, readings: Readings, possible: Possible) -> Readings | None:
    """Those of the frontal sensors, and of the others those whose beams come to where a part may be; None for none.

    The others were not aimed at anything: what they meet elsewhere is something else, and that they are free there
    tells no part from another.
    """
    sensors = hand.rig.numbers(readings.sensors)
    reach = np.where(readings.is_free, error_model(hand.rig).max_range[sensors], readings.ranges)
    Ts = readings.Ts_world_hand
    along = np.linspace(0.0, 1.0, _ALONG)[:, None] * np.minimum(reach, _FARTHEST)
    points = SE3.apply(Ts, hand.origins[sensors] + along[..., None] * hand.axes[sensors])
    told = np.isin(sensors, hand.frontal) | (possible.distances(points).min(axis=0) < OFF)
    return readings.take(np.flatnonzero(told)) if told.any() else None


def _readings(rows: list[tuple[str, Transforms, float, float]], name: str) -> Readings:
    sensors, Ts, ranges, sds = zip(*rows, strict=True)
    free = np.isnan(np.array(ranges))
    return Readings.from_columns(
        ids=[f"{name}.{k + 1}" for k in range(len(rows))],
        ranges=np.array(ranges), sensors=sensors, Ts_world_hand=_rigid(np.array(Ts)), sds=np.array(sds), is_free=free,
        source="sense part",
    )  # fmt: skip


def _rigid(Ts: Transforms) -> Transforms:
    """Poses as a readings file keeps them."""
    Ts[:, :3, :3] = SO3.from_quaternion(SO3.as_quaternion(Ts[:, :3, :3]))
    return Ts
