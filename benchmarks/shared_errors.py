"""Errors that readings share: ``python benchmarks/shared_errors.py [scenes] [seed] [--kind NAME] [--default]``.

An example part at a random pose within 0.3 m of the origin is touched 20 times with known approach directions and a
noise of 0.1 mm, which is stated. Each kind adds one error that bends, shifts or drifts the readings, of the size of the
field reports. ``yes`` is located with the option that states it, ``default`` without. In the last kinds a fan of five
beams on a hand has 30 ranges of 0.3 mm from 0.2 m; ``exact`` states that its angles have no error. The table has the
share of truths inside the 95 % region of the best pose with its standard error, and the medians of the squared
Mahalanobis distance over 6 and of the largest corner sd. ``--processes`` and ``--keep`` work as in ``campaign.py``.
"""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign import options, run_cases
from common import Table

import tanteo
from bare_scenes import beams, box_centred_pose, fan_hits, inside, nees
from tanteo.geometry import SE3, SO3
from tanteo.posterior import prepare
from tanteo.sensors.error_states import (
    Backlash,
    Drift,
    Fan,
    Form,
    Lobes,
    Offset,
    OffsetByAxes,
    OffsetByGroup,
    Scale,
    Stock,
    TriggerDrift,
)

FOLDER = Path(__file__).parents[1] / "examples" / "parts"
PARTS = ("block", "bracket_left", "clamp", "housing", "wedge", "step_12mm")
SD, READINGS = 1e-4, 20


@cache
def target(name):
    """Return a prepared part."""
    return prepare(tanteo.read_part(FOLDER / f"{name}.step"))


def _groups(n):
    return [f"line {k % 4}" for k in range(n)]


def none(p, d, groups, rng):
    """Return no displacement."""
    return np.zeros_like(p)


def offset(p, d, groups, rng):
    """Return a late trigger."""
    return 3e-4 * rng.normal() * d


def offset_xy_z(p, d, groups, rng):
    """Return a trigger that is late by another amount across and along z."""
    xy, z = rng.normal(size=2) * (3e-4, 1e-4)
    return d * (xy, xy, z)


def backlash(p, d, groups, rng):
    """Return each axis off in the direction of its motion."""
    return np.sign(d) * rng.normal(size=3) * 3e-4


def lobes(p, d, groups, rng):
    """Return a pre-travel with three lobes about z."""
    late = 2e-4 * rng.normal() * np.cos(3 * np.arctan2(d[:, 1], d[:, 0]) + rng.uniform(0, 2 * np.pi))
    return late[:, None] * np.hypot(d[:, 0], d[:, 1])[:, None] * d


def line(p, d, groups, rng):
    """Return an offset of each group."""
    off = dict(zip(dict.fromkeys(groups), 3e-4 * rng.normal(size=9), strict=False))
    return np.array([off[g] for g in groups])[:, None] * d


def scale(p, d, groups, rng):
    """Return a world that is a thousandth larger."""
    return 1e-3 * p


def drift(p, d, groups, rng):
    """Return a drift of 0.3 mm over the run in a random direction."""
    way = rng.normal(size=3)
    return np.linspace(0, 3e-4, len(p))[:, None] * way / np.linalg.norm(way)


def trigger_drift(p, d, groups, rng):
    """Return a trigger that drifts by 0.3 mm."""
    return 3e-4 * rng.normal() * np.linspace(0, 1, len(p))[:, None] * d


def warp(p, d, groups, rng):
    """Return a part that is bent by 0.5 mm over its length: its ends rise along a short axis."""
    local = p - p.mean(axis=0)
    _, _, axes = np.linalg.svd(local, full_matrices=False)
    along = local @ axes[0]
    sagitta = 5e-4 * (along / np.abs(along).max()) ** 2
    return sagitta[:, None] * axes[2] * rng.choice([-1, 1])


def stock(p, d, faces, rng):
    """Return up to 3 mm of material on each face of the part."""
    return -rng.uniform(0, 3e-3, max(faces) + 1)[faces][:, None] * d


KINDS = {
    "none": (none, ()), "offset": (offset, (Offset(3e-4),)), "common": (offset, (Offset(3e-4, common=True),)),
    "offset xy, z": (offset_xy_z, (OffsetByAxes(3e-4, "xy"), OffsetByAxes(1e-4, "z"))),
    "backlash": (backlash, (Backlash(3e-4),)), "lobes": (lobes, (Lobes(1.5e-4),)),
    "group": (line, (OffsetByGroup(3e-4),)), "scale": (scale, (Scale(1e-3),)),
    "drift": (drift, (Drift(1.8e-4),)), "trigger drift": (trigger_drift, (TriggerDrift(3e-4),)),
    "warp": (warp, (Form(3e-4),)), "stock": (stock, (Stock(3e-3),)),
}  # fmt: skip
"""Displacement of the readings, and the errors that state it."""

FANS = {"no fan": 0.0, "fan": 0.3}
"""Error of a fan of five beams over 40 degrees [deg]: it is turned about a random axis, and its outer beams are off."""

BEAMS, BEAM_SD, BEAM_READINGS = np.radians([-20, -10, 0, 10, 20]), 3e-4, 30


def fan_readings(one, T, error, rng):
    """Return ranges of a fan of beams 0.2 m from a part with an error of its angles [rad], and its rig without one."""
    way = rng.normal(size=3)
    away = SO3.exp(error * way / np.linalg.norm(way))
    Ts, beams, ranges = fan_hits(one, BEAMS * (1 + error * rng.choice([-1, 1]) / BEAMS[-1]), 0.2, BEAM_READINGS, rng)
    hands = T @ Ts @ SE3.from_parts(away.T, np.zeros(3))
    figures = {"preset": None, "sd": BEAM_SD, "beam_half_angle": 0.0, "max_range": 1.0, "bias_sd": 0.0}
    rig = tanteo.sensors.Rig(tuple(
        tanteo.sensors.RigSensor(
            name=f"beam {i}", T_hand_sensor=SE3.from_parts(SO3.exp(np.array([0, angle, 0])), np.zeros(3)),
            cov_mount=np.zeros((6, 6)), unit="fan", T_hand_unit=np.eye(4), **figures,
        )
        for i, angle in enumerate(BEAMS)
    ))  # fmt: skip
    ranges, sensors = ranges + BEAM_SD * rng.normal(size=len(ranges)), [f"beam {i}" for i in beams]
    return tanteo.Readings.from_columns(Ts_world_hand=hands, ranges=ranges, sensors=sensors), rig


def fan_case(kind, seed, k, stated):
    """Return the readings, options, part and pose of one scene of a fan."""
    rng = np.random.default_rng((seed, 100, k))
    one, T = target(PARTS[k % len(PARTS)]), box_centred_pose(rng, 0.3)
    readings, rig = fan_readings(one, T, np.radians(FANS[kind]), rng)
    errors = {"yes": (Fan(np.radians(0.3)),), "exact": (Fan(1e-9),), "default": ()}[stated]
    return readings, {"rig": rig, "shared_errors": errors}, one, T


def touch_case(kind, seed, k, stated):
    """Return the readings, options, part and pose of one scene of touches."""
    rng = np.random.default_rng((seed, list(KINDS).index(kind), k))
    displaced, errors = KINDS[kind]
    one = target(PARTS[k % len(PARTS)])
    T = box_centred_pose(rng, 0.3)
    p, d = beams(one, READINGS, rng, tilt=0.02)
    faces = one.part.triangle_face[one.surface.closest(p).triangles].tolist()
    p, d, groups = SE3.apply(T, p), d @ T[:3, :3].T, _groups(READINGS)
    points = p + displaced(p, d, faces if kind == "stock" else groups, rng) + SD * rng.normal(size=p.shape)
    readings = tanteo.Readings.from_columns(points=points, directions=d, groups=groups, sds=np.full(len(p), SD))
    return readings, {"shared_errors": errors if stated == "yes" else ()}, one, T


def run_one(kind, seed, k, stated):
    """Return coverage and distance of the best pose of one scene."""
    readings, given, one, T = (fan_case if kind in FANS else touch_case)(kind, seed, k, stated)
    answer = tanteo.locate(readings, one, conventions=False, seed=k, **given)
    if not answer.hypotheses:
        return {"status": answer.status, "in": False, "d2": np.nan, "corner": np.nan}
    best = answer.hypotheses[0]
    value, dof = nees(one.part, best.T_world_part, best.covariance, T)
    return {"status": answer.status, "in": bool(inside(value, dof)), "d2": value / dof, "corner": best.corner_sd}


def main():
    """Print the table."""
    rest, keep, processes = options(sys.argv[1:])
    kinds = [rest.pop(rest.index("--kind") + 1)] if "--kind" in rest else [*KINDS, *FANS]
    numbers = [int(text) for text in rest if text.isdecimal()]
    scenes, seed = (*numbers, 100, 1)[:1] + ((numbers[1],) if len(numbers) > 1 else (1,))
    rows_out = []
    for kind in kinds:
        ways = ["yes", "default", "exact"] if kind in FANS else ["yes", "default"]
        for stated in ways[1:] if kind in ("none", "no fan") or "--default" in rest else ways:
            rows = run_cases(run_one, [(kind, seed, k, stated) for k in range(scenes)], keep, processes)
            p = np.mean([row["in"] for row in rows])
            rows_out.append((
                kind, stated, f"{np.mean([r['status'] == 'recognized' for r in rows]):.2f}",
                f"{p:.3f}", f"{np.sqrt(p * (1 - p) / len(rows)):.3f}", f"{np.nanmedian([r['d2'] for r in rows]):.2f}",
                f"{1e3 * np.nanmedian([r['corner'] for r in rows]):.2f}",
            ))  # fmt: skip
            print(*rows_out[-1], sep="\t", flush=True)
    columns = ("kind", "stated", "recognized", "covered", "+-", "d2/dof", "corner sd [mm]")
    text = f"{scenes} scenes a row, seed {seed}; 95 % regions; medians of d2/dof and corner sd."
    print(Table("Errors that readings share", text, columns, rows_out).markdown())


if __name__ == "__main__":
    main()
