"""Eight unlabelled contact points of the block: is the truth among the modes? ``python benchmarks/cmm_subsets.py [n]``.

Subsets that leave a motion free at the truth are counted by themselves: there poses that fit form curves and surfaces.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "real"))

import test_cmm_bare as cmm

import tanteo
from bare_scenes import no_paths
from tanteo.posterior import Priors, Problem, identify_points, prepare
from tanteo.posterior.fit_at_mode import goodness_of_fit
from tanteo.posterior.update import posterior_about


def leaves_free(touches, block, truth):
    """Return whether some motion is unconstrained at the maximum that a search from the true pose reaches."""
    problem = Problem(touches, no_paths(), Priors(radius=block.part.radius))
    mode = posterior_about(problem, block, truth[None], np.random.default_rng(0)).modes[0]
    return len(goodness_of_fit(mode).free) > 0


def main():
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    block = prepare(tanteo.read_part(cmm.FOLDER / "calibration_block_from_drawing.stl", unit="mm", name="block"))
    for placement in cmm.PLACEMENTS:
        touches, rng = cmm.bare_touches(placement), np.random.default_rng(1)
        truth = identify_points(touches, no_paths(), [block]).hypotheses[0].T_world_part
        rows, sure, seconds = [], 0, 0.0
        for _ in range(n):
            some = touches.take(np.sort(rng.choice(len(touches), 8, replace=False)))
            start = time.process_time()
            answer = identify_points(some, no_paths(), [block], top=10_000)
            seconds += time.process_time() - start
            sure += answer.status == "recognized"
            rows.append((cmm.holds(block, answer, truth), leaves_free(some, block, truth), len(answer.hypotheses)))
        contained, free, modes = np.array(rows).T
        fixed, loose = contained[free == 0], contained[free == 1]
        print(
            f"{placement}: truth among the modes in {contained.sum()}/{n} subsets; "
            f"{fixed.sum()}/{len(fixed)} of those that "
            f"fix the pose, {loose.sum()}/{len(loose)} of those that leave a motion free; {np.median(modes):.0f} modes "
            f"in the median, {sure} given as sure, {seconds / n:.2f} s each",
            flush=True,
        )


if __name__ == "__main__":
    main()
