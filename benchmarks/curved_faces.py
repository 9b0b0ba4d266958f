"""Calibration of answers about parts with round faces: ``python benchmarks/curved_faces.py [scenes] [seed]``.

Two parts with bores and bosses are sensed at their exact surfaces: touches without normals, and readings with sensed
normals, two of three on round faces. Each scene runs twice: with the exact surfaces, and with the facets of the mesh
instead of them. ``--processes`` and ``--keep`` work as in ``campaign.py``.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign import options, run_cases
from common import Table
from region_coverage import FOLDER

import tanteo
from bare_scenes import box_centred_pose, inside, nees, no_paths, surface_points, touches_of
from tanteo.geometry import SE3, SO3
from tanteo.posterior import identify_points, prepare

PARTS = "flange", "hex_spacer"
WAYS = {"25 touches, 0.01 mm": (25, 1e-5, None), "12 with normals, 0.3 mm and 0.03 rad": (12, 3e-4, 0.03)}
"""Readings, their standard deviation [m], and that of each tilt of their normals [rad]."""

NEAR = 100.0
"""Squared Mahalanobis distance up to which a pose is the right one, more or less well known."""


@cache
def prepared(name):
    """Return the prepared part."""
    return prepare(tanteo.read_part(FOLDER / f"{name}.step"))


def one(name, way, seed, k):
    """Return the result of one scene, with exact surfaces and with facets."""
    target, (n, sd, tilt) = prepared(name), WAYS[way]
    rng = np.random.default_rng((seed, PARTS.index(name), n, k))
    T = box_centred_pose(rng)
    p, normals = surface_points(target, 100 * n, rng)
    on_round = target.curved.rows[target.surface.closest(p).triangles] >= 0
    rows = np.arange(n)
    if tilt is not None:
        m = 2 * n // 3
        rows = np.r_[np.flatnonzero(on_round)[:m], np.flatnonzero(~on_round)[: n - m]]
    points = SE3.apply(T, p[rows]) + sd * rng.normal(size=(n, 3))
    turned = SO3.exp((tilt or 0.0) * rng.normal(size=(n, 3))) @ (normals[rows] @ T[:3, :3].T)[..., None]
    sensed = {} if tilt is None else {"normals": turned[..., 0], "normal_sd": tilt}
    touches = touches_of(points, sd, **sensed)
    cases = ("exact", target), ("mesh", replace(target, curved=None))
    return {surface: _answer_row(touches, used, T) for surface, used in cases}


def _answer_row(touches, target, T):
    answer = identify_points(touches, no_paths(), [target], top=50)
    off = [nees(target.part, h.T_world_part, h.covariance, T) for h in answer.hypotheses]
    return {
        "status": answer.status, "off": off[0][0] if off else np.inf, "dof": off[0][1] if off else 6,
        "among": any(value < NEAR for value, _ in off),
    }  # fmt: skip


def run(scenes, seed, keep, processes):
    """Return a table of all scenes."""
    cases = [(name, way, seed, k) for k in range(scenes) for way in WAYS for name in PARTS]
    done = list(zip(cases, run_cases(one, cases, keep, processes), strict=True))
    rows = [
        (name, way, who, *_figures([row[who] for case, row in done if case[:2] == (name, way)]))
        for name in PARTS for way in WAYS for who in ("exact", "mesh")
    ]  # fmt: skip
    columns = (
        "part", "readings", "compared with", "one answer", "right", "in the 95 % region", "NEES / dof",
        "of no known part", "truth among modes",
    )  # fmt: skip
    return Table("Readings of round faces", f"{scenes} scenes of each, seed {seed}.", columns, rows)


def _figures(some):
    sure = [row for row in some if row["status"] == "recognized"]
    right = [row for row in sure if row["off"] < NEAR]
    contained = sum(inside(row["off"], row["dof"]) for row in sure)
    return (
        f"{len(sure)}/{len(some)}", f"{len(right)}/{len(sure)}", f"{100 * contained / max(len(sure), 1):.0f} %",
        f"{np.mean([row['off'] / row['dof'] for row in right]):.2f}",
        str(sum(row["status"] == "unknown" for row in some)), f"{100 * np.mean([row['among'] for row in some]):.0f} %",
    )  # fmt: skip


if __name__ == "__main__":
    rest, keep, processes = options(sys.argv[1:])
    scenes, seed = (int(rest[i]) if len(rest) > i else default for i, default in ((0, 40), (1, 20261224)))
    print(run(scenes, seed, keep, processes).markdown())
