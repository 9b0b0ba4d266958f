"""Logs of the 3-2-1 rule: six touches, and the seventh that the next reading names."""

from __future__ import annotations

import numpy as np

import tanteo
from tanteo.geometry import SE3, SO3
from tanteo.parts import Surface
from tanteo.planning.following import NextReading, next_reading
from tanteo.sensors import Readings, concatenate

SD = 5e-5


def six_touches(part, rng):
    """Return the pose of a part at a random yaw, and touches of the 3-2-1 rule at random places."""
    T = SE3.from_parts(SO3.exp(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)])), rng.uniform(-0.2, 0.2, 3))
    surface, (low, high) = Surface(part.vertices, part.triangles), part.box
    points, directions = [], []
    for d, count in (((0, 0, -1.0), 3), ((0, 1.0, 0), 2), ((1.0, 0, 0), 1)):
        d, found = np.array(d), 0
        while found < count:
            origin = rng.uniform(low, high) - 2 * part.diagonal * d
            distance = surface.cast(origin[None], d[None]).distances[0]
            if np.isfinite(distance):
                points.append(origin + distance * d)
                directions.append(d)
                found += 1
    p = SE3.apply(T, np.array(points)) + rng.normal(0, SD, (6, 3))
    return T, Readings.from_columns(p, directions=np.array(directions) @ T[:3, :3].T, sds=np.full(6, SD))


def made(action, part, T, rng):
    """Return the reading that results from an action."""
    surface, d = Surface(part.vertices, part.triangles), action.direction @ T[:3, :3]
    distance = surface.cast(SE3.apply(SE3.inverse(T), action.origin)[None], d[None]).distances[0]
    return action.read(distance + rng.normal(0, SD) if np.isfinite(distance) else np.inf, SD, name="seventh")


def with_the_seventh(part, rng):
    """Return the answers to six touches, and to these with the touch that the next reading names, and the true pose."""
    T, readings = six_touches(part, rng)
    first = tanteo.locate(readings, part, top=100)
    if first.status == "recognized":
        return first, first, T
    found = next_reading(first, [part], tanteo.probe_of(SD, contact=True))
    assert isinstance(found, NextReading)
    return first, tanteo.locate(concatenate([readings, made(found.action, part, T, rng)]), part), T
