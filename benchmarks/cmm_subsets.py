"""Eight bare touches of the real block: is the truth among the modes? ``python benchmarks/cmm_subsets.py [n]``."""

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
from tanteo.surface_search import identify_touches, prepare_target


def main():
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    block = prepare_target(tanteo.read_part(cmm.FOLDER / "calibration_block_from_drawing.stl", unit="mm", name="block"))
    for placement in cmm.PLACEMENTS:
        touches, rng = cmm.bare_touches(placement), np.random.default_rng(1)
        truth = identify_touches(touches, no_paths(), [block]).hypotheses[0].T_world_part
        hits, modes, sure, start = 0, [], [], time.process_time()
        for _ in range(n):
            some = touches.take(np.sort(rng.choice(len(touches), 8, replace=False)))
            answer = identify_touches(some, no_paths(), [block], top=10_000)
            found = cmm.holds(block, answer, truth)
            hits, modes = hits + found, [*modes, len(answer.hypotheses)]
            if answer.status == "recognized":
                sure.append(found)
        print(
            f"{placement}: truth among the modes in {hits}/{n} subsets, {np.median(modes):.0f} modes on the average, "
            f"{len(sure)} given as sure, {(time.process_time() - start) / n:.2f} s each",
            flush=True,
        )


if __name__ == "__main__":
    main()
