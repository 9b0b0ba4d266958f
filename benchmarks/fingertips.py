"""Fingertip touches of real and simulated objects: how near the found pose brings them to the mesh, and how fast.

``python benchmarks/fingertips.py [starts]``; reads ``fingertip_touches`` of the folder of real measurements beside the
checkout. The mean distance is the index that is published for these sets. Beside it stand the pose of least squares and
the least of any pose, found without tanteo's search from so many starts (``fingertip_limit.py``).
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from common import Table
from fingertip_limit import FOLDER, limit, points_of

import tanteo
from bare_scenes import no_paths, touches_of
from tanteo.inference import identify_points, prepare
from tanteo.lie import SE3

SETS = (
    ("measCylinder_exp", "cylinder", 5e-3, "5.75"), ("measCleaner_exp", "cleaner", 5e-3, "7.1"),
    ("measTetra9_sim", "tetrahedron", 1e-4, "0.01"), ("measTetra30_sim", "tetrahedron", 1e-4, "0.01"),
    ("measBox15_sim", "box", 1e-4, "0.01"), ("measBox100_sim", "box", 1e-4, "0.01"),
    ("measHelmet_sim", "helmet", 1e-3, "-"), ("measRobot_sim", "robot", 1e-3, "-"),
)  # fmt: skip
"""Points, mesh, what is stated as their standard deviation [m], and the mean distance aimed at [mm]."""


def row(name, mesh, sd, aim, starts):
    part, points = tanteo.read_part(FOLDER / "models" / f"{mesh}.off", unit="m"), points_of(name)
    target = prepare(part)
    start = time.process_time()
    answer = identify_points(touches_of(points, sd), no_paths(), [target])
    seconds = time.process_time() - start
    found = "-"
    if answer.hypotheses:
        local = SE3.apply(SE3.inverse(answer.hypotheses[0].T_world_part), points)
        found = f"{1e3 * target.surface.closest(local).distances.mean():.3f}"
    least, squares = limit(points, target.surface, starts, np.random.default_rng(1))
    return (
        name, f"{len(points)}", f"{1e3 * sd:g}", found, aim, f"{1e3 * squares:.3f}", f"{1e3 * least:.3f}",
        answer.status, f"{seconds:.2f} s",
    )  # fmt: skip


def main():
    if not FOLDER.is_dir():
        sys.exit(f"no data at {FOLDER}")
    starts = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    rows = [row(*entry, starts) for entry in SETS]
    text = f"Mean distances in mm; processor time of one call, the part prepared; {starts} starts for the limits."
    columns = ("set", "points", "sd stated", "found", "aim", "least squares", "least of any", "status", "time")
    print(Table("Fingertips", text, columns, rows).markdown())


if __name__ == "__main__":
    main()
