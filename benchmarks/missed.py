"""How often the true pose of few precise touches is not found: ``python benchmarks/missed.py [scenes]``.

One part, known; 8 or 10 touches of 0.01 mm, 10 with one in ten anywhere, or 12 beams. A scene matters if the pose that
a maximization from the truth leads to has a twentieth of the probability or more; it is missed if no mode has it, and
grossly if it would be seven times as probable as all that was found.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from bare_scenes import SENSORS, box_centred_pose, nees, scene
from tanteo.factors import FreeRays
from tanteo.parts import read_part
from tanteo.posterior import Priors, Problem, infer, prepare
from tanteo.posterior.part_search import start_search

PARTS = Path(__file__).parents[1] / "examples" / "parts"
NAMES = "housing", "clamp", "step_12mm", "bracket_left"
KINDS = {"8 touches": (8, 0.0, 0), "10 touches": (10, 0.0, 0), "10, outliers": (10, 0.1, 0), "12 beams": (12, 0.02, 1)}
"""Readings, outlier fraction, and the sensor of ``bare_scenes``."""

MATTERS, GROSSLY = np.log(0.05), 2.0


def one(target, count, outlier, sensor, number):
    """Return whether the scene counts, whether the search missed the truth, whether grossly, and CPU time [s]."""
    rng, radius = np.random.default_rng((77, count, number)), target.part.radius
    T = box_centred_pose(rng)
    points = scene(target, T, SENSORS[sensor], count, rng, outlier=outlier, radius=radius)[0]
    problem = Problem(points, FreeRays.none(), Priors(radius=radius))
    start = time.process_time()
    found = infer(problem, [target], 1, target.part.centroid, target.part.area, np.random.default_rng(number))
    taken = time.process_time() - start
    truth = start_search(problem, target, np.random.default_rng(0)).objective.maximize(T[None], fine=True)
    if not len(truth):
        return False, False, False, taken
    log_p = truth.evidence[0] + problem.log_pose_density(target) + np.log1p(-problem.priors.unknown)
    log_p -= found.log_evidence
    among = any(nees(target.part, m.T_world_part, m.covariance, T)[0] < 60 for m in found.modes if m.probability > 1e-4)
    missed = log_p > MATTERS and not among
    return log_p > MATTERS, missed, missed and log_p > GROSSLY, taken


def main(scenes=20):
    print("| part | sensed | scenes that matter | missed | grossly | ms, mean | worst |\n|---|---|---|---|---|---|---|")
    total = np.zeros(3, dtype=int)
    for name in NAMES:
        target = prepare(read_part(PARTS / f"{name}.step"))
        for kind, settings in KINDS.items():
            rows = [one(target, *settings, number) for number in range(scenes)]
            counts, times = np.sum([row[:3] for row in rows], axis=0), 1e3 * np.array([row[3] for row in rows])
            total += counts
            cells = " | ".join(map(str, counts))
            print(f"| {name} | {kind} | {cells} | {times.mean():.0f} | {times.max():.0f} |", flush=True)
    print(f"| all | | {' | '.join(map(str, total))} | | |")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
