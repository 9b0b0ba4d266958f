"""Surfaces that bend: ``python benchmarks/bends.py [scenes] [seed] [--keep FILE] [--processes N]``.

The scene is a flat top that falls away by some angle. The hand acquires a plane within 15 mm of the bend, with a random
rotation, so that the bend runs between its sensors or beside them; and it acquires the edge itself. The table has how
often each is acquired, and the ratio of its error to the stated standard deviation.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.stats import chi2

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign import options, run_cases
from common import Table

from felt_scenes import gripper, nees, roof
from tanteo.geometry import SE3, SO3
from tanteo.hand.acquisition import EdgeGuess, FaceGuess, sense_edge, sense_plane
from tanteo.hand.motion import Rules
from tanteo.hand.simulator import SimulatedHand, clearances

ANGLES = 10, 15, 20, 30, 45, 60, 75, 85
DOF = {"plane": 3, "edge": 4}


def run_one(kind, degrees, seed, k):
    """Return the result of one acquisition at a bend."""
    rng = np.random.default_rng((seed, list(DOF).index(kind), degrees, k))
    bend, standoff = np.radians(degrees), rng.uniform(0.01, 0.04)
    scene = roof(bend, flat=0.07, slope=0.07)
    x, y = rng.uniform(-0.02, 0.02), rng.uniform(-0.015, 0.015)
    tilt = SO3.exp(np.array([*(0.1 * rng.normal(size=2)), rng.uniform(0, 2 * np.pi)]))
    R = SO3.axis_rotation(0, -0.5 * bend * (kind == "plane")) @ np.diag([1.0, -1.0, -1.0]) @ tilt
    front = np.array([x, y if kind == "plane" else -0.02, standoff + 0.06])
    robot = SimulatedHand(scene, gripper(), SE3.from_parts(R, front - R @ gripper().front), rng=rng)
    rules = Rules(clearance=0.6 * standoff)
    if kind == "plane":
        guess = FaceGuess([x, y, 0.0], [0.0, np.sin(bend / 2), np.cos(bend / 2)])
        got = sense_plane(robot, guess, standoff=standoff, rules=rules)
    else:
        guess = EdgeGuess([x, 0.004, 0.0], [-1.0, 0.1, 0.0], [0.0, 0.1, 1.0])
        got = sense_edge(robot, guess, standoff=standoff, rules=rules)
    share = clearances(scene, gripper().body, np.array(robot.truth)).min() / standoff
    value = None if got.feature is None else nees(scene, got.feature)[0]
    return {"status": got.status, "message": got.message, "nees": value, "share": share}


def summary(kind, degrees, rows):
    """Return one row of the table."""
    values = np.array([r["nees"] for r in rows if r["nees"] is not None])
    false = int((values > chi2.ppf(0.999, DOF[kind])).sum())
    return (
        kind, f"{degrees} deg", str(len(rows)), str(len(values)), str(false),
        f"{np.median(values) / chi2.median(DOF[kind]):.2f}" if len(values) else "-",
        f"{min(r['share'] for r in rows):.2f}",
    )  # fmt: skip


COLUMNS = (
    "feature", "bend", "scenes", "acquired", "of them beyond 99.9 %", "median of NEES, 1 expected",
    "least clearance / stand-off",
)  # fmt: skip


def main(scenes=6, seed=1, keep=None, processes=1):
    cases = [(kind, degrees, seed, k) for kind in DOF for degrees in ANGLES for k in range(scenes)]
    results = list(zip(cases, run_cases(run_one, cases, keep, processes), strict=True))
    rows = [
        summary(kind, degrees, [row for case, row in results if case[:2] == (kind, degrees)])
        for kind in DOF
        for degrees in ANGLES
    ]
    print(Table("Surfaces that bend", f"`python benchmarks/bends.py {scenes} {seed}`", COLUMNS, rows).markdown())


if __name__ == "__main__":
    given, file, side_by_side = options(sys.argv[1:])
    main(*map(int, given), keep=file, processes=side_by_side)
