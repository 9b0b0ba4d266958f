"""How near can a motion bring the fingertip points to their mesh? ``python benchmarks/fingertip_limit.py [starts]``.

No estimator is involved: thousands of random poses, each brought down by least squares, the best of them by iterated
re-weighting to the least mean distance, which is the index that is published for these sets. What is printed is what no
program can beat, up to the luck of the starts; and the same for the poses of least squared distance.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

import tanteo
from tanteo.lie import SE3, SO3
from tanteo.shapes import Surface, signed_distance

FOLDER = Path(__file__).resolve().parents[1].parent / "shared" / "data" / "fingertip_touches"
SETS = (("measCylinder_exp", "cylinder", 5.75), ("measCleaner_exp", "cleaner", 7.1))
"""Points, mesh, and the mean distance that was aimed at [mm]."""


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


def main():
    starts = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    for name, mesh, aim in SETS:
        part = tanteo.read_part(FOLDER / "models" / f"{mesh}.off", unit="m")
        start = time.perf_counter()
        least, squares = limit(
            points_of(name), Surface(part.vertices, part.triangles), starts, np.random.default_rng(1)
        )
        print(
            f"{name}: least mean distance {1e3 * least:.2f} mm, at least squares {1e3 * squares:.2f} mm, "
            f"aimed at {aim} mm ({starts} starts, {time.perf_counter() - start:.0f} s)"
        )


if __name__ == "__main__":
    main()
