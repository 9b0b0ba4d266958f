"""Scenes with a bore or a boss for the hand: a plate on posts, something beside it or not, and a wrong idea of it.

Used by the tests of acquisition and by ``benchmarks/sense_round.py``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from felt_scenes import gripper
from tanteo.acquisition import RoundGuess
from tanteo.acquisition.ways import facing
from tanteo.features import Feature
from tanteo.hand import Workspace
from tanteo.lie import SE3, SO3
from tanteo.simulator import Scene, Solid, box

SEGMENTS = 180
OFF, TURNED, SHARE = 0.010, np.radians(5.0), 0.3
"""How wrong the idea is, at most: centre [m], axis [rad], radius as a share."""


@dataclass(frozen=True)
class RoundTask:
    """A scene, where the hand starts, the stand-off, the idea, and the truth: a frame, z along the axis, a radius."""

    scene: Scene
    T_world_hand: np.ndarray
    standoff: float
    guess: RoundGuess
    T_world_rim: np.ndarray
    radius: float
    workspace: Workspace


def turned_profile(half, rings):
    """A closed mesh about z: rings (radius or None for a square of this half width, height) from axis to axis.

    Radius 0 is a point on the axis. The first ring is the top's middle or inner rim, the last one the bottom's.
    """
    angles = np.unique(
        np.concatenate([np.arange(SEGMENTS) * 2 * np.pi / SEGMENTS, np.pi / 4 + np.arange(4) * np.pi / 2])
    )
    c, s = np.cos(angles), np.sin(angles)
    # the polygon of a circle has the circle's mean radius
    longer = 1 + (np.pi / SEGMENTS) ** 2 / 6
    out = []
    for radius, height in rings:
        r = half / np.maximum(np.abs(c), np.abs(s)) if radius is None else np.full(len(angles), radius * longer)
        out.append(np.stack([r * c, r * s, np.full(len(angles), height)], axis=1))
    n, m = len(angles), len(rings)
    k = np.arange(n)
    after, triangles = (k + 1) % n, []
    pairs = [(a, a + 1) for a in range(m - 1)]
    pairs += [] if rings[0][0] == 0 else [(m - 1, 0)]
    for a, b in pairs:
        if rings[a][0] != 0:
            triangles.append(np.stack([a * n + k, b * n + k, a * n + after], axis=1))
        if rings[b][0] != 0:
            triangles.append(np.stack([a * n + after, b * n + k, b * n + after], axis=1))
    return np.concatenate(out), np.concatenate(triangles)


def plate(radius, *, convex=False, half=0.07, thick=0.02, depth=None, high=0.025):
    """A square plate whose rim of a bore (through, or so deep) or of a boss (so high) is at its frame's origin."""
    if convex:
        rings = [(0, 0), (radius, 0), (radius, -high), (None, -high), (None, -high - thick), (0, -high - thick)]
    elif depth is None:
        rings = [(radius, 0), (None, 0), (None, -thick), (radius, -thick)]
    else:
        rings = [(0, -depth), (radius, -depth), (radius, 0), (None, 0), (None, -thick), (0, -thick)]
    return turned_profile(half, rings)


def solid(half=0.07, thick=0.02):
    """A plate without a bore."""
    return turned_profile(half, [(0, 0), (None, 0), (None, -thick), (0, -thick)])


def round_task(rng, *, convex=False, radius=None, standoff=None, mesh=None, beside=None, wrong=(OFF, TURNED, SHARE)):
    """A plate with a bore or a boss, somewhat tilted above a table, and an idea of it that is wrong by as much."""
    radius = radius or (rng.uniform(0.030, 0.045) if convex else rng.uniform(0.006, 0.030))
    standoff = standoff or rng.uniform(0.012, 0.030)
    T = SE3.from_parts(SO3.exp(np.array([*rng.normal(size=2) * 0.2, rng.uniform(-np.pi, np.pi)])), [0, 0, 0.15])
    vertices, triangles = plate(radius, convex=convex) if mesh is None else mesh
    solids = [box("table", [-0.6, -0.6, -0.05], [0.6, 0.6, 0.0]), Solid.at("plate", vertices, triangles, T)]
    if beside is not None:
        solids.append(box("beside", *beside, T))
    guess = RoundGuess(*_wrong(rng, T, radius, wrong), convex=convex)
    place = T[:3, 3] + 0.5 * OFF * rng.normal(size=3)
    start = facing(gripper(), place, guess.axis, np.cross(guess.axis, rng.normal(size=3)), standoff + 0.055, np.eye(4))
    return RoundTask(Scene.of(solids), _square(start), standoff, guess, T, radius, Workspace.above(0.0))


def _square(T):
    return SE3.from_parts(SO3.exp(SO3.log(T[:3, :3])), T[:3, 3])


def _wrong(rng, T, radius, wrong):
    off, turned, share = wrong
    shift, axis = rng.normal(size=3), np.cross(T[:3, 2], rng.normal(size=3))
    shift *= rng.uniform(0, off) / np.linalg.norm(shift)
    R = SO3.exp(rng.uniform(0, turned) * axis / np.linalg.norm(axis))
    return T[:3, 3] + shift, R @ T[:3, 2], radius * (1 + rng.uniform(-share, share))


def round_nees(feature: Feature, T, radius):
    """Squared error of a circle or cylinder in its own covariance, its dimension, and errors of place and radius."""
    rows, C = list(feature.kind.rows), feature.full_covariance
    n = len(rows)
    local = SE3.inverse(feature.T_world_feature) @ T
    z = local[:3, 2] * np.sign(local[2, 2])
    at = local[:3, 3] - local[2, 3] / z[2] * z if feature.kind.name == "cylinder" else local[:3, 3]
    error = np.array([*at, -z[1], z[0], 0.0])[rows]
    error = np.append(error, radius - feature.radius)
    return float(error @ np.linalg.solve(C, error)), n + 1, (float(np.linalg.norm(at)), abs(error[-1]))
