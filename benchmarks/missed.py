"""How often the true pose of few precise touches is not found: ``python benchmarks/missed.py [scenes] [KIND ...]``.

One part, known; 8 or 10 touches of 0.01 mm, 10 with one in ten anywhere, 12 beams, or 6 or 8 touches with a pose that
is known to 3 mm and 2 degrees (``near``). A scene matters if the pose that a maximization from the truth leads to has a
twentieth of the probability or more; it is missed if no mode has it, and grossly if it would be seven times as probable
as all that was found. Sure: the best mode has 0.95 or more and is another pose, and no mode of the truth has a half.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from bare_scenes import SENSORS, box_centred_pose, nees, scene
from tanteo.factors import FreeRays
from tanteo.geometry import SE3
from tanteo.parts import read_part
from tanteo.posterior import PosePrior, Priors, Problem, infer, prepare
from tanteo.posterior.part_search import start_search

PARTS = Path(__file__).parents[1] / "examples" / "parts"
NAMES = "housing", "clamp", "step_12mm", "bracket_left"
NEAR = np.repeat([3e-3, np.radians(2)], 3)
KINDS = {
    "8 touches": (8, 0.0, 0, None), "10 touches": (10, 0.0, 0, None), "10, outliers": (10, 0.1, 0, None),
    "12 beams": (12, 0.02, 1, None), "near, 6 touches": (6, 0.0, 0, NEAR), "near, 8 touches": (8, 0.0, 0, NEAR),
}  # fmt: skip
"""Readings, outlier fraction, the sensor of ``bare_scenes``, and the standard deviations of a prior pose."""

MATTERS, GROSSLY = np.log(0.05), 2.0


def one(target, count, outlier, sensor, prior, number):
    """Return whether the scene counts, whether the truth was missed, grossly, a wrong pose sure, and CPU time [s]."""
    rng, radius = np.random.default_rng((77, count, number)), target.part.radius
    T = box_centred_pose(rng)
    points = scene(target, T, SENSORS[sensor], count, rng, outlier=outlier, radius=radius)[0]
    pose = None if prior is None else PosePrior(T @ SE3.exp(-prior * rng.normal(size=6)), np.diag(prior**2))
    problem = Problem(points, FreeRays.none(), Priors(pose=pose, radius=radius), typical_area=target.part.area)
    start = time.process_time()
    found = infer(problem, [target], 1, target.part.centroid, np.random.default_rng(number))
    taken = time.process_time() - start
    truth = start_search(problem, target, np.random.default_rng(0)).objective.maximize(T[None], fine=True)
    if not len(truth):
        return False, False, False, False, taken
    log_p = truth.evidence[0] + problem.log_pose_density(target) + np.log1p(-problem.priors.unknown)
    log_p -= found.log_evidence
    right = [m for m in found.modes if nees(target.part, m.T_world_part, m.covariance, T)[0] < 60]
    missed = log_p > MATTERS and not any(m.probability > 1e-4 for m in right)
    sure = bool(found.modes) and found.modes[0].probability > 0.95 and sum(m.probability for m in right) < 0.5
    return log_p > MATTERS, missed, missed and log_p > GROSSLY, sure, taken


def main(scenes=20, *kinds):
    print("| part | sensed | scenes that matter | missed | grossly | sure | ms, mean | worst |")
    print("|---|---|---|---|---|---|---|---|")
    total = np.zeros(4, dtype=int)
    for name in NAMES:
        target = prepare(read_part(PARTS / f"{name}.step"))
        for kind, settings in ((kind, KINDS[kind]) for kind in kinds or KINDS):
            rows = [one(target, *settings, number) for number in range(scenes)]
            counts, times = np.sum([row[:4] for row in rows], axis=0), 1e3 * np.array([row[4] for row in rows])
            total += counts
            cells = " | ".join(map(str, counts))
            print(f"| {name} | {kind} | {cells} | {times.mean():.0f} | {times.max():.0f} |", flush=True)
    print(f"| all | | {' | '.join(map(str, total))} | | |")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]), *sys.argv[2:])
