"""Answers when the stated model is wrong: ``python benchmarks/misspecification.py [scenes] [seed] [--rates]``.

A dozen readings of an example part at a random pose are sensed by touch (no directions) or by laser (with directions),
with a stated noise of 0.3 mm. Each row has another wrong statement. ``scenes`` is the number of scenes of each part and
sensor, 13 by default, which are 208 a row. ``--processes`` and ``--keep`` work as in ``campaign.py``. ``--rates``
compares other assumed outlier rates instead.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign import options, run_cases
from common import Table

import tanteo
from altered import altered
from bare_scenes import Sensing, box_centred_pose, inside, nees, off, scene, surface_points
from tanteo.factors import FreeRays
from tanteo.geometry import SE3, SO3
from tanteo.posterior import PosePrior, Priors, identify_points, prepare
from tanteo.posterior import Table as Plane

PARTS = ("block", "bracket_left", "clamp", "flange", "housing", "step_12mm", "t_slot", "wedge")
FOLDER = Path(__file__).parents[1] / "examples" / "parts"
SD, READINGS = 3e-4, 12
SENSORS = Sensing("touch", SD, False, ()), Sensing("laser", SD, True, ())
RATE = Priors().outlier_rate
RIGHT = 0.003, np.radians(5)
"""A pose this near the truth [m, rad], or within ten sigma, is the right maximum."""


@cache
def catalogue():
    """Return the prepared parts."""
    return [prepare(tanteo.read_part(FOLDER / f"{name}.step")) for name in PARTS]


def judged(answer, own, T, points=None):
    """Return the figures of an answer beside the truth."""
    row = {
        "status": answer.status, "P": 0.0, "right": False, "held": False, "unknown": answer.unknown_probability,
        "kinds": [one.kind for one in answer.findings], "worst": 0.0,
    }  # fmt: skip
    right = [_right(own, h, T) for h in answer.hypotheses]
    if answer.hypotheses:
        best = answer.hypotheses[0]
        row["P"], row["right"] = best.probability, right[0]
        row["held"] = right[0] and inside(*nees(own.part, best.T_world_part, best.covariance, T))
        if points is not None:
            prepared = next(p for p in catalogue() if p.part.name == best.part)
            local = SE3.apply(SE3.inverse(best.T_world_part), points)
            row["worst"] = float(prepared.surface.closest(local).distances.max() / (SD * best.noise_scale[0]))
    return row | {"among": any(right)}


def _right(own, h, T):
    if h.part != own.part.name:
        return False
    moved, angle = off(own.part, h.T_world_part, T)
    value, dof = nees(own.part, h.T_world_part, h.covariance, T)
    return bool((moved < RIGHT[0] and angle < RIGHT[1]) or value < 100 + dof)


def _begun(name, s, seed, k, factor=1.0, readings=READINGS):
    """Part, pose, points and the generator of one scene; the noise is so many times the stated one."""
    own, rng = catalogue()[PARTS.index(name)], np.random.default_rng((seed, PARTS.index(name), s, k))
    T, sensing = box_centred_pose(rng), replace(SENSORS[s], sd=factor * SD)
    points = scene(own, T, sensing, readings, rng)[0]
    return own, T, altered(points, covs=points.covs / factor**2), rng


def noisy(factor, name, s, seed, k):
    """Answer a scene whose noise differs from the stated noise; the part is given."""
    own, T, points, _ = _begun(name, s, seed, k, factor)
    return judged(identify_points(points, FreeRays.none(), [own]), own, T)


def absent(name, s, seed, k, rate=RATE):
    """Answer a scene whose part is not in the catalogue."""
    own, T, points, _ = _begun(name, s, seed, k)
    others = [p for p in catalogue() if p is not own]
    answer = identify_points(points, FreeRays.none(), others, priors=Priors(outlier_rate=rate))
    return judged(answer, own, T, points.points)


def mixed(name, s, seed, k):
    """Answer a scene whose part is absent in one of twenty cases, which equals the prior."""
    own, T, points, rng = _begun(name, s, seed, k)
    gone = rng.uniform() < Priors().unknown
    others = [p for p in catalogue() if p is not own or not gone]
    row = judged(identify_points(points, FreeRays.none(), others), own, T)
    row["P"] += row["unknown"] if gone else 0.0
    row["right"] = row["right"] or (gone and row["status"] == "unknown")
    return row


def outlier(name, s, seed, k, rate=RATE):
    """Answer a scene with one reading that is 5 mm off."""
    own, T, points, rng = _begun(name, s, seed, k)
    row, way = int(rng.integers(READINGS)), rng.normal(size=3)
    way = points.directions[row] * rng.choice([-1, 1]) if SENSORS[s].directed else way / np.linalg.norm(way)
    places = points.points.copy()
    places[row] += 5e-3 * way
    points, priors = altered(points, points=places), Priors(outlier_rate=rate)
    return judged(identify_points(points, FreeRays.none(), catalogue(), priors=priors), own, T)


def several(name, s, seed, k, rate=RATE):
    """Three readings of thirty are anywhere, by some centimetres."""
    own, T, points, rng = _begun(name, s, seed, k, readings=30)
    places = points.points.copy()
    places[rng.choice(30, 3, replace=False)] += rng.normal(scale=0.02, size=(3, 3))
    points, priors = altered(points, points=places), Priors(outlier_rate=rate)
    return judged(identify_points(points, FreeRays.none(), catalogue(), priors=priors), own, T)


def table(name, s, seed, k):
    """Half as many readings again are on the table on which the part lies, which is given."""
    own, T, points, rng = _begun(name, s, seed, k)
    lowest = SE3.apply(T, own.part.vertices)[:, 2].min()
    n = READINGS // 2
    rows = rng.choice(READINGS, n)
    more = points.take(np.r_[np.arange(READINGS), rows])
    places, directions = more.points.copy(), more.directions.copy()
    places[READINGS:] = np.c_[T[:2, 3] + 0.15 * rng.uniform(-1, 1, size=(n, 2)), lowest + SD * rng.normal(size=n)]
    if SENSORS[s].directed:
        directions[READINGS:] = 0, 0, -1
    more = altered(more, points=places, directions=directions, ids=tuple(map(str, range(len(more)))))
    at = PosePrior(table=Plane(np.array([0.0, 0.0, lowest]), np.array([0.0, 0.0, 1.0]), 5e-4))
    return judged(identify_points(more, FreeRays.none(), [own], priors=Priors(pose=at)), own, T)


def offset(name, s, seed, k):
    """Answer a scene without the ball's radius: all readings are its centres, 1 to 3 mm before the surface."""
    own, T, _, rng = _begun(name, 1, seed, k)
    p, n = surface_points(own, 2 * READINGS, rng)
    centres = SE3.apply(T, p + rng.uniform(1e-3, 3e-3) * n) + 3e-5 * rng.normal(size=p.shape)
    directions = -n @ T[:3, :3].T if s else None
    readings = tanteo.Readings.from_columns(points=centres, directions=directions, sds=np.full(len(p), 3e-5))
    return judged(tanteo.locate(readings, own.part), own, T)


def hand(how, name, s, seed, k):
    """Answer a scene whose poses of the hand were read in another convention; the part is given."""
    from tanteo.sensors import Rig, RigSensor

    own, T, points, rng = _begun(name, 1, seed, k)
    z = points.directions
    x = np.cross(z, rng.normal(size=z.shape))
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    R, ranges = np.stack([x, np.cross(z, x), z], axis=-1), rng.uniform(0.05, 0.2, len(z))
    Ts = SE3.from_parts(R, points.points - ranges[:, None] * z)
    rig = Rig((RigSensor("laser", np.eye(4), None, SD, 0.0, 1.0, 0.0, np.zeros((6, 6))),))
    readings = tanteo.Readings.from_columns(Ts_world_hand=HANDS[how](Ts), ranges=ranges, sensors=["laser"] * len(z))
    return judged(tanteo.locate(readings, own.part, rig=rig), own, T)


def _turned(change, Ts):
    out = Ts.copy()
    out[:, :3, :3] = change(Ts[:, :3, :3])
    return out


HANDS = {
    "x y z w read as w x y z": partial(_turned, lambda R: SO3.from_quaternion(SO3.as_quaternion(R)[..., [1, 2, 3, 0]])),
    "inverted": SE3.inverse,
    "transposed": partial(_turned, lambda R: np.swapaxes(R, -1, -2)),
}

ROWS = {
    **{f"noise {f:g} x the stated": (partial(noisy, f), "") for f in (0.5, 1.0, 2.0, 2.5)},
    "the part is in no file": (absent, ""),
    "one of twenty parts is in no file": (mixed, ""),
    "one reading 5 mm off": (outlier, ""),
    "a third of the readings on the given table": (table, ""),
    "radius omitted": (offset, "offset"),
    **{f"hand: {how}": (partial(hand, how), "hand") for how in HANDS},
}

BY_RATE = {
    f"{what}, outlier rate {rate:g}": (partial(scene_of, rate=rate), "")
    for what, scene_of in (("in no file", absent), ("one reading 5 mm off", outlier), ("three outliers of 30", several))
    for rate in (0.01, 0.003, 0.001)
}


def case(title, name, s, seed, k):
    """Return the result of one scene of one row."""
    return (ROWS | BY_RATE)[title][0](name, s, seed, k)


def summary(title, rows):
    """Return the figures of one row."""
    sure = [r for r in rows if r["status"] == "recognized"]
    wrong = [r for r in rows if r["P"] > 0.9 and not r["right"]]
    against = sum(r["worst"] > 4 for r in wrong)
    kind = (ROWS | BY_RATE)[title][1]
    return (
        title, str(len(rows)), str(len(sure)),
        f"{100 * np.mean([r['held'] for r in sure]):.1f} %" if sure else "",
        f"{np.mean([r['P'] for r in rows]):.3f}", f"{np.mean([r['right'] for r in rows]):.3f}",
        f"{100 * np.mean([r['among'] for r in rows]):.1f} %",
        f"{sum(not r['right'] for r in sure)}", f"{len(wrong)} ({against})",
        f"{sum(r['status'] == 'unknown' for r in rows)}",
        f"{np.mean([r['unknown'] for r in rows]):.3f}",
        f"{100 * np.mean([kind in r['kinds'] for r in rows]):.0f} %" if kind else "",
    )  # fmt: skip


def run(titles, scenes, seed, keep=None, processes=1):
    """Return the table."""
    cases = [(t, name, s, seed, k) for t in titles for k in range(scenes) for s in (0, 1) for name in PARTS]
    done = list(zip(cases, run_cases(case, cases, keep, processes), strict=True))
    columns = (
        "what is not as stated", "scenes", "one answer", "in its 95 % region", "claimed", "right", "truth among modes",
        "sure and wrong", "wrong above 0.9 (a reading 4 sd off)", "unknown", "P(unknown), mean", "named",
    )  # fmt: skip
    rows = [summary(t, [row for c, row in done if c[0] == t]) for t in titles]
    text = f"{READINGS} readings, {len(PARTS)} parts, touch and laser, seed {seed}."
    return Table("Wrong statements", text, columns, rows)


if __name__ == "__main__":
    rest, keep, processes = options(sys.argv[1:])
    titles = list(BY_RATE if "--rates" in rest else ROWS)
    rest = [word for word in rest if word != "--rates"]
    scenes, seed = (int(rest[i]) if len(rest) > i else default for i, default in ((0, 13), (1, 34)))
    print(run(titles, scenes, seed, keep, processes).markdown())
