"""Bores and bosses sensed without contact, over random scenes: ``python benchmarks/sense_round.py [scenes] [seed]``.

A plate has a bore (6 to 30 mm in radius, through or blind) or a boss (30 to 45 mm), tilted above a table. Stand-offs
are
12 to 30 mm, the latency is 0 to 60 ms, and the guess is up to 10 mm, 5 degrees and 30 % of the radius wrong. Each is
sensed as a circle and as a cylinder. The first table has: how often it was acquired and how the other attempts ended,
the true clearance of the hand, NEES of all and of centre, axis and radius, readings and seconds. The second table has
wrong guesses: a slot, a step, a plain face, a square pocket, another bore, a boss instead of a bore. None of them may
be
acquired as the guessed feature. ``--processes`` and ``--keep`` work as in ``campaign.py``.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import numpy as np
from scipy.stats import chi2

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign import options, run_cases
from common import Table

from bore_scenes import WRONG, round_error, round_task, whole_covariance, wrong_task
from felt_scenes import gripper
from tanteo.hand.acquisition import sense_circle, sense_cylinder
from tanteo.hand.motion import Rules
from tanteo.hand.simulator import Cell, SimulatedHand, clearances

SENSE = {"circle": sense_circle, "cylinder": sense_cylinder}
CASES = [(kind, convex) for kind in SENSE for convex in (False, True)]
GROUPS = {"circle": ((0, 1, 2), (3, 4), (5,)), "cylinder": ((0, 1), (2, 3), (4,))}
"""Rows of the covariance for the centre (cylinder: the position of the axis), the axis' direction, the radius."""
CLEARANCE = 0.6
"""Of the rules, as a share of the stand-off."""


def run_one(kind, what, seed, k):
    """Return the feature acquired in one scene, and its true error."""
    rng = np.random.default_rng((seed, len(what), sum(map(ord, what + kind)), k))
    task = round_task(rng, convex=what == "boss") if what in ("bore", "boss") else wrong_task(rng, what)
    robot = SimulatedHand(task.scene, gripper(), task.T_world_hand, rng=rng, cell=Cell(latency=rng.uniform(0, 0.06)))
    rules = Rules(clearance=CLEARANCE * task.standoff, workspace=task.workspace)
    got = SENSE[kind](robot, task.guess, standoff=task.standoff, rules=rules)
    clear = clearances(task.scene, gripper().body, np.array(robot.truth)).min()
    row = {
        "k": k, "status": got.status, "message": got.message, "standoff": task.standoff, "radius": task.radius,
        "clear": clear, "readings": 0 if got.readings is None else len(got.readings), "seconds": got.seconds,
    }  # fmt: skip
    if got.feature is not None and what in ("bore", "boss"):
        e, C = round_error(got.feature, task.T_world_rim, task.radius), whole_covariance(got.feature)
        row["nees"] = [float(e @ np.linalg.solve(C, e)), len(e)]
        parts = [list(rows) for rows in GROUPS[kind]]
        row["parts"] = [float(e[r] @ np.linalg.solve(C[np.ix_(r, r)], e[r])) / len(r) for r in parts]
        row["error"], row["sd"] = e.tolist(), np.sqrt(np.diag(C)).tolist()
    if got.feature is not None:
        row["got"] = [got.feature.radius, np.linalg.norm(got.feature.T_world_feature[:3, 3] - task.T_world_rim[:3, 3])]
    return row


def summary(kind, what, rows):
    """Return one row of the first table."""
    n, good = len(rows), [r for r in rows if r["status"] == "acquired"]
    ends = Counter(r["status"] for r in rows if r["status"] != "acquired")
    dof = good[0]["nees"][1] if good else 1
    values = np.array([r["nees"][0] for r in good])
    low, high = chi2.ppf([0.025, 0.975], dof * len(good)) / (dof * len(good)) if good else (0, 0)
    parts = np.mean([r["parts"] for r in good], axis=0) if good else np.full(3, np.nan)
    sds = 1e3 * np.median([[max(r["sd"][:2]), r["sd"][-1]] for r in good], axis=0) if good else (0, 0)
    seconds = [r["seconds"] for r in good] or [0]
    return (
        f"{what}, {kind}", str(n), f"{len(good) / n:.1%}",
        ", ".join(f"{c} {s}" for s, c in ends.most_common()) or "none",
        f"{sum(r['clear'] <= 0 for r in rows)}", f"{min(r['clear'] / r['standoff'] for r in rows):.2f}",
        f"{values.mean() / dof:.3f}" if good else "-", f"{low:.3f} to {high:.3f}",
        ", ".join(f"{p:.2f}" for p in parts), f"{sds[0]:.2f}, {sds[1]:.2f}",
        f"{np.median([r['readings'] for r in good] or [0]):.0f}", f"{np.median(seconds):.0f}",
    )  # fmt: skip


COLUMNS = (
    "feature", "scenes", "acquired", "the others", "contacts", "least clearance / stand-off", "NEES / dim",
    "95 % interval", "of centre, axis, radius", "sd of centre, radius, mm", "readings", "seconds",
)  # fmt: skip


def wrong_summary(kind, what, rows):
    """Return one row of the second table."""
    ends = Counter(r["status"] for r in rows)
    worst = [r for r in rows if r["status"] == "acquired"]
    return what, kind, str(len(rows)), str(len(worst)), ", ".join(f"{c} {s}" for s, c in ends.most_common())


def main(scenes=100, seed=1, wrong=20, keep=None, processes=1):
    right = [(kind, "boss" if convex else "bore", seed, k) for k in range(scenes) for kind, convex in CASES]
    other = [("circle", what, seed, k) for k in range(wrong) for what in WRONG]
    results = list(zip(right + other, run_cases(run_one, right + other, keep, processes), strict=True))

    def of(kind, what):
        return [row for case, row in results if case[:2] == (kind, what)]

    command = f"`python benchmarks/sense_round.py {scenes} {seed} {wrong}`"
    rows = [summary(k, w, of(k, w)) for k, c in CASES if (w := "boss" if c else "bore") and of(k, w)]
    print(Table("Bores and bosses", command, COLUMNS, rows).markdown())
    rows = [wrong_summary("circle", what, of("circle", what)) for what in WRONG]
    columns = "what is there", "guessed", "scenes", "acquired", "statuses"
    print(Table("What is not there", command, columns, rows).markdown())


if __name__ == "__main__":
    given, file, side_by_side = options(sys.argv[1:])
    main(*(int(x) for x in given), keep=file, processes=side_by_side)
