"""Scenes for ``against.py``: readings whose truth is known, the same on every side.

A row is one kind of scene; :data:`ROWS` has all of them with the number of scenes that is usual. Metres and radians.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from against_points import (
    REACH,
    anywhere,
    at,
    beam_columns,
    beams,
    cast,
    contact_columns,
    exp,
    hands,
    on_surface,
    pose,
    spread,
    turn,
    unit,
)

PARTS = ("block", "bracket_left", "clamp", "flange", "housing", "step_12mm", "t_slot", "wedge")
TWELVE = tuple(sorted({*PARTS, "bracket_right", "hex_spacer", "square_post", "step_15mm"}))
MANY = ("bracket_left", "clamp", "housing", "step_12mm", "wedge", "t_slot")
THREE = ("wedge", "block", "bracket_left")
FEEDER = ("bracket_left", "bracket_right", "wedge")
DEMO = tuple(f"demo/{name}" for name in TWELVE)

CLOSE = 3e-3, np.radians(5)
"""An estimate this near the truth is right [m, rad]."""

RIG = """[sensors.beam]
sd_mm = {sd}
beam_half_angle_deg = 0
position_mm = [0, 0, 0]
quaternion_wxyz = [1, 0, 0, 0]
{more}
"""


@dataclass(frozen=True)
class Scene:
    """One problem and its true answer.

    Attributes:
        truth: key of the part that was sensed.
        T: pose of that part in the world.
        columns: columns of the readings.
        among: keys of the candidates.
        close: an estimate this near the truth is right [m, rad].
        strict: whether no other estimate is right; otherwise one within ten standard deviations is right, too.
        prior: prior pose and its covariance, part frame; for a session, of the expected place of the part.
        tip_sd: standard deviations of the tip's offset, which all readings share [m].
        rig: text of a rig file.
        session: ``given`` (all readings at once) or ``planned`` (the session chooses them); empty for no session.
        sd: noise of a session's laser [m].
        readings: largest number of readings that a session may plan.
    """

    truth: str
    T: np.ndarray
    columns: dict
    among: tuple[str, ...]
    close: tuple[float, float] = CLOSE
    strict: bool = False
    prior: tuple | None = None
    tip_sd: tuple | None = None
    rig: str = ""
    session: str = ""
    sd: float = 0.0
    readings: int = 0


def draw(row: str, number: int, seed: int, part: Callable) -> Scene:
    """Scene ``number`` of a row; ``part`` reads the part of a key."""
    make, _ = ROWS[row]
    name = "labelled" if row == "labelled_bare" else row
    return make(part, number, np.random.default_rng((seed, zlib.crc32(name.encode()), number)))


def bracket(n, normal_sd=0.0):
    """Return a maker of scenes with a bracket of 80 x 60 x 50 mm, noise 0.5 mm, with or without sensed normals."""

    def make(part, number, rng):
        T = anywhere(rng)
        p, normals = on_surface(part("bracket"), n, rng)
        more = {}
        if normal_sd:
            tilt = normal_sd * rng.normal(size=p.shape)
            tilt -= np.sum(tilt * normals, axis=1, keepdims=True) * normals
            tilted = np.array([turn(w) @ normal for w, normal in zip(tilt, normals, strict=True)])
            more = {"normals": tilted @ T[:3, :3].T, "normal_sds": np.full(n, normal_sd)}
        return Scene("bracket", T, contact_columns(p, T, 5e-4, rng, **more), ("bracket",), strict=True)

    return make


def contacts(names, n, sd, among=None, without=False, close=CLOSE):
    """Contact points on one of some parts, alone or among others, or missing from these."""

    def make(part, number, rng):
        truth, T = names[number % len(names)], anywhere(rng)
        k = n if isinstance(n, int) else int(rng.choice(n))
        columns = contact_columns(on_surface(part(truth), k, rng)[0], T, sd, rng)
        some = tuple(name for name in among or (truth,) if not (without and name == truth))
        return Scene(truth, T, columns, some, close)

    return make


def sensed(sd, counts):
    """Beams on one of eight parts, which is known."""

    def make(part, number, rng):
        truth, T, n = PARTS[number % len(PARTS)], anywhere(rng), int(rng.choice(counts))
        return Scene(truth, T, beam_columns(part(truth), T, sd, n, rng), (truth,))

    return make


def labelled(with_labels):
    """Four contact points on each of three faces, drawn by area, that fix the pose; 0.3 mm, among twelve parts."""

    def make(part, number, rng):
        truth, T = PARTS[number % len(PARTS)], anywhere(rng)
        own, triangle_face = part(truth), part(truth).triangle_face
        areas, normals = np.array([f.area * (f.surface == "plane") for f in own.faces]), np.zeros((3, 3))
        while abs(np.linalg.det(normals)) < 0.2:
            chosen = rng.choice(len(areas), 3, replace=False, p=areas / areas.sum())
            normals = np.array([own.faces[k].axis_direction for k in chosen])
        each = [on_surface(own, 4, rng, np.flatnonzero(triangle_face == k))[0] for k in chosen]
        columns = contact_columns(np.concatenate(each), T, 3e-4, rng)
        if with_labels:
            columns |= {"features": [name for name in "abc" for _ in range(4)], "kinds": ["plane"] * 12}
        return Scene(truth, T, columns, TWELVE)

    return make


def tip(names, n, sd, tip_sd, tilt):
    """Contact points of a tip whose offset in the hand is uncertain, the hand about square on."""

    def make(part, number, rng):
        truth, T, off = names[number % len(names)], anywhere(rng), tip_sd * rng.normal(size=3)
        p, normals = on_surface(part(truth), n, rng)
        z = unit(tilt * rng.normal(size=p.shape) - normals @ T[:3, :3].T)
        Ts = hands(z, at(T, p) - 0.1 * z, rng)
        columns = contact_columns(p, T, sd, rng, Ts_world_hand=Ts)
        columns["points"] = columns["points"] - Ts[:, :3, :3] @ off
        return Scene(truth, T, columns, (truth,), tip_sd=tuple(tip_sd))

    return make


def with_prior(n, sd, place, degrees, among=False):
    """Few contact points of one of three parts with a prior pose."""

    def make(part, number, rng):
        truth, C = THREE[number % len(THREE)], spread(place, degrees)
        T = exp(np.sqrt(np.diag(C)) * rng.normal(size=6))
        columns = contact_columns(on_surface(part(truth), n, rng)[0], T, sd, rng)
        return Scene(truth, T, columns, THREE if among else (truth,), prior=(np.eye(4), C))

    return make


def free_rays(part, number, rng):
    """Eight contact points and twelve free-space rays, among two parts that are mirrored and a third."""
    truth, T, n = FEEDER[number % len(FEEDER)], anywhere(rng), 20
    own = part(truth)
    columns = contact_columns(on_surface(own, n, rng)[0], T, 3e-4, rng)
    d, start = np.zeros((0, 3)), np.zeros((0, 3))
    while len(d) < 12:
        to = own.centroid + own.radius * rng.uniform() * unit(rng.normal(size=(1, 3)))
        origin = own.centroid + 0.15 * unit(rng.normal(size=(1, 3)))
        if np.isinf(cast(own, origin, unit(to - origin))[0][0]):
            d, start = np.concatenate([d, unit(to - origin)]), np.concatenate([start, origin])
    columns["points"][8:] = at(T, start)
    directions = np.concatenate([np.full((8, 3), np.nan), d @ T[:3, :3].T])
    free = np.arange(n) >= 8
    columns |= {"directions": directions, "is_free": free, "max_ranges": np.where(free, 0.3, np.nan)}
    return Scene(truth, T, columns, FEEDER)


def feeder(n):
    """Return a maker of sessions with one of three parts in a feeder; the session plans every reading of a laser."""

    def make(part, number, rng):
        truth, C, place = FEEDER[number % len(FEEDER)], spread(15e-3, 10), exp(np.array([0.4, -0.1, 0.05, 0, 0, 0.5]))
        T = place @ exp(np.sqrt(np.diag(C)) * rng.normal(size=6)) @ pose(np.eye(3), -part(truth).centroid)
        return Scene(truth, T, {}, FEEDER, prior=(place, C), session="planned", sd=3e-4, readings=n)

    return make


def at_once(part, number, rng):
    """Return a session that gets eight exact contact points at once, prior of the place 3 mm and 2 degrees."""
    C = spread(3e-3, 2)
    T = exp(np.sqrt(np.diag(C)) * rng.normal(size=6)) @ pose(np.eye(3), -part("block").centroid)
    columns = contact_columns(on_surface(part("block"), 8, rng)[0], T, 2e-5, rng)
    return Scene("block", T, columns, ("block",), prior=(np.eye(4), C), session="given", sd=2e-5)


def bar(key, side):
    """25 contact points of 0.1 mm on a round bar, anywhere or around its side only."""

    def make(part, number, rng):
        T = anywhere(rng)
        p, normals = on_surface(part(key), 750 if side else 25, rng)
        p = p[np.abs(normals[:, 2]) < 0.1][:25] if side else p
        return Scene(key, T, contact_columns(p, T, 1e-4, rng), (key,))

    return make


def sharp_normals(part, number, rng):
    """Seven points of 1 mm with normals of 5 mrad."""
    T = anywhere(rng)
    p, normals = on_surface(part("bracket_left"), 7, rng)
    tilted = np.array([turn(5e-3 * rng.normal(size=3)) @ T[:3, :3] @ normal for normal in normals])
    columns = contact_columns(p, T, 1e-3, rng, normals=tilted, normal_sds=np.full(7, 5e-3))
    return Scene("bracket_left", T, columns, ("bracket_left",))


def biased(part, number, rng):
    """Seven beams of 0.01 mm with a bias of 0.3 mm, prior pose of 5 mm and 3 degrees."""
    C = spread(5e-3, 3)
    T = exp(np.sqrt(np.diag(C)) * rng.normal(size=6))
    p, d = beams(part("bracket_left"), 7, rng, tilt=0.1)
    z, ranges = d @ T[:3, :3].T, np.full(7, 0.1) + 3e-4 * rng.normal() + 1e-5 * rng.normal(size=7)
    columns = {"ranges": ranges, "sensors": ["beam"] * 7, "Ts_world_hand": hands(z, at(T, p) - 0.1 * z, rng)}
    rig = RIG.format(sd=0.01, more="bias_sd_mm = 0.3")
    return Scene("bracket_left", T, columns, ("bracket_left",), prior=(np.eye(4), C), rig=rig)


def mounted(part, number, rng):
    """25 beams of 0.3 mm from 0.05 to 0.25 m of a sensor that is mounted to 3 mm and 0.03 rad an axis."""
    truth, T, off = MANY[number % len(MANY)], anywhere(rng), exp(np.repeat([3e-3, 0.03], 3) * rng.normal(size=6))
    ranges, Ts = [], []
    while len(ranges) < 25:
        p, d = beams(part(truth), 1, rng, 0.3)
        (hand,) = hands(d, p - rng.uniform(0.05, 0.25) * d, rng)
        really = hand @ off
        distance = cast(part(truth), really[None, :3, 3], really[None, :3, 2])[0][0] + 3e-4 * rng.normal()
        if distance < 0.3:
            ranges, Ts = [*ranges, distance], [*Ts, T @ hand]
    rig = RIG.format(sd=0.3, more=f"mount_sd_mm = 3\nmount_turn_sd_deg = {np.degrees(0.03)}")
    columns = {"ranges": np.array(ranges), "sensors": ["beam"] * 25, "Ts_world_hand": np.array(Ts)}
    return Scene(truth, T, columns, (truth,), rig=rig)


def thin_beams(part, number, rng):
    """15 beams without width, 3 mm along them."""
    truth, T = MANY[number % len(MANY)], anywhere(rng)
    p, d = beams(part(truth), 15, rng)
    d, off = d @ T[:3, :3].T, 3e-3 * rng.normal(size=15)
    columns = {"points": at(T, p) + off[:, None] * d, "directions": d, "ranges": REACH + off}
    return Scene(truth, T, columns | {"sds": np.full(15, 3e-3), "across_sds": np.full(15, 3e-5)}, (truth,))


ROWS = {
    "bracket_30": (bracket(30), 200),
    "bracket_10": (bracket(10), 200),
    "bracket_10_normals": (bracket(10, np.radians(3)), 200),
    "parts12_known": (contacts(DEMO, 12, 3e-4, DEMO), 24),
    "parts12_stranger": (contacts(DEMO, 12, 3e-4, DEMO, without=True), 24),
    "touch": (contacts(PARTS, (8, 10, 15, 25), 1e-5), 80),
    "laser": (sensed(3e-4, (8, 10, 15, 25)), 80),
    "flight": (sensed(3e-3, (15, 25, 40)), 80),
    "labelled": (labelled(True), 40),
    "labelled_bare": (labelled(False), 40),
    "tip_shared": (tip(MANY, 12, 1e-4, np.array([1e-3, 1e-3, 3e-4]), 0.3), 24),
    "prior": (with_prior(6, 3e-4, 5e-3, 5, among=True), 60),
    "far_origin": (contacts(("far",), 12, 3e-4), 40),
    "thin_sheet": (contacts(("sheet",), 12, 1e-4, close=(7e-4, np.radians(5))), 40),
    "free_rays": (free_rays, 40),
    "twins": (contacts(("bracket_left",), 12, 3e-4, FEEDER[:2]), 40),
    "session": (feeder(12), 12),
    "hard_bar_side": (bar("bar_60", True), 20),
    "hard_bar_long": (bar("bar_200", False), 20),
    "hard_normals": (sharp_normals, 20),
    "hard_tip": (tip(("bracket_left",), 25, 5e-5, np.full(3, 3e-3), 0.0), 20),
    "hard_at_once": (at_once, 20),
    "hard_prior_3": (with_prior(3, 1e-4, 3e-3, 2), 20),
    "hard_prior_4": (with_prior(4, 1e-4, 3e-3, 2), 20),
    "hard_prior_6": (with_prior(6, 3e-4, 5e-3, 5), 20),
    "hard_bias": (biased, 20),
    "hard_mount": (mounted, 20),
    "hard_walls": (contacts(("housing",), 8, 1e-5), 20),
    "hard_thin_beams": (thin_beams, 20),
}
"""Row: what makes its scenes, and how many are usual."""
