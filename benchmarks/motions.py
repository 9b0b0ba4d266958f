"""Motions without contact, over random scenes: ``python benchmarks/motions.py [scenes] [kind] [seed] [clamp]``.

Five parts of the examples lie in any pose above a table, with a post below. Stand-offs are 10 to 40 mm, start and guess
are up to 60 degrees and 30 mm wrong, the latency is 0 to 60 ms. For planes, edges and corners the table has: how often
they were acquired, how the other attempts ended, the least clearance of the whole hand, the NEES of the stated
covariance, and the readings and seconds of each. ``clamp`` adds a box beside the part that the planner has no model of.
``--processes`` and ``--keep`` work as in ``campaign.py``.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
from scipy.stats import chi2

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign import options, run_cases
from common import Table

from felt_scenes import PARTS, gripper, is_meant, make_task, nees
from tanteo.hand.acquisition import sense_edge, sense_plane, sense_vertex
from tanteo.hand.motion import Rules
from tanteo.hand.simulator import Cell, SimulatedHand, clearances

SENSE = {"plane": sense_plane, "edge": sense_edge, "vertex": sense_vertex}
DOF = {"plane": 3, "edge": 4, "vertex": 3}
CLEARANCE = 0.6
"""Of the rules, as a share of the stand-off."""


def run_one(kind, seed, k, clamp=False):
    """Return the feature acquired in one scene, and its true error."""
    rng = np.random.default_rng((seed, list(SENSE).index(kind), k))
    task = make_task(rng, kind, PARTS[k % len(PARTS)], clamp)
    cell = Cell(latency=rng.uniform(0, 0.06))
    robot = SimulatedHand(task.scene, gripper(), task.T_world_hand, rng=rng, cell=cell)
    rules = Rules(clearance=CLEARANCE * task.standoff, workspace=task.workspace)
    start = time.perf_counter()
    got = SENSE[kind](robot, task.guess, standoff=task.standoff, rules=rules)
    wall = time.perf_counter() - start
    clear = clearances(task.scene, gripper().body, np.array(robot.truth)).min()
    row = {
        "k": k, "part": task.part, "status": got.status, "message": got.message, "standoff": task.standoff,
        "turned": task.turned, "off": task.off, "clear": clear, "share": clear / task.standoff,
        "readings": 0 if got.readings is None else len(got.readings), "seconds": got.seconds, "wall": wall,
        "steps": len(robot.truth),
    }  # fmt: skip
    if got.feature is not None:
        row["nees"], row["solid"], row["error"] = nees(task.scene, got.feature)
        row["meant"] = is_meant(task.truth, got.feature)
    return row


def summary(kind, rows):
    """Return one row of the table."""
    n = len(rows)
    good = [r for r in rows if r["status"] == "acquired"]
    values = np.array([r["nees"] for r in good])
    low, high = chi2.ppf([0.005, 0.995], DOF[kind] * len(good)) / (DOF[kind] * len(good)) if good else (0, 0)
    inside = (values < chi2.ppf(0.95, DOF[kind])).mean() if good else 0
    ends = Counter(r["status"] for r in rows if r["status"] != "acquired")
    half = sum(r["share"] < 0.5 for r in rows)
    seconds = np.array([r["seconds"] for r in good] or [0])
    return (
        kind, str(n), f"{len(good) / n:.1%}", ", ".join(f"{c} {s}" for s, c in ends.most_common()) or "none",
        f"{sum(r['meant'] for r in good)}",
        f"{sum(r['clear'] <= 0 for r in rows)}", f"{half}", f"{min(r['share'] for r in rows):.2f}",
        f"{values.mean() / DOF[kind]:.3f}" if good else "-", f"{low:.3f} to {high:.3f}", f"{inside:.1%}",
        f"{np.median([r['readings'] for r in good] or [0]):.0f}",
        f"{np.median(seconds):.1f} ({np.percentile(seconds, 90):.1f})",
    )  # fmt: skip


COLUMNS = (
    "feature", "scenes", "acquired", "the others", "the one that was meant",
    "contacts", "clearance below half", "least clearance / stand-off",
    "NEES / dof", "99 % interval", "in 95 % region", "readings", "seconds (90th percentile)",
)  # fmt: skip


def main(scenes=100, kind="all", seed=1, clamp="", keep=None, processes=1):
    kinds = list(SENSE) if kind == "all" else [kind]
    cases = [(name, seed, k, bool(clamp)) for k in range(scenes) for name in kinds]
    results = list(zip(cases, run_cases(run_one, cases, keep, processes), strict=True))
    rows = [summary(name, [row for case, row in results if case[0] == name]) for name in kinds]
    text = f"`python benchmarks/motions.py {scenes} {kind} {seed} {clamp}`".rstrip("` ") + "`"
    print(Table("Motions without contact", text, COLUMNS, rows).markdown())


if __name__ == "__main__":
    given, file, side_by_side = options(sys.argv[1:])
    main(*(int(x) if x.isdigit() else x for x in given), keep=file, processes=side_by_side)
