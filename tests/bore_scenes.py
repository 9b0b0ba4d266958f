"""Scenes with a bore or a boss for the hand: a plate on posts, something beside it or not, and a wrong idea of it.

Used by the tests of acquisition and by ``benchmarks/sense_round.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from felt_scenes import facing, gripper
from tanteo.features import Feature
from tanteo.geometry import SE3, SO3
from tanteo.hand import Workspace
from tanteo.hand.acquisition import RoundGuess
from tanteo.hand.simulator import Scene, Solid, box

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
    """Return a closed mesh about z from rings (radius, function of the angle or None for a square; height).

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
        square = half / np.maximum(np.abs(c), np.abs(s))
        r = square if radius is None else radius(angles) if callable(radius) else np.full(len(angles), radius * longer)
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
    """Return a square plate with a bore (through or of a depth) or a boss; the rim is at its frame's origin."""
    if convex:
        rings = [(0, 0), (radius, 0), (radius, -high), (None, -high), (None, -high - thick), (0, -high - thick)]
    elif depth is None:
        rings = [(radius, 0), (None, 0), (None, -thick), (radius, -thick)]
    else:
        rings = [(0, -depth), (radius, -depth), (radius, 0), (None, 0), (None, -thick), (0, -thick)]
    return turned_profile(half, rings)


def solid(half=0.07, thick=0.02):
    """Return a plate without a bore."""
    return turned_profile(half, [(0, 0), (None, 0), (None, -thick), (0, -thick)])


def slot(width, length):
    """Outline of a slot with round ends, about its middle; ``width`` and ``length`` are halves."""

    def outline(angles):
        c, s = np.abs(np.cos(angles)), np.abs(np.sin(angles))
        beside = width / np.maximum(s, 1e-12)
        x = length - width
        end = x * c + np.sqrt(np.maximum((x * c) ** 2 - x**2 + width**2, 0.0))
        return np.where(beside * c < x, beside, end)

    return outline


def polygon(inner, corners):
    """Outline of a regular pocket, ``inner`` from its middle to its sides."""
    half = np.pi / corners
    return lambda angles: inner / np.cos((angles + half) % (2 * half) - half)


WRONG = (
    "slot", "slot end", "square", "hexagon", "step", "plain",
    "larger bore", "next bore", "boss for bore", "bore for boss",
)  # fmt: skip
"""Features that may be present instead of the guessed one."""


def wrong_task(rng, what):
    """Return a scene without the guessed feature but with a similar one."""
    radius = rng.uniform(0.009, 0.022)
    exact = (0.004, np.radians(3.0), 0.1)
    if what in ("slot", "slot end"):
        task = round_task(rng, radius=radius, mesh=plate(slot(radius, radius * rng.uniform(1.5, 2.5))), wrong=exact)
        if what == "slot":
            return task
        along = radius * rng.uniform(0.5, 1.5) * task.T_world_rim[:3, 0]
        return replace(task, guess=replace(task.guess, point=task.guess.point + along))
    if what in ("square", "hexagon"):
        outline = polygon(radius, 4 if what == "square" else 6)
        return round_task(rng, radius=1.08 * radius, mesh=plate(outline), wrong=exact)
    if what == "plain":
        return round_task(rng, radius=radius, mesh=solid(), wrong=exact)
    if what == "step":
        task = round_task(rng, radius=radius, mesh=solid(half=0.06), wrong=exact)
        offset = (0.06 + rng.uniform(-0.5, 0.5) * radius) * task.T_world_rim[:3, 0]
        return replace(task, guess=replace(task.guess, point=task.guess.point + offset))
    if what == "larger bore":
        task = round_task(rng, radius=radius, wrong=exact)
        return replace(task, guess=replace(task.guess, radius=radius / rng.uniform(1.5, 2.0), radius_share=0.05))
    if what == "next bore":
        task = round_task(rng, radius=radius, wrong=(0.002, np.radians(3.0), 0.02))
        offset = rng.uniform(0.025, 0.035) * task.T_world_rim[:3, 0]
        return replace(task, guess=replace(task.guess, point=task.guess.point + offset, sd=0.003))
    boss = what == "boss for bore"
    task = round_task(rng, convex=boss, radius=rng.uniform(0.030, 0.040) if boss else radius, wrong=exact)
    return replace(task, guess=replace(task.guess, convex=not boss))


def round_task(rng, *, convex=False, radius=None, standoff=None, mesh=None, beside=None, wrong=(OFF, TURNED, SHARE)):
    """Return a plate with a bore or a boss, slightly tilted above a table, and a guess with errors."""
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


def whole_covariance(feature: Feature) -> np.ndarray:
    """Return the covariance of the frame's rows and then the radius, with shared errors ``(size + 1, size + 1)``."""
    C = np.array(feature.full_covariance)
    for k, term in enumerate(feature.shared):
        own = feature.size.shared[k] if feature.size.shared else np.zeros((1, term.jacobian.shape[1]))
        J = np.vstack([term.jacobian, own])
        C += J @ term.error.covariance @ J.T
    return C


def round_error(feature: Feature, T, radius) -> np.ndarray:
    """Return the true circle or cylinder relative to the sensed one: rows of its frame, and the radius."""
    local = SE3.inverse(feature.T_world_feature) @ T
    z = local[:3, 2] * np.sign(local[2, 2])
    at = local[:3, 3] - local[2, 3] / z[2] * z if feature.kind.name == "cylinder" else local[:3, 3]
    error = np.array([*at, -z[1], z[0], 0.0])[list(feature.kind.rows)]
    return np.append(error, radius - feature.radius)
