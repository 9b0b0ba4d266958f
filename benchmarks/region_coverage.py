"""Coverage of the stated regions: ``python benchmarks/region_coverage.py [scenes] [seed] [outliers]``.

The scenes have eight parts of the examples, three sensors without correspondences, random poses and readings, and noise
drawn from the stated model. The table has for each sensor: how often there was one answer, how often it was right, how
often its 95 % region contained the true pose, and the claimed probability beside the rate of right answers. The same
scenes run with 10 % outliers: once all readings, once without the outliers, for an oracle that identifies them. A last
table has the effect of an error that all readings share. ``outlier_rate`` is the stated rate, 0.02 by default.
``--processes`` and ``--keep`` work as in ``campaign.py``.
"""

from __future__ import annotations

import sys
import time
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign import options, run_cases
from common import Table

import tanteo
from bare_scenes import SENSORS, box_centred_pose, inside, nees, off, scene
from tanteo.factors import FreeRays
from tanteo.posterior import Priors, identify_points, prepare

PARTS = ("block", "bracket_left", "clamp", "flange", "housing", "step_12mm", "t_slot", "wedge")
FOLDER = Path(__file__).parents[1] / "examples" / "parts"

RIGHT = 0.003, np.radians(5)
"""A pose this near the truth [m, rad], or within ten sigma, is the right maximum."""

STRAY, STATED = 0.1, Priors().outlier_rate
"""Rate of outliers, and the rate that is stated if no other is given."""

KINDS = "clean", "outliers", "oracle"
"""The scene without outliers, with outliers, and for an oracle that removes the outliers."""

BIAS = 5e-4
"""Standard deviation of the robot's base, each axis [m]."""


@cache
def _target(name):
    return prepare(tanteo.read_part(FOLDER / f"{name}.step"))


def three(name, s, seed, k, outlier_rate=STATED):
    """Return the rows of one scene of one part and one sensor: clean, with outliers, and for the oracle."""
    target, sensing = _target(name), SENSORS[s]
    part, priors = target.part, Priors(radius=target.part.radius, outlier_rate=outlier_rate)
    out, case = [], (seed, PARTS.index(name), s, k)
    for outlier in (0.0, STRAY):
        rng = np.random.default_rng(case)  # the same scene twice, except for the outliers
        n, T = int(rng.choice(sensing.counts)), box_centred_pose(rng)
        touches, rows, _ = scene(target, T, sensing, n, rng, outlier=outlier, radius=priors.radius)
        out.append(_row(part, target, touches, rows, T, sensing, priors, case, "outliers" if outlier else "clean"))
        if outlier:
            rest = touches.take(np.setdiff1d(np.arange(n), rows))
            out.append(_row(part, target, rest, rows[:0], T, sensing, priors, case, "oracle") | {"n": n})
    return out


def _row(part, target, touches, rows, T, sensing, priors, case, kind):
    start = time.process_time()
    answer = identify_points(touches, FreeRays.none(), [target], priors=priors, top=100)
    elapsed = time.process_time() - start
    row = {
        "case": case, "n": len(touches), "kind": kind, "status": answer.status, "time": elapsed,
        "P": 0.0, "right": False, "nees": np.nan, "dof": 6, "among": False, "named": 0, "far": 0, "false": 0, "p": 1.0,
        "widened": "widened" in answer.message,
    }  # fmt: skip
    right = [_right(part, h, T) for h in answer.hypotheses]
    row["among"] = any(right)
    if answer.hypotheses:
        h = answer.hypotheses[0]
        row["P"], row["right"], row["p"] = h.probability, right[0], h.p_value
        row["nees"], row["dof"] = nees(part, h.T_world_part, h.covariance, T)
        local = (touches.points[rows] - T[:3, 3]) @ T[:3, :3]
        far = target.surface.closest(local).distances > 5 * sensing.sd
        ids = [touches.ids[i] for i in rows]
        row["far"], row["named"] = int(far.sum()), sum(i in h.outliers for i, f in zip(ids, far, strict=True) if f)
        row["false"] = sum(i not in ids for i in h.outliers)
    return row


def _right(part, h, T):
    moved, angle = off(part, h.T_world_part, T)
    value, dof = nees(part, h.T_world_part, h.covariance, T)
    return (moved < RIGHT[0] and angle < RIGHT[1]) or value < 100 + dof


def summary(rows):
    """Return the figures of one sensor."""
    clean, spoiled, known = ([r for r in rows if r["kind"] == kind] for kind in KINDS)
    sure = [r for r in clean if r["status"] == "recognized"]
    covered = np.mean([inside(r["nees"], r["dof"]) for r in sure])
    claimed, true = np.mean([r["P"] for r in clean]), np.mean([r["right"] for r in clean])
    among = np.mean([r["among"] for r in clean])
    still, oracle = (np.mean([r["right"] for r in some]) for some in (spoiled, known))
    among_spoiled = np.mean([r["among"] for r in spoiled])
    found = [r for r in spoiled if r["right"]]
    named = sum(r["named"] for r in found) / max(sum(r["far"] for r in found), 1)
    sure_spoiled = [r for r in spoiled if r["status"] == "recognized"]
    inside_then = np.mean([inside(r["nees"], r["dof"]) for r in sure_spoiled])
    return (
        f"{len(sure)}/{len(clean)}", f"{100 * np.mean([r['right'] for r in sure]):.1f} %",
        f"{100 * covered:.1f} ± {100 * np.sqrt(covered * (1 - covered) / len(sure)):.1f} %",
        f"{np.mean([r['nees'] / r['dof'] for r in sure if r['right']]):.2f}",
        f"{claimed:.3f} / {true:.3f}", f"{100 * among:.1f} %",
        f"{100 * (true - still):+.1f}", f"{100 * (true - oracle):+.1f}",
        f"{np.mean([r['P'] for r in spoiled]):.3f} / {still:.3f}", f"{100 * among_spoiled:.1f} %",
        f"{100 * named:.1f} %", f"{100 * inside_then:.1f} %", f"{1e3 * np.median([r['time'] for r in clean]):.0f} ms",
    )  # fmt: skip


def by_count(sensing, rows):
    """Return the same figures in short for each number of readings."""
    out = []
    for n in sensing.counts:
        clean, spoiled, known = ([r for r in rows if r["n"] == n and r["kind"] == kind] for kind in KINDS)
        sure = [r for r in clean if r["status"] == "recognized"]
        right, still, oracle = (np.mean([r["right"] for r in some]) for some in (clean, spoiled, known))
        out.append((
            sensing.name, f"{n}", f"{len(sure)}/{len(clean)}", f"{sum(r['right'] for r in sure)}/{len(sure)}",
            f"{100 * np.mean([inside(r['nees'], r['dof']) for r in sure]):.0f} %",
            f"{np.mean([r['P'] for r in clean]):.3f} / {right:.3f}",
            f"{100 * np.mean([r['among'] for r in clean]):.1f} %",
            f"{100 * (right - still):+.1f}", f"{100 * (right - oracle):+.1f}",
            f"{np.mean([r['P'] for r in spoiled]):.3f} / {still:.3f}",
        ))  # fmt: skip
    return out


def bias_rows(count):
    """Return standard deviations in the world and for the same robot, and NEES, over the number of readings."""
    part = tanteo.read_part(FOLDER / "bracket_left.step")
    target, sensing, out = prepare(part), SENSORS[1], []
    for n in (10, 40, 160, 640):
        sds, values = [], []
        for k in range(count):
            rng = np.random.default_rng((7, n, k))
            T = box_centred_pose(rng)
            touches, _, shared = scene(target, T, sensing, n, rng, base_sd=BIAS)
            answer = identify_points(touches, FreeRays.none(), [target], shared=shared)
            if answer.status != "recognized":
                continue
            h = answer.hypotheses[0]
            same = h.covariance_relative
            sds.append((h.corner_sd, np.sqrt(np.trace(same[:3, :3])), np.sqrt(np.trace(h.covariance[:3, :3]))))
            values.append(nees(part, h.T_world_part, h.covariance, T)[0] / 6)
        world, robot, total = 1e3 * np.mean(sds, axis=0)
        out.append((str(n), f"{world:.3f} mm", f"{total:.3f} mm", f"{robot:.3f} mm", f"{np.mean(values):.2f}"))
    return out


def run(scenes, seed, outlier_rate=(), keep=None, processes=1):
    """Return all rows, by sensor."""
    cases = [(name, s, seed, k, *outlier_rate) for k in range(scenes) for s in range(len(SENSORS)) for name in PARTS]
    results = run_cases(three, cases, keep, processes)
    return [[row for case, rows in zip(cases, results, strict=True) if case[1] == s for row in rows] for s in range(3)]


def main():
    arguments, keep, processes = options(sys.argv[1:])
    scenes = int(arguments[0]) if arguments else 10
    seed = int(arguments[1]) if len(arguments) > 1 else 1991
    by_sensor = run(scenes, seed, [float(text) for text in arguments[2:]], keep, processes)
    columns = (
        "sensor", "one answer", "right", "in the 95 % region", "NEES / dof", "claimed / right", "truth among modes",
        "lost by 10 % outliers [points]", "lost by the oracle", "claimed / right with outliers",
        "truth among modes then",
        "outliers named", "region with outliers", "median time",
    )  # fmt: skip
    rows = [(sensing.name, *summary(rows)) for sensing, rows in zip(SENSORS, by_sensor, strict=True)]
    text = f"{len(PARTS)} parts x {scenes} scenes for each sensor, seed {seed}."
    print(Table("Coverage", text, columns, rows).markdown())
    print()
    columns = (
        "sensor", "readings", "one answer", "right", "in the 95 % region", "claimed / right", "truth among modes",
        "lost by 10 % outliers [points]", "lost by the oracle", "claimed / right with outliers",
    )  # fmt: skip
    rows = [row for sensing, some in zip(SENSORS, by_sensor, strict=True) for row in by_count(sensing, some)]
    print(Table("By the number of readings", "The same scenes.", columns, rows).markdown())
    print()
    columns = ("readings", "largest corner sd", "place, world", "place, same robot", "NEES / dof")
    text = f"Laser on a robot whose base is uncertain by {1e3 * BIAS:g} mm an axis, bracket_left."
    print(Table("A shared error does not average out", text, columns, bias_rows(max(5, scenes // 4))).markdown())
    sys.stdout.flush()
    wrong = [r for rows in by_sensor for r in rows if r["kind"] == "clean" and r["status"] == "recognized"]
    wrong = [r for r in wrong if not inside(r["nees"], r["dof"], 0.9999)]
    for r in wrong[:40]:
        case = (PARTS[r["case"][1]], SENSORS[r["case"][2]].name, r["case"], f"n {r['n']}")
        print("far out:", *case, f"NEES {r['nees']:.0f}, P {r['P']:.4f}, right {r['right']}, p {r['p']:.3f}")


if __name__ == "__main__":
    main()
