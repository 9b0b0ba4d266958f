"""Time inner loops of several builds of the core: ``python benchmarks/bench_core.py FOLDER FOLDER ... [--rounds 8]``.

A folder holds ``native*.so``. The builds take turns, each time in a process of its own with one thread, so that a
machine that slows down slows all. Printed are medians over the rounds of the least CPU time of nine repetitions, and
their ratios to the first build.
"""

from __future__ import annotations

import argparse
import importlib.machinery
import importlib.util
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from common import Table

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

NATIVE = "tanteo._core.native"
REPETITIONS = 9
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")


class Finder:
    """Import the compiled core of another folder."""

    def __init__(self, folder: str) -> None:
        path = str(next(Path(folder).glob("native*.so")).resolve())
        loader = importlib.machinery.ExtensionFileLoader(NATIVE, path)
        self.spec = importlib.util.spec_from_file_location(NATIVE, path, loader=loader)

    def find_spec(self, name: str, path: object = None, target: object = None) -> Any:
        return self.spec if name == NATIVE else None


def tasks() -> dict[str, Callable[[], object]]:
    """Return the loops to time, by name."""
    from core.bodies import flat_bodies
    from core.questions import near_pose, point_question, random_pose, with_shared
    from core.test_rounds import fit
    from posterior.test_coarse_evaluation import evaluate, on_block, tables
    from tanteo import _core

    rng = np.random.default_rng(0)
    side = 1e-3 * np.array([40, 30, 20.0])
    catalogue, (points, _) = tables(side * rng.uniform(0.6, 1.4, (40, 3))), on_block(side, 24, 1)
    ball = rng.normal(size=(40, 12, 3))
    ball = ball / np.linalg.norm(ball, axis=2)[..., None] + 1e-3 * rng.normal(size=ball.shape)
    noise, shared = np.tile(1e-6 * np.eye(3), (40, 12, 1, 1)), np.zeros((12, 3, 0))
    T = random_pose(rng)
    p = rng.uniform(-0.03, 0.03, size=(60, 3))
    question = with_shared(point_question(p @ T[:3, :3].T + T[:3, 3], 3e-3), 2, rng)
    Ts, zs = np.stack([near_pose(T, rng, 5e-3, 0.1) for _ in range(200)]), np.zeros((200, 2))
    shape, core, blurs = flat_bodies()["bracket"].shape(), question.core(), np.array([6e-3])
    return {
        "coarse search of 40 parts": lambda: evaluate(catalogue, points),
        "120 round features": lambda: [fit(k, points=ball, covs=noise, shared_jacobian=shared) for k in (0, 1, 3)],
        "likelihood, 200 poses": lambda: _core.log_densities(shape, core, Ts, zs),
        "gradient and information, 200 poses": lambda: _core.slopes(shape, core, Ts, zs),
        "40 maximizations": lambda: _core.maximize(shape, core, Ts[:40], zs[:40], blurs, 10, 1e-3, 1e6),
    }


def least(task: Callable[[], object]) -> float:
    """Return the least CPU time of some repetitions [s]."""
    task()
    times = []
    for _ in range(REPETITIONS):
        start = time.process_time()
        task()
        times.append(time.process_time() - start)
    return min(times)


def measured(folder: str) -> dict[str, float]:
    """Return the times of one build from a process of its own [s]."""
    command = [sys.executable, __file__, folder, "--one"]
    run = subprocess.run(command, check=True, stdout=subprocess.PIPE, env=os.environ | ONE_THREAD, text=True)
    return json.loads(run.stdout)


def compare(folders: list[str], rounds: int) -> Table:
    """Return medians of the times and ratios to the first build."""
    found: list[list[dict[str, float]]] = [[measured(folder) for folder in folders] for _ in range(rounds)]
    rows = []
    for name in found[0][0]:
        times = [statistics.median(one[k][name] for one in found) for k in range(len(folders))]
        rows.append((name, *(f"{1e3 * t:.2f} ms ({t / times[0]:.3f})" for t in times)))
    return Table("Builds of the core", __doc__ or "", ("", *folders), rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0], allow_abbrev=False)
    parser.add_argument("folders", nargs="+")
    parser.add_argument("--rounds", type=int, default=8)
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        sys.meta_path.insert(0, Finder(options.folders[0]))
        print(json.dumps({name: least(task) for name, task in tasks().items()}))
    else:
        print(compare(options.folders, options.rounds).markdown())


if __name__ == "__main__":
    main()
