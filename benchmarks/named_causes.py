"""Causes named where they are absent: ``python benchmarks/named_causes.py [scenes] [seed] [--kind NAME]``.

An example part at a random pose is touched 8, 12 or 20 times. Each kind has a misfit that is neither an offset nor a
scale of the world: more noise than stated, heavy tails, outliers, a bent part; the last has stock on its faces. The
table has the number of scenes whose answer is not ``recognized``, and of those in which an offset, stock by face,
offsets of groups (every third scene has a column ``group``), a scale or wrong directions are named.
"""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign import options, run_cases
from common import Table

import tanteo
from bare_scenes import beams, box_centred_pose
from tanteo.geometry import SE3
from tanteo.posterior import prepare
from tanteo.words.findings import DirectionsConvention, OffsetQuestion, ScaleQuestion

FOLDER = Path(__file__).parents[1] / "examples" / "parts"
PARTS = ("block", "bracket_left", "clamp", "housing", "wedge", "flange", "t_slot", "step_12mm")
KINDS = ("right", "noise x 4", "heavy tails", "outliers", "bent 2 mm", "stock to 3 mm")
SD = 1e-4


@cache
def target(name):
    """Return a prepared part."""
    return prepare(tanteo.read_part(FOLDER / f"{name}.step"))


def run_one(kind, seed, k):
    """Return status and named causes of one scene."""
    rng = np.random.default_rng((seed, KINDS.index(kind), k))
    part, n = target(PARTS[k % len(PARTS)]), int(rng.choice([8, 12, 20]))
    T = box_centred_pose(rng, 0.3)
    p, d = beams(part, n, rng, tilt=0.2)
    p, d = SE3.apply(T, p), d @ T[:3, :3].T
    factor = 4 if kind == "noise x 4" else 1
    noise = 2 * rng.standard_t(2, size=p.shape) if kind == "heavy tails" else factor * rng.normal(size=p.shape)
    points = p + SD * noise
    if kind == "outliers":
        rows = rng.permutation(n)[: max(2, n // 4)]
        points[rows] += rng.uniform(-0.02, 0.02, (len(rows), 1)) * d[rows]
    if kind == "bent 2 mm":
        local = p - p.mean(axis=0)
        axes = np.linalg.svd(local, full_matrices=False)[2]
        along = local @ axes[0]
        points += (2e-3 * (along / np.abs(along).max()) ** 2)[:, None] * axes[2]
    if kind == "stock to 3 mm":
        d = -normals_at(part, T, p)
        faces = np.unique(np.round(d, 1), axis=0, return_inverse=True)[1].ravel()
        points -= rng.uniform(0, 3e-3, faces.max() + 1)[faces][:, None] * d
    aimed = {"directions": d} if k % 2 or kind == "stock to 3 mm" else {}
    if k % 3 == 0:  # passes without offsets of their own
        aimed["groups"] = [f"pass {j % (2 + k % 2)}" for j in range(n)]
    readings = tanteo.Readings.from_columns(points=points, sds=np.full(n, SD), **aimed)
    answer = tanteo.locate(readings, part)
    kinds = {"offset": OffsetQuestion, "scale": ScaleQuestion, "directions": DirectionsConvention}
    named = {name: any(isinstance(one, cls) for one in answer.findings) for name, cls in kinds.items()}
    stock = any(isinstance(one, OffsetQuestion) and bool(one.faces) for one in answer.findings)
    groups = any(isinstance(one, OffsetQuestion) and bool(one.groups) for one in answer.findings)
    of_all = {"offset": named["offset"] and not stock and not groups}
    return {"status": answer.status, "stock": stock, "groups": groups} | named | of_all


def normals_at(part, T, points):
    """Return the outward normals at points on the surface in the world ``(n, 3)``."""
    found = part.surface.closest(SE3.apply(SE3.inverse(T), points))
    return part.surface.normals[found.triangles] @ T[:3, :3].T


def main():
    """Print the table."""
    rest, keep, processes = options(sys.argv[1:])
    kinds = [rest.pop(rest.index("--kind") + 1)] if "--kind" in rest else KINDS
    scenes, seed = [*map(int, (text for text in rest if text.isdecimal())), *(100, 1)[len(rest) :]][:2]
    out = []
    for kind in kinds:
        rows = run_cases(run_one, [(kind, seed, k) for k in range(scenes)], keep, processes)
        named = [str(sum(row[name] for row in rows)) for name in ("offset", "stock", "groups", "scale", "directions")]
        out.append((kind, str(sum(row["status"] != "recognized" for row in rows)), *named))
        print(*out[-1], sep="\t", flush=True)
    columns = (
        "kind",
        "not recognized",
        "offset named",
        "stock named",
        "groups named",
        "scale named",
        "directions named",
    )
    print(Table("Causes named where they are absent", f"{scenes} scenes a row, seed {seed}.", columns, out).markdown())


if __name__ == "__main__":
    main()
