"""Calibration of answers from few readings with sensed normals: ``python benchmarks/few_normals.py [scenes] [seed]``.

Eight parts of the examples at random poses, 0.3 mm a reading and 0.05 rad an axis of its normal, one part in the
catalogue. ``--processes`` and ``--keep`` as in ``campaign.py``.
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
from region_coverage import FOLDER, PARTS

import tanteo
from bare_scenes import nees, no_paths, oriented
from tanteo.posterior import identify_points, prepare

COUNTS = 6, 8, 10, 15
REGION, NEAR = 12.59, 20.0
"""Squared Mahalanobis distances of six degrees of freedom: 95 %, and what counts as right."""


@cache
def prepared(name):
    """Return the prepared part."""
    return prepare(tanteo.read_part(FOLDER / f"{name}.step"))


def one(name, n, seed, k):
    """Return the result of one scene."""
    target, rng = prepared(name), np.random.default_rng((seed, PARTS.index(name), n, k))
    touches, T = oriented(target, n, rng)
    begun = time.process_time()
    answer = identify_points(touches, no_paths(), [target], top=50)
    spent = time.process_time() - begun
    off = [float(nees(target.part, h.T_world_part, h.covariance, T)[0]) for h in answer.hypotheses]
    return {
        "sure": answer.status == "recognized", "claimed": answer.hypotheses[0].probability if off else 0.0,
        "right": bool(off) and off[0] < NEAR, "among": any(v < NEAR for v in off), "off": off[0] if off else np.inf,
        "ms": 1e3 * spent,
    }  # fmt: skip


def run(scenes, seed, keep, processes):
    """Return a table of all scenes."""
    cases = [(name, n, seed, k) for k in range(scenes) for n in COUNTS for name in PARTS]
    done = list(zip(cases, run_cases(one, cases, keep, processes), strict=True))
    rows = []
    for n in COUNTS:
        some = [row for case, row in done if case[1] == n]
        get = {key: np.array([row[key] for row in some], dtype=float) for key in some[0]}
        sure = get["sure"] == 1
        good = get["off"][sure & (get["right"] == 1)]
        rows.append((
            str(n), f"{sure.sum()}/{len(some)}", f"{get['right'][sure].sum():.0f}/{sure.sum()}",
            f"{100 * np.mean(good < REGION):.0f} %", f"{good.mean() / 6:.2f}",
            f"{get['claimed'].mean():.3f} / {get['right'].mean():.3f}", f"{100 * get['among'].mean():.1f} %",
            f"{np.median(get['ms']):.0f} ms",
        ))  # fmt: skip
    columns = (
        "readings", "one answer", "right", "in the 95 % region", "NEES / dof", "claimed / right", "truth among modes",
        "median time",
    )  # fmt: skip
    text = f"{len(PARTS)} parts x {scenes} scenes, seed {seed}; 0.3 mm and 0.05 rad an axis of each normal."
    return Table("A few readings with normals", text, columns, rows)


if __name__ == "__main__":
    rest, keep, processes = options(sys.argv[1:])
    scenes, seed = (int(rest[i]) if len(rest) > i else default for i, default in ((0, 10), (1, 20261221)))
    print(run(scenes, seed, keep, processes).markdown())
