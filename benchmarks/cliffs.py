"""Questions that once took unusually long: ``python benchmarks/cliffs.py [ROW ...] [seeds]``.

Each row is a few scenes of one kind with their median and worst processor time, preparation of the part not counted
except in rows of first calls. Organic meshes are smooth closed shapes of 16,000 triangles, drawn by spherical waves.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from common import Table

import tanteo
from tanteo.geometry import SE3, SO3
from tanteo.posterior import DEFAULTS

ROOT = Path(__file__).resolve().parents[1]
DEMO = ROOT / "src" / "tanteo" / "bench" / "demo" / "parts"


@cache
def demo():
    """Return the twelve parts of the demo."""
    return tuple(tanteo.read_parts(sorted(DEMO.glob("*.stl")), unit="mm").parts)


def sphere(rows):
    """Return vertices and triangles of a unit sphere of ``4 rows^2`` triangles."""
    polar, turn = np.linspace(0, np.pi, rows + 1)[1:-1], np.linspace(0, 2 * np.pi, 2 * rows, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    inner = [np.column_stack([np.sin(p) * ring, np.full(len(turn), np.cos(p))]) for p in polar]
    vertices = np.concatenate([[[0, 0, 1.0]], *inner, [[0, 0, -1.0]]])
    n, triangles = len(turn), []
    for k in range(n):
        after = (k + 1) % n
        triangles.append((0, 1 + k, 1 + after))
        last = 1 + n * (rows - 2)
        triangles.append((len(vertices) - 1, last + after, last + k))
        for r in range(rows - 2):
            a, b = 1 + n * r + k, 1 + n * r + after
            triangles += [(a, a + n, b), (b, a + n, b + n)]
    return vertices, np.array(triangles)


@cache
def organic(seed, rows=64):
    """Return a smooth closed part without flat faces or symmetries, about 100 mm large."""
    rng = np.random.default_rng(seed)
    vertices, triangles = sphere(rows)
    radius = np.ones(len(vertices))
    for _ in range(8):
        radius += 0.08 * np.cos(vertices @ rng.normal(size=3) * 2 + rng.uniform(0, 2 * np.pi))
    body = vertices * radius[:, None] * rng.uniform(0.03, 0.06, 3)
    return tanteo.part_from_mesh(body, triangles, unit="m", name=f"organic_{seed}")


@cache
def faceted(n):
    """Return a cylinder of ``n`` facets as a mesh, 60 mm long and 40 mm wide, with a flat along it."""
    turn = np.linspace(0, 2 * np.pi, n, endpoint=False)
    ring = np.column_stack([0.02 * np.cos(turn), np.minimum(0.02 * np.sin(turn), 0.016)])
    vertices = np.concatenate(
        [np.column_stack([ring, np.full(n, z)]) for z in (0.0, 0.06)] + [[[0, 0, 0.0]], [[0, 0, 0.06]]]
    )
    triangles = []
    for k in range(n):
        after = (k + 1) % n
        triangles += [(k, after, n + k), (after, n + after, n + k), (2 * n, after, k), (2 * n + 1, n + k, n + after)]
    return tanteo.part_from_mesh(vertices, triangles, unit="m", name=f"faceted_{n}")


def touches(part, rng, n, sd):
    """Return points ``(n, 3)`` and normals ``(n, 3)`` of the surface at a pose, with noise."""
    a, b, c = np.moveaxis(part.vertices[part.triangles], 1, 0)
    normals = np.cross(b - a, c - a)
    areas = np.linalg.norm(normals, axis=1)
    chosen = rng.choice(len(areas), n, p=areas / areas.sum())
    u, v = np.sort(rng.random((2, n)), axis=0)
    p = u[:, None] * a[chosen] + (v - u)[:, None] * b[chosen] + (1 - v)[:, None] * c[chosen]
    T = np.eye(4)
    T[:3, :3] = SO3.exp(rng.normal(size=3))
    T[:3, 3] = rng.uniform(-0.2, 0.2, 3)
    normals = (normals / areas[:, None])[chosen] @ T[:3, :3].T
    return SE3.apply(T, p) + sd * rng.normal(size=(n, 3)), normals


def question(parts, n, sd, *, own=None, with_normals=False):
    """Return a function that identifies scene ``k``: processor time [ms], whether the part is right, and status."""

    def identified(k):
        rng = np.random.default_rng((k, n))
        among = parts()
        part = among[k % len(among)] if own is None else own()
        points, normals = touches(part, rng, n, sd)
        more = {"normals": normals, "normal_sds": np.full(n, 0.05)} if with_normals else {}
        readings = tanteo.Readings.from_columns(points=points, sds=np.full(n, sd), **more)
        start = time.process_time()
        answer = tanteo.identify(readings, among)
        ms = 1e3 * (time.process_time() - start)
        return ms, bool(answer.hypotheses) and answer.hypotheses[0].part == part.name, answer.status

    return identified


ROWS = {
    "3 points, 12 parts": (question(demo, 3, 3e-4), 12),
    "4 points, 12 parts": (question(demo, 4, 3e-4), 12),
    "6 points, 12 parts": (question(demo, 6, 3e-4), 12),
    "12 points of 2 mm, 12 parts": (question(demo, 12, 2e-3), 12),
    "12 points of 5 mm, 12 parts": (question(demo, 12, 5e-3), 12),
    "75 points of 5 mm on 320 facets": (question(lambda: (faceted(160),), 75, 5e-3), 4),
    "organic, 12 contacts with normals": (question(lambda: (organic(0),), 12, 3e-4, with_normals=True), 3),
    "ten organic, 12 contacts with normals": (
        question(lambda: tuple(organic(seed) for seed in range(10)), 12, 3e-4, with_normals=True),
        2,
    ),
}


def spread_of_seeds(scenes=8, seeds=5):
    """Return the table of how much seeds differ in the probability of the best part, by rounds of samples."""
    lines = []
    for rounds in (1, 2, 4, 10):
        settings = replace(DEFAULTS, samples=replace(DEFAULTS.samples, rounds=rounds))
        differences, ms = [], []
        for k in range(scenes):
            rng = np.random.default_rng((k, 5))
            points, _ = touches(demo()[k % len(demo())], rng, 5, 3e-4)
            readings = tanteo.Readings.from_columns(points=points, sds=np.full(5, 3e-4))
            found = []
            for seed in range(seeds):
                start = time.process_time()
                answer = tanteo.identify(readings, demo()[:6], seed=seed, top=100, settings=settings)
                ms.append(1e3 * (time.process_time() - start))
                found.append(Counter())
                for one in answer.hypotheses:
                    found[-1][one.part] += one.probability
            best = max(found[0], key=found[0].get)
            differences.append(np.std([one[best] for one in found], ddof=1))
        sd = float(np.sqrt(np.mean(np.square(differences))))
        lines.append((str(settings.samples.few_rounds), f"{sd:.3f}", f"{np.median(ms):.0f}"))
    text = "Five points on six parts: standard deviation over seeds of the probability of the best part."
    return Table("Rounds of samples where points are too few", text, ("rounds", "sd over seeds", "ms, median"), lines)


def main():
    """Print the table of the rows that the arguments name."""
    chosen = [name for name in ROWS if not sys.argv[1:] or any(word in name for word in sys.argv[1:])]
    lines = []
    for name in chosen:
        identified, count = ROWS[name]
        identified(count)  # prepares the parts
        found = [identified(k) for k in range(count)]
        ms = [one[0] for one in found]
        statuses = ", ".join(sorted({one[2] for one in found}))
        right = f"{sum(one[1] for one in found)} of {count}"
        lines.append((name, right, statuses, f"{np.median(ms):.0f}", f"{max(ms):.0f}"))
        print(*lines[-1], file=sys.stderr, flush=True)
    if "seeds" in sys.argv[1:]:
        print(spread_of_seeds().markdown())
    columns = "scene", "part right", "statuses", "ms, median", "ms, worst"
    print(Table("Unusually slow questions", __doc__.split("\n\n")[1], columns, tuple(lines)).markdown())


if __name__ == "__main__":
    main()
