"""Scenes for the hand: a part in a fixture, an obstacle beside it, a rough guess of a feature, and the truth.

The tests of motions and acquisition and ``benchmarks/motions.py`` use them. A scene is kept only if the task is
feasible.
At the true pose both sensors hit the face, and the hand is as far from everything as the stand-off. Table and clamp
leave
it clearance to work, and there is free space around it at the start.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

import tanteo
from tanteo.features import feature_covariance
from tanteo.geometry import SE3, SO3
from tanteo.hand import Hand, Workspace, gripper_body
from tanteo.hand.acquisition import EdgeGuess, FaceGuess, VertexGuess
from tanteo.hand.simulator import Scene, Solid, box, clearances
from tanteo.io import read_rig

FOLDER = Path(__file__).parents[1] / "examples" / "parts"
PARTS = ("block", "wedge", "bracket_left", "step_15mm", "t_slot")
STANDOFFS = 0.010, 0.040
MOST_TURNED, MOST_OFF = np.radians(60), 0.030
ABOVE = 0.040, 0.060
"""The start is this much higher than the stand-off [m], before it is turned and displaced."""

START_CLEARANCE = 0.025
"""Clearance of the hand at the start, beyond half the stand-off [m]: its fingers swing so far in a scan."""

WORKING_CLEARANCE = 0.025
"""To each side of the true place, for the hand over it [m]: table and clamp leave so much beyond the clearance."""

SHORTEST = 0.05
"""Length of the edges to acquire [m], at least."""


@dataclass(frozen=True)
class Task:
    """A scene, where the hand starts, the stand-off, an idea as wrong as the start, and the true one."""

    part: str
    scene: Scene
    T_world_hand: np.ndarray
    standoff: float
    guess: FaceGuess | EdgeGuess | VertexGuess
    truth: FaceGuess | EdgeGuess | VertexGuess
    workspace: Workspace
    turned: float
    off: float


@cache
def part_of(name):
    return tanteo.read_part(FOLDER / f"{name}.step")


@cache
def gripper():
    rig = read_rig("paper-gripper")
    return Hand(rig, gripper_body(rig))


def facing(hand, place, normal, along, height, near):
    """Return the pose of the hand square to a plane, its pair of sensors along a line, its front over a place.

    Two such poses exist, half a turn apart; it is the one that is less turned from ``near``.
    """
    across = np.cross(along, normal)
    across /= np.linalg.norm(across)
    of_plane = np.stack([np.cross(normal, across), across, normal], axis=1)
    of_hand = np.stack([hand.pair, np.cross(hand.pair, [0.0, 0.0, -1.0]), [0.0, 0.0, -1.0]], axis=1)
    R = max(
        (of_plane @ turn @ of_hand.T for turn in (np.eye(3), np.diag([-1.0, -1.0, 1.0]))),
        key=lambda R: np.trace(near[:3, :3].T @ R),
    )
    return SE3.from_parts(R, place + height * normal - R @ hand.front)


def make_task(rng, kind, name, clamp=False):
    """Draw scenes until one is feasible, optionally with a clamp beside the part that the planner has no model of."""
    while True:
        task = _try(rng, kind, name, clamp)
        if task is not None:
            return task


def _try(rng, kind, name, clamp):
    part, hand = part_of(name), gripper()
    T_world_part = _fixed(rng, part)
    scene = _scene(rng, part, T_world_part, clamp)
    standoff = rng.uniform(*STANDOFFS)
    target = {"plane": _face, "edge": _edge, "vertex": _corner}[kind](rng, part, T_world_part)
    if target is None:
        return None
    place, normal, guess = target
    if normal[2] < -0.3 or not _possible(rng, scene, hand, place, normal, standoff):
        return None
    # the start and the idea are wrong together: turned about the place, then displaced
    axis = np.cross(normal, rng.normal(size=3))
    turned, off = rng.uniform(0, MOST_TURNED), rng.uniform(0, MOST_OFF)
    shift = rng.normal(size=3)
    shift *= off / np.linalg.norm(shift)
    R = SO3.exp(turned * axis / np.linalg.norm(axis))
    wrong = SE3.from_parts(R, place - R @ place + shift)
    high = standoff + rng.uniform(*ABOVE)
    along = np.cross(normal, rng.normal(size=3))
    start = wrong @ facing(hand, place, normal, along / np.linalg.norm(along), high, np.eye(4))
    workspace = Workspace.above(0.0)
    free = START_CLEARANCE + 0.5 * standoff
    if not workspace.allows(hand.body, start, free) or clearances(scene, hand.body, start[None])[0] < free:
        return None
    return Task(name, scene, start, standoff, guess(wrong), guess(np.eye(4)), workspace, turned, off)


def _fixed(rng, part):
    """Return the part in a fixture, in any stable orientation, 20 to 150 mm above the table."""
    R = SO3.exp(rng.normal(size=3) * 2)
    lowest = (part.vertices @ R.T)[:, 2].min()
    return SE3.from_parts(R, np.array([*rng.uniform(-0.05, 0.05, 2), rng.uniform(0.02, 0.15) - lowest]))


def _scene(rng, part, T, clamp):
    """Part, table, the fixture's post below it, and a box beside it if there shall be one."""
    vertices = SE3.apply(T, part.vertices)
    centre = vertices.mean(axis=0)
    solids = [
        box("table", [-0.6, -0.6, -0.05], [0.6, 0.6, 0.0]),
        box("post", [*(centre[:2] - 0.01), 0.0], [*(centre[:2] + 0.01), vertices[:, 2].min()]),
        Solid.at("part", part.vertices, part.triangles, T),
    ]
    if not clamp:
        return Scene.of(solids)
    turn, away = rng.uniform(0, 2 * np.pi), part.radius + rng.uniform(0.06, 0.12)
    beside = centre[:2] + away * np.array([np.cos(turn), np.sin(turn)])
    half, tall = rng.uniform(0.01, 0.04, 2), rng.uniform(0.03, 0.25)
    solids.append(box("clamp", [*(beside - half), 0.0], [*(beside + half), tall]))
    return Scene.of(solids)


def _face(rng, part, T):
    k = int(rng.choice(len(part.planes), p=part.planes.areas / part.planes.areas.sum()))
    triangles = part.triangles[part.triangle_face == part.planes.faces[k]]
    place = SE3.apply(T, _on(rng, part, triangles))
    normal = T[:3, :3] @ part.planes.normals[k]
    return place, normal, lambda wrong: FaceGuess(SE3.apply(wrong, place), wrong[:3, :3] @ normal)


def _on(rng, part, triangles):
    """Return a random point on a face, uniform by area, moved towards its middle."""
    corners = part.vertices[triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    a, b = np.sort(rng.random(2))
    t = corners[rng.choice(len(corners), p=areas / areas.sum())]
    return a * t[0] + (b - a) * t[1] + (1 - b) * t[2]


def _sides(part):
    """Edges as (edge, direction, face) with the face on the left, convex, at most 100 degrees, long, face flat."""
    flat = {int(f): k for k, f in enumerate(part.planes.faces)}
    out = []
    for e in range(len(part.edges)):
        if part.edges.convex[e] and part.edges.dihedrals[e] < np.radians(100) and part.edges.lengths[e] > SHORTEST:
            left, right = part.edges.faces[e]
            out += [(e, s, flat[int(f)]) for s, f in ((1.0, left), (-1.0, right)) if int(f) in flat]
    return out


def _edge(rng, part, T):
    sides = _sides(part)
    e, sign, k = sides[rng.integers(len(sides))]
    direction = T[:3, :3] @ (sign * part.edges.directions[e])
    normal = T[:3, :3] @ part.planes.normals[k]
    slack = part.edges.lengths[e] / 2 - 0.024
    point = SE3.apply(T, part.edges.midpoints[e] + rng.uniform(-slack, slack) * part.edges.directions[e])
    inwards = np.cross(normal, direction)
    return (
        point + 0.012 * inwards,
        normal,
        lambda wrong: EdgeGuess(SE3.apply(wrong, point), wrong[:3, :3] @ direction, wrong[:3, :3] @ normal),
    )


def _corner(rng, part, T):
    sides = _sides(part)
    pairs = []
    for e, s, k in sides:
        for f, t, m in sides:
            end, begin = part.edges.ends[e][1 if s > 0 else 0], part.edges.ends[f][0 if t > 0 else 1]
            if k == m and e != f and np.linalg.norm(end - begin) < 1e-6:
                pairs.append((e, s, f, t, k, end))
    if not pairs:
        return None
    e, s, f, t, k, end = pairs[rng.integers(len(pairs))]
    arriving, leaving = T[:3, :3] @ (s * part.edges.directions[e]), T[:3, :3] @ (t * part.edges.directions[f])
    normal, point = T[:3, :3] @ part.planes.normals[k], SE3.apply(T, end)
    place = point - 0.025 * arriving + 0.025 * leaving
    return (
        place,
        normal,
        lambda w: VertexGuess(SE3.apply(w, point), w[:3, :3] @ arriving, w[:3, :3] @ leaving, w[:3, :3] @ normal),
    )


def _possible(rng, scene, hand, place, normal, standoff):
    """Return whether in some direction both sensors hit the face near the place, with clearance for the hand."""
    e = np.cross(normal, rng.normal(size=3))
    e /= np.linalg.norm(e)
    f = np.cross(normal, e)
    for turn in np.arange(6) * np.pi / 6:
        along = np.cos(turn) * e + np.sin(turn) * f
        across = np.cross(normal, along)
        feet = [place + a * along + b * across for a in (-0.026, -0.014, 0.014, 0.026) for b in (-0.008, 0.008)]
        starts = np.array(feet) + standoff * normal
        hits = scene.surface.cast(starts, -normal)
        if np.abs(hits.distances - standoff).max() > 1e-6:
            continue
        T = facing(hand, place, normal, along, standoff, np.eye(4))
        down = Workspace.above(0.0).allows(hand.body, T, 0.6 * standoff + 0.004)
        if clearances(scene, hand.body, T[None])[0] < 0.95 * standoff or not down:
            continue
        # apart from the part itself, the hand has clearance to work
        beside = Scene.of([s for s in scene.solids if s.name in ("table", "clamp")])
        shifts = WORKING_CLEARANCE * np.stack([along, -along, across, -across])
        shifted_poses = np.repeat(T[None], 4, axis=0)
        shifted_poses[:, :3, 3] += shifts
        if clearances(beside, hand.body, shifted_poses).min() > 0.6 * standoff:
            return True
    return False


def roof(bend, flat=0.06, slope=0.06, half=0.07):
    """Return a flat top at z = 0 for y < 0 that bends down by an angle [rad] above it; its edge is the x axis."""
    c, s = slope * np.cos(bend), slope * np.sin(bend)
    return _prism("roof", [(-flat, 0.0), (0.0, 0.0), (c, -s), (c, -0.1), (-flat, -0.1)], half)


def bevelled(width, flat=0.06, half=0.07):
    """Return a flat top at z = 0 for y < 0 with a bevel of 45 degrees and a given width [m] at y = 0."""
    return _prism("block", [(-flat, 0.0), (-width, 0.0), (0.0, -width), (0.0, -0.1), (-flat, -0.1)], half)


def _prism(name, section, half):
    """Return a scene of one solid: a convex section in y and z, along x."""
    n = len(section)
    vertices = np.array([[x, y, z] for x in (-half, half) for y, z in section])
    ends = [t for k in range(1, n - 1) for t in ((k + 1, k, 0), (n + k, n + k + 1, n))]
    sides = [t for a in range(n) for b in [(a + 1) % n] for t in ((b, b + n, a), (b + n, a + n, a))]
    return Scene.of([Solid.at(name, vertices, np.array(ends + sides), np.eye(4))])


def is_meant(truth, feature):
    """Return whether a feature is within 3 mm and 10 degrees of the one that the guess describes."""
    T = feature.T_world_feature
    away, cosine = truth.point - T[:3, 3], 1.0
    if feature.kind.name == "plane":
        away, cosine = (away @ T[:3, 2]) * T[:3, 2], T[:3, 2] @ truth.normal
    elif feature.kind.name == "edge":
        away, cosine = away - (away @ T[:3, 0]) * T[:3, 0], abs(T[:3, 0] @ truth.direction)
    return bool(np.linalg.norm(away) < 3e-3 and cosine > np.cos(np.radians(10)))


def nees(scene, feature):
    """Squared error of a feature against what stands there, in its own covariance; and the solid that it is on.

    The truth is the nearest plane, edge or corner of the scene, by the kind of the feature.
    """
    rows = list(feature.kind.rows)
    P = feature_covariance(feature)[np.ix_(rows, rows)]
    error, solid = {"plane": _plane_error, "edge": _edge_error, "vertex": _vertex_error}[feature.kind.name](
        scene, feature
    )
    return float(error @ np.linalg.solve(P, error)), solid, error


def _local(feature, points):
    return SE3.apply(SE3.inverse(feature.T_world_feature), points)


def _plane_error(scene, feature):
    found = scene.surface.closest(feature.support)
    t = np.bincount(found.triangles).argmax()
    n = feature.T_world_feature[:3, :3].T @ scene.surface.normals[t]
    p = _local(feature, scene.surface.vertices[scene.surface.triangles[t, 0]])
    return np.array([n @ p / n[2], -n[1] / n[2], n[0] / n[2]]), scene.solids[scene.owner[t]].name


@cache
def _scene_edges(scene):
    """Return ends of the sharp edges of all solids, and the solid of each."""
    v, t = scene.surface.vertices, scene.surface.triangles
    faces = {}
    for k, tri in enumerate(t):
        for a, b in ((0, 1), (1, 2), (2, 0)):
            key = tuple(sorted((tuple(np.round(v[tri[a]], 9)), tuple(np.round(v[tri[b]], 9)))))
            faces.setdefault(key, []).append(k)
    n = scene.surface.normals
    sharp = [(np.array(key), scene.owner[k[0]]) for key, k in faces.items() if len(k) == 2 and n[k[0]] @ n[k[1]] < 0.99]
    return np.array([s for s, _ in sharp]), [scene.solids[o].name for _, o in sharp]


def _edge_error(scene, feature):
    ends, names = _scene_edges(scene)
    local = _local(feature, ends.reshape(-1, 3)).reshape(-1, 2, 3)
    u = local[:, 1] - local[:, 0]
    u = u / np.linalg.norm(u, axis=1, keepdims=True)
    u = u * np.where(u[:, :1] < 0, -1, 1)
    x = np.where(np.abs(u[:, 0]) < 1e-9, 1e-9, u[:, 0])
    at = local[:, 0] - (local[:, 0, 0] / x)[:, None] * u
    beyond = np.maximum(0, np.maximum(local[..., 0].min(axis=1), -local[..., 0].max(axis=1)))
    k = int(np.argmin(np.linalg.norm(at[:, 1:], axis=1) + 0.05 * np.linalg.norm(u[:, 1:], axis=1) + beyond))
    return np.array([at[k, 1], at[k, 2], -u[k, 2] / x[k], u[k, 1] / x[k]]), names[k]


def _vertex_error(scene, feature):
    local = _local(feature, scene.surface.vertices)
    k = int(np.argmin(np.linalg.norm(local, axis=1)))
    used = np.flatnonzero((scene.surface.triangles == k).any(axis=1))
    return local[k], scene.solids[scene.owner[used[0]]].name
