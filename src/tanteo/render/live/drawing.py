"""Conversion of a session at one moment to primitives: posterior, readings, next reading, hand, and real part."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray, IntArray, Transforms
from tanteo.hand import FREE, HIT, Body, Hand, HandReading
from tanteo.hand.simulator import Solid
from tanteo.hand.simulator.arm import ArmMotion
from tanteo.parts import Part
from tanteo.render.html.part_drawn import Drawn, draw_part
from tanteo.render.live import colors
from tanteo.render.live.primitives import (
    Arrow,
    Dots,
    Label,
    Lines,
    Mesh,
    Primitive,
    chain_mesh,
    dashed,
    ellipsoids,
    hand_mesh,
    joined,
    outline,
)
from tanteo.render.live.snapshot import RIVAL_LAYERS, Snapshot

_SDS = 2.0
"""Standard deviations at which ellipsoids are drawn."""

_OVERLAYS, _OVERLAY_LINES = 5, 300
"""Number of further poses of the most probable part that are drawn, and of lines of each."""

_ARM = 0.14
"""Length of a beam with unknown start, as a fraction of the part's size."""

_DASH, OPEN = 0.006, 0.12
"""Length of a dash, and drawn length of a beam that hit nothing [m]."""

LAYERS = {
    RIVAL_LAYERS[0]: "Second most probable part",
    RIVAL_LAYERS[1]: "Third most probable part",
    RIVAL_LAYERS[2]: "Fourth most probable part",
    "overlays": "Other possible poses",
    "readings": "Readings, with 2 sd",
    "wrong": "Readings that do not fit",
    "beams": "Beams",
    "free": "Beams that hit nothing",
    "features": "Features of labelled readings, with 2 sd magnified",
    "next": "Next reading",
    "hand": "Hand and its beams",
    "planner": "Readings of the planner",
}
"""Names of the layers that can be hidden."""

HIDDEN_AT_FIRST = RIVAL_LAYERS
"""Layers that are hidden at first, so that only the most probable part is visible."""


def state_primitives(now: Snapshot) -> list[Primitive]:
    """Return the parts at their possible poses as primitives.

    The most probable part is opaque, others are transparent and have other colours.

    Args:
        now: session at one moment.
    """
    out: list[Primitive] = []
    b = now.state
    for k in now.drawn_modes().tolist():
        name, layer = f"mode {k}", now.layer(k)
        rank, w, drawn = now.rank(int(b.part[k])), float(b.weights[k]), _drawn(b.target(k).part)
        colour, line = (colors.PART, colors.EDGE) if rank == 0 else (colors.RIVALS[rank - 1],) * 2
        opacity = 0.12 + 0.3 * w if layer else 1.0
        out.append(Mesh(f"{name} body", drawn.vertices, drawn.triangles, colour, opacity, b.poses[k], layer))
        out.append(Lines(f"{name} edges", drawn.lines, line, 2.0 if rank == 0 else 1.5, b.poses[k], layer))
    return [*out, *_overlays(now)]


def reading_primitives(now: Snapshot) -> list[Primitive]:
    """Return the readings as primitives: points, beams and ellipsoids of uncertainty.

    Misfits have a different colour and shape.

    Args:
        now: session at one moment.
    """
    b, out = now.state, list[Primitive]()
    if b.touches is not None and len(b.touches):
        t, wrong = b.touches, now.wrong()
        reach = np.where(t.reach > 0, t.reach, _ARM * now.size)
        starts = t.points - t.directions * reach[:, None]
        out.append(Lines("beams", np.stack([starts, t.points], axis=1), colors.BEAM, 1.5, layer="beams"))
        spread = ellipsoids(t.points, t.covs + t.shared_jacobian @ np.swapaxes(t.shared_jacobian, 1, 2), _SDS)
        out.append(Mesh("spread", *spread, colors.GOOD, 0.25, layer="readings"))
        for name, rows, colour, shape, layer in (
            ("readings that fit", ~wrong, colors.GOOD, "circle", "readings"),
            ("readings that do not fit", wrong, colors.BAD, "diamond", "wrong")
        ):  # fmt: skip
            if rows.any():
                out.append(Dots(name, t.points[rows], colour, 0.02 * now.size, shape, layer))
    if now.shapes:
        out.append(Lines("features", now.shapes.lines, colors.FEATURE, 4.0, layer="features"))
        out.append(Lines("features off", now.shapes.off, colors.FEATURE, 1.0, layer="features"))
    if len(b.free.origins):
        ends = b.free.origins + b.free.directions * np.minimum(b.free.lengths, OPEN)[:, None]
        out.append(Lines("free-space rays", dashed(b.free.origins, ends, _DASH), colors.FREE, 2.0, layer="free"))
    return out


def planner_primitives(now: Snapshot) -> list[Primitive]:
    """Return the contact points and beams of the policy's session in a contest as primitives.

    Args:
        now: session at one moment.
    """
    t = now.state.touches
    if t is None or not len(t):
        return []
    starts = t.points - t.directions * (_ARM * now.size)
    return [
        Lines("planner beams", np.stack([starts, t.points], axis=1), colors.PLANNER, 2.5, layer="planner"),
        Dots("planner readings", t.points, colors.PLANNER, 0.02 * now.size, "square", "planner"),
    ]


def next_primitives(now: Snapshot) -> list[Primitive]:
    """Return the pending action as an arrow with its name.

    Args:
        now: session at one moment.
    """
    a = now.action
    if a is None:
        return []
    end = a.origin + a.expected * a.direction
    return [
        Arrow("next", a.origin, end, colors.INK, 0.01 * now.size, "next"),
        Label("next label", f"next: {a.aim}", (a.origin + end) / 2, "next"),
    ]


def hand_primitives(hand: Hand, sensed: HandReading) -> list[Primitive]:
    """Return the hand at its reported pose, with its beams, as primitives.

    Args:
        hand: sensors and body of the hand.
        sensed: pose and ranges of the hand.
    """
    T = sensed.T_world_hand
    vertices, triangles = _hand(hand.body)
    starts, axes = SE3.apply(T, hand.origins), hand.axes @ T[:3, :3].T
    hit, free = sensed.states == HIT, sensed.states == FREE
    hits = starts[hit] + sensed.ranges[hit, None] * axes[hit]
    return [
        Mesh("hand", vertices, triangles, colors.SOFT, 0.55, T, "hand"),
        Lines("seen", np.stack([starts[hit], hits], axis=1), colors.BEAM, 2.0, layer="hand"),
        Lines(
            "not seen", dashed(starts[free], starts[free] + OPEN * axes[free], _DASH), colors.FREE, 1.5, layer="hand"
        ),
    ]


def arm_primitives(arm: ArmMotion) -> list[Primitive]:
    """Return the links of an arm at its present joint angles as primitives: spheres that enclose them, joined.

    Args:
        arm: the arm.
    """
    frames, own = arm.arm.frames(arm.q), arm.arm.carrying
    meshes = []
    for link in np.unique(arm.arm.link[own]):
        rows = own & (arm.arm.link == link)
        vertices, triangles = chain_mesh(arm.arm.centres[rows], arm.arm.radii[rows])
        meshes.append((SE3.apply(frames[link], vertices), triangles))
    return [Mesh("arm", *joined(meshes), colors.SOFT, 0.35, np.eye(4), "hand")]


def furniture_primitives(furniture: Sequence[Solid]) -> list[Primitive]:
    """Return the table and other known furniture as primitives.

    Args:
        furniture: solids, world frame.
    """
    return [
        Mesh(f"furniture {s.name}", s.vertices, s.triangles, colors.TABLE if s.name == "table" else colors.FURNITURE)
        for s in furniture
    ]


def truth_primitives(solids: Sequence[Solid]) -> list[Primitive]:
    """Return the outlines of the real parts as primitives.

    Args:
        solids: real parts, world frame.
    """
    return [Lines(f"truth {s.name}", outline(s.vertices, s.triangles), colors.INK, 3.0) for s in solids]


def _overlays(now: Snapshot) -> list[Primitive]:
    """Return outlines of the most probable mode at sampled poses, if it is more probable than all others."""
    b = now.state
    if not now.decided:
        return []
    k = int(np.argmax(b.weights))
    lines = _drawn(b.target(k).part).lines[:_OVERLAY_LINES]
    return [Lines(f"overlay {i}", lines, colors.OVERLAY, 1.0, T, "overlays") for i, T in enumerate(_poses(now, k))]


def _poses(now: Snapshot, k: int) -> Transforms:
    """Return reproducible samples of a mode ``(n, 4, 4)``."""
    b = now.state
    if b.draws is None:
        L = np.linalg.cholesky(b.covariances[k])
        return np.asarray(b.poses[k] @ SE3.exp(np.random.default_rng(1991).normal(size=(_OVERLAYS, 6)) @ L.T))
    own = np.flatnonzero((b.draws.mode == k) & (b.draws.weights > 0))
    if not len(own):
        return np.zeros((0, 4, 4))
    w = np.cumsum(b.draws.weights[own])
    rows = np.searchsorted(w, w[-1] * (np.arange(_OVERLAYS) + 0.5) / _OVERLAYS).clip(0, len(own) - 1)
    return b.draws.Ts[own[rows]]


@lru_cache(maxsize=64)
def _drawn(part: Part) -> Drawn:
    return draw_part(part, 4)


@lru_cache(maxsize=4)
def _hand(body: Body) -> tuple[FloatArray, IntArray]:
    return hand_mesh(body)
