"""Fingertip touches of real and simulated objects: how near the found pose brings them to the mesh, and how fast.

``python benchmarks/fingertips.py [starts]``; reads ``fingertip_touches`` of the folder of real measurements beside the
checkout. The mean distance is the index that is published for these sets. Beside it stand the pose of least squares and
the least of any pose: thousands of random poses, each brought down by least squares, the best of them by iterated
re-weighting to the least mean distance. No estimator is involved; it is what no program can beat, up to the luck of the
starts.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from common import Table

import tanteo
from bare_scenes import no_paths, touches_of
from tanteo.geometry import SE3, SO3
from tanteo.parts import signed_distance
from tanteo.posterior import identify_points, prepare

FOLDER = Path(__file__).resolve().parents[1].parent / "shared" / "data" / "fingertip_touches"
SETS = (
    ("measCylinder_exp", "cylinder", 5e-3, "5.75"), ("measCleaner_exp", "cleaner", 5e-3, "7.1"),
    ("measTetra9_sim", "tetrahedron", 1e-4, "0.01"), ("measTetra30_sim", "tetrahedron", 1e-4, "0.01"),
    ("measBox15_sim", "box", 1e-4, "0.01"), ("measBox100_sim", "box", 1e-4, "0.01"),
    ("measHelmet_sim", "helmet", 1e-3, "-"), ("measRobot_sim", "robot", 1e-3, "-"),
)  # fmt: skip
"""Points, mesh, what is stated as their standard deviation [m], and the mean distance aimed at [mm]."""


def points_of(name):
    lines = [line.split("#")[0].split() for line in (FOLDER / "touches" / f"{name}.off").read_text().splitlines()]
    return np.array([line[:3] for line in lines if line][2:], dtype=float)


def descend(surface, points, Ts, steps, floor=None):
    """Gauss-Newton on squared distances, or on absolute ones rounded off below ``floor`` [m]; the best poses seen."""
    best, best_Ts = np.full(len(Ts), np.inf), Ts
    for _ in range(steps):
        p = (points - Ts[:, None, :3, 3]) @ Ts[:, :3, :3]
        r, g = signed_distance(surface, p)
        value = np.mean(r * r, axis=1) if floor is None else np.abs(r).mean(axis=1)
        best_Ts = np.where((value < best)[:, None, None], Ts, best_Ts)
        best = np.minimum(best, value)
        w = np.ones_like(r) if floor is None else 1 / np.maximum(np.abs(r), floor)
        J = -np.concatenate([g, np.cross(p, g)], axis=-1)
        A = np.einsum("sni,sn,snj->sij", J, w, J)
        b = -np.einsum("sni,sn,sn->si", J, w, r)
        d = np.einsum("sii->si", A)
        A += 1e-3 * d[:, None] * np.eye(6) + 1e-9 * d.max(axis=1)[:, None, None] * np.eye(6)
        step = np.linalg.solve(A, b[..., None])[..., 0]
        step *= np.minimum(1.0, 0.3 / np.maximum(np.linalg.norm(step[:, 3:], axis=1), 1e-12))[:, None]
        Ts = Ts @ SE3.exp(step)
    return best, best_Ts


def limit(points, surface, starts, rng):
    """Least mean distance over all poses, and mean distance at the pose of least squares [m]."""
    q = rng.normal(size=(starts, 4))
    R = SO3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True))
    middle = surface.vertices.mean(axis=0) + 0.03 * rng.normal(size=(starts, 3))
    Ts = SE3.from_parts(R, points.mean(axis=0) - SE3.apply(R, middle))
    squares, Ts = descend(surface, points, Ts, 25)
    order = np.argsort(squares)
    squares, Ts = descend(surface, points, Ts[order[:200]], 40)
    p = (points - Ts[np.argmin(squares), :3, 3]) @ Ts[np.argmin(squares), :3, :3]
    of_squares = np.abs(signed_distance(surface, p)[0]).mean()
    for floor in (3e-3, 1e-3, 3e-4, 1e-4):
        means, Ts = descend(surface, points, Ts, 25, floor)
    return float(means.min()), float(of_squares)


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
