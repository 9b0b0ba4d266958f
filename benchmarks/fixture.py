"""Real touches of one fixture by two people: seconds, memory, what limits the pose, do the two agree.

``python benchmarks/fixture.py``; reads ``fixture_touches`` of the folder of real measurements beside the checkout.
"""

from __future__ import annotations

import resource
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from common import Table

from fixture_sets import FOLDER, SETS, disagreement, fixture, locate_sets, touches_of
from tanteo.factors import FreeRays
from tanteo.posterior import identify_points
from tanteo.posterior.answers import corner_sd


def row(name, target):
    """Figures of one set: median of seven runs on one core."""
    (touches, shared), times = touches_of(name), []
    for _ in range(7):
        start = time.process_time()
        answer = identify_points(touches, FreeRays.none(), [target], shared=shared)
        times.append(time.process_time() - start)
    best = answer.hypotheses[0]
    total, known = (corner_sd(target.part, C) for C in (best.covariance, best.covariance_relative))
    return (
        name, f"{len(touches)}", answer.status, f"{sorted(times)[3]:.2f} s", f"{best.p_value:.2f}",
        f"{1e3 * total:.2f} mm", f"{1e3 * known:.2f} mm", f"{100 * (1 - known**2 / total**2):.0f} %",
    )  # fmt: skip


def agreement(target):
    """Return how far the two poses agree, for each assumption about the tip."""
    located = locate_sets(target)
    novice = located["novice", False]
    without_tip = disagreement(target, located, False, one_draw=False)
    return [
        ("one tip in both sets", f"{disagreement(target, located, True, one_draw=True):.2g}", ""),
        ("a tip for each", f"{disagreement(target, located, True, one_draw=False):.2g}", ""),
        ("no tip error", f"{without_tip:.1g}", f"{novice.status}, p = {novice.hypotheses[0].p_value:.2g}"),
    ]


def main():
    if not FOLDER.is_dir():
        sys.exit(f"no data at {FOLDER}")
    start = time.process_time()
    target = fixture()
    prepared = time.process_time() - start
    rows = [row(name, target) for name in SETS]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    text = f"The part is prepared once, in {prepared:.2f} s. Peak memory of the whole process {peak:.0f} MB."
    columns = (
        "set", "touches", "status", "processor time", "p", "corner sd", "tip known", "variance of the tip",
    )  # fmt: skip
    print(Table("Fixture", text, columns, rows).markdown(), end="\n\n")
    text = "Probability of a larger difference of the two poses, under their joint covariance."
    print(Table("Do the two agree?", text, ("the tip", "p", "the novice alone"), agreement(target)).markdown())


if __name__ == "__main__":
    main()
