"""Questions that once took unusually long: ``python benchmarks/cliffs.py [ROW ...] [seeds] [history] [ratios]``.

Each row is a few scenes of one kind with their median and worst processor time beside the aim. Preparation of the part
is not counted, except in rows of first calls, which read a mesh file in a process of their own. Organic meshes are
smooth closed shapes of 16,000 triangles, drawn by spherical waves. Ratio: median over aim.

``history`` appends the rows to ``benchmarks/history.csv``: the median over the time of a fixed task of NumPy in the
same process, so that computers of different speed compare. ``ratios`` prints the same lines, as CI does for a fast row.
``scores POINTS SCENES SEED`` prints how right the probabilities of few points are. ``threads`` prints the elapsed time
of some rows with one and with two threads, each in a process of its own; the processor must be idle otherwise.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from bench_cost import high_water
from common import Table

import tanteo
from tanteo.geometry import SE3, SO3
from tanteo.parts import Surface, round_features
from tanteo.posterior import DEFAULTS
from tanteo.posterior import Table as TablePrior

ROOT = Path(__file__).resolve().parents[1]
DEMO = ROOT / "src" / "tanteo" / "bench" / "demo" / "parts"


@cache
def demo():
    """Return the twelve parts of the demo."""
    return tuple(tanteo.read_parts(sorted(DEMO.glob("*.stl")), unit="mm").parts)


def sphere(rows):
    """Return vertices and triangles of a unit sphere of ``4 rows^2`` triangles."""
    polar, turn = np.linspace(0, np.pi, rows + 1)[1:-1], np.linspace(0, 2 * np.pi, 2 * rows, endpoint=False)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    inner = [np.column_stack([np.sin(p) * circle, np.full(len(turn), np.cos(p))]) for p in polar]
    vertices = np.concatenate([[[0, 0, 1.0]], *inner, [[0, 0, -1.0]]])
    rings = 1 + np.arange(len(turn) * len(polar)).reshape(len(polar), -1)
    after, top, bottom = np.roll(rings, -1, axis=1), np.zeros_like(rings[0]), np.full_like(rings[0], len(vertices) - 1)
    triangles = [
        np.stack([top, rings[0], after[0]], axis=-1),
        np.stack([rings[:-1], rings[1:], after[:-1]], axis=-1).reshape(-1, 3),
        np.stack([after[:-1], rings[1:], after[1:]], axis=-1).reshape(-1, 3),
        np.stack([bottom, after[-1], rings[-1]], axis=-1),
    ]
    return vertices, np.concatenate(triangles)


def waves(seed, rows):
    """Return vertices [m] and triangles of a smooth closed shape without symmetries, about 100 mm large."""
    rng = np.random.default_rng(seed)
    vertices, triangles = sphere(rows)
    radius = np.ones(len(vertices))
    for _ in range(8):
        radius += 0.08 * np.cos(vertices @ rng.normal(size=3) * 2 + rng.uniform(0, 2 * np.pi))
    return vertices * radius[:, None] * rng.uniform(0.03, 0.06, 3), triangles


@cache
def organic(seed, rows=64):
    """Return a smooth closed part of ``4 rows^2`` triangles without flat faces."""
    return tanteo.part_from_mesh(*waves(seed, rows), unit="m", name=f"organic_{seed}")


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


def question(parts, n, sd, *, own=None, with_normals=False, missing=False):
    """Return a function that identifies scene ``k``: processor time [ms], whether the part is right, and status.

    If ``missing``, the part is not among the candidates, and no answer that is sure of one is right.
    """

    def identified(k):
        rng = np.random.default_rng((k, n))
        among = parts()
        part = among[k % len(among)] if own is None else own()
        if missing:
            among = tuple(one for one in among if one is not part)
        points, normals = touches(part, rng, n, sd)
        more = {"normals": normals, "normal_sds": np.full(n, 0.05)} if with_normals else {}
        readings = tanteo.Readings.from_columns(points=points, sds=np.full(n, sd), **more)
        start = time.process_time()
        answer = tanteo.identify(readings, among)
        ms = 1e3 * (time.process_time() - start)
        first = bool(answer.hypotheses) and answer.hypotheses[0].part == part.name
        return ms, answer.status != "recognized" if missing else first, answer.status

    return identified


@cache
def bracket():
    """Return a bracket, its surface, the rig of an 8 x 8 sensor, and the prior of a part on a table."""
    part = tanteo.read_part(ROOT / "examples" / "parts" / "bracket_left.step")
    rig = tanteo.read_rig(ROOT / "examples" / "readings" / "zones_rig.toml")
    on_table = tanteo.PosePrior(table=TablePrior(np.zeros(3), np.array([0.0, 0.0, 1.0]), 1e-3))
    return part, Surface(part.vertices, part.triangles), rig, on_table


def zones(frames):
    """Return a function that locates a bracket on a table by frames of an 8 x 8 sensor, whose zones report means."""

    def located(k):
        part, surface, rig, on_table = bracket()
        rng, ranges, names, hands = np.random.default_rng((k, frames)), [], [], []
        truth = SE3.from_parts(SO3.exp(np.array([0, 0, rng.uniform(-3, 3)])), np.array([0.4, 0.2, 0.0]))
        middle, steps = SE3.apply(truth, part.centroid), (np.arange(14) + 0.5) / 7 - 1
        for _ in range(frames):
            turn = rng.uniform(0, 2 * np.pi)
            place = middle + np.array([0.12 * np.cos(turn), 0.12 * np.sin(turn), 0.23])
            hand = SE3.from_parts(SO3.frame_from_axis(middle - place, 2), place)
            for sensor in rig.sensors:
                T = hand @ sensor.T_hand_sensor
                across, up = sensor.half_axes
                rays = (np.array([0, 0, 1]) + steps[:, None, None] * across + steps[:, None] * up).reshape(-1, 3)
                rays = rays / np.linalg.norm(rays, axis=1, keepdims=True) @ T[:3, :3].T
                hits = surface.cast((T[:3, 3] - truth[:3, 3]) @ truth[:3, :3], rays @ truth[:3, :3])
                normals = surface.normals[np.maximum(hits.triangles, 0)] @ truth[:3, :3].T
                table = np.where(rays[:, 2] < 0, -T[2, 3] / np.minimum(rays[:, 2], -1e-9), np.inf)
                cosines = np.where(hits.distances < table, -np.sum(normals * rays, axis=1), -rays[:, 2])
                distances = np.minimum(hits.distances, table)
                some = np.isfinite(distances) & (cosines > 0)
                if some.any():
                    signal = cosines[some] / distances[some] ** 2
                    r = signal @ distances[some] / signal.sum()
                    ranges.append((r + 1.5e-3 * rng.normal()) * sensor.axis_cosine)
                    names.append(sensor.name)
                    hands.append(hand)
        readings = tanteo.Readings.from_columns(ranges=ranges, sensors=names, Ts_world_hand=np.array(hands))
        start = time.process_time()
        answer = tanteo.locate(readings, part, rig=rig, priors=tanteo.Priors(pose=on_table))
        ms = 1e3 * (time.process_time() - start)
        off = np.linalg.norm(answer.hypotheses[0].T_world_part[:3, 3] - truth[:3, 3]) if answer.hypotheses else np.inf
        return ms, bool(off < 0.01), answer.status

    return located


def centres(k):
    """Locate a flange by one to nine centres of its holes, and four touches of its face in every other scene."""
    part, rng = tanteo.read_part(ROOT / "examples" / "parts" / "flange.step"), np.random.default_rng(k)
    holes = [one for one in round_features(part) if one.hole]
    some = [holes[i] for i in rng.permutation(len(holes))[: 5 + k % 5 - 4 * (k % 2)]]
    c = np.array([one.ends[0] + rng.random() * (one.ends[1] - one.ends[0]) for one in some])
    rows = rng.choice(
        np.flatnonzero(part.triangle_face == part.planes.faces[np.argmax(part.planes.areas)]), 4 * (k % 2)
    )
    on_face = np.einsum("nk,nki->ni", rng.dirichlet([1, 1, 1], len(rows)), part.vertices[part.triangles[rows]])
    T = SE3.from_parts(SO3.exp(rng.normal(size=3)), rng.uniform(-0.2, 0.2, 3))
    points = SE3.apply(T, np.concatenate([c, on_face]))
    readings = tanteo.Readings.from_columns(
        points=points + 2e-5 * rng.normal(size=points.shape), sds=np.full(len(points), 2e-5),
        kinds=["centre"] * len(c) + ["point"] * len(rows), features=[f"h{i}" for i in range(len(c))] + [""] * len(rows),
    )  # fmt: skip
    start = time.process_time()
    answer = tanteo.locate(readings, part)
    return 1e3 * (time.process_time() - start), answer.status != "unknown", answer.status


@dataclass(frozen=True)
class Row:
    """Scenes of one kind, their number, and the aim of the median and of the peak of memory [ms, MB]."""

    identified: object
    count: int
    aim: float
    memory: float = float("nan")


def first_call(rows):
    """Return a function that reads a mesh file and locates touches on it, in a new process: also the peak memory."""

    def identified(k):
        done = subprocess.run(
            [sys.executable, __file__, "first", str(rows)], capture_output=True, text=True, check=True
        )
        return tuple(json.loads(done.stdout))

    return identified


def first(rows):
    """Print time [ms], whether the answer is recognized, status and peak memory [MB] of one file as a JSON list."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "part.stl"
        vertices, triangles = waves(0, rows)
        body = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("unused", "<u2")])
        body["corners"] = 1e3 * vertices[triangles]
        file.write_bytes(b"".ljust(80) + np.uint32(len(body)).tobytes() + body.tobytes())
        del vertices, triangles, body
        Path("/proc/self/clear_refs").write_text("5")
        start = time.process_time()
        part = tanteo.read_part(file, unit="mm")
        points, _ = touches(part, np.random.default_rng(0), 20, 3e-4)
        answer = tanteo.locate(tanteo.Readings.from_columns(points=points, sds=np.full(20, 3e-4)), part)
        ms = 1e3 * (time.process_time() - start)
    print(json.dumps([ms, answer.status == "recognized", answer.status, high_water()]))


ROWS = {
    "part in no folder, 12 points, 11 parts": Row(question(demo, 12, 3e-4, missing=True), 12, 400),
    "3 points, 12 parts": Row(question(demo, 3, 3e-4), 12, 100),
    "4 points, 12 parts": Row(question(demo, 4, 3e-4), 12, 100),
    "6 points, 12 parts": Row(question(demo, 6, 3e-4), 12, 100),
    "12 points of 2 mm, 12 parts": Row(question(demo, 12, 2e-3), 12, 200),
    "12 points of 5 mm, 12 parts": Row(question(demo, 12, 5e-3), 12, 200),
    "75 points of 5 mm on 320 facets": Row(question(lambda: (faceted(160),), 75, 5e-3), 4, 1000),
    "organic, 12 contacts with normals": Row(question(lambda: (organic(0),), 12, 3e-4, with_normals=True), 3, 1000),
    "ten organic, 12 contacts with normals": Row(
        question(lambda: tuple(organic(seed) for seed in range(10)), 12, 3e-4, with_normals=True), 2, 5000
    ),
    "one frame of 8 x 8 zones on a table": Row(zones(1), 4, 500),
    "five frames of 8 x 8 zones on a table": Row(zones(5), 3, 3000),
    "centres of holes, 5 to 9 readings": Row(centres, 10, 1000),
    "first call, 327,000 facets": Row(first_call(286), 1, 2000, 400),
    "first call, STL file of 109 MB": Row(first_call(738), 1, 10_000, 1000),
}


def fixed_task():
    """Return the processor time [ms] of a fixed task of NumPy: products, a factorization and a sort."""
    rng = np.random.default_rng(1991)
    matrix, numbers = rng.normal(size=(400, 400)), rng.random(1_000_000)
    times = []
    for _ in range(5):
        start = time.process_time()
        np.linalg.cholesky(matrix @ matrix.T + 400 * np.eye(400))
        np.sort(numbers)
        times.append(1e3 * (time.process_time() - start))
    return min(times)


def history_of(medians):
    """Return the lines of the history: date, commit, row, and its median over the time of the fixed task."""
    git = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, cwd=ROOT, check=False)
    task = fixed_task()
    day, commit = time.strftime("%Y-%m-%d"), git.stdout.strip()
    return "".join(f'{day},{commit},"{name}",{ms / task:.3g}\n' for name, ms in medians.items())


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


def scores(n, count, seed):
    """Return the table of how right the probabilities of few points on six parts are, over fresh scenes."""
    parts, found, ms = demo()[:6], [], []
    for k in range(count):
        rng, own = np.random.default_rng((k, n, seed)), parts[k % len(parts)]
        readings = tanteo.Readings.from_columns(points=touches(own, rng, n, 3e-4)[0], sds=np.full(n, 3e-4))
        start = time.process_time()
        shares = dict(tanteo.identify(readings, parts, seed=k).parts)
        ms.append(1e3 * (time.process_time() - start))
        best = max(shares, key=shares.get, default="")
        found.append((np.log(max(shares.get(own.name, 0.0), 1e-3)), shares.get(best, 0.0), best == own.name))
    score, claimed, right = np.mean(found, axis=0)
    line = f"{score:.2f} +- {np.std([one[0] for one in found]) / np.sqrt(count):.2f}", f"{claimed:.3f}", f"{right:.3f}"
    text = f"{n} points, {count} scenes, seed {seed}. Log score: mean log probability of the true part, at least 0.001."
    return Table(
        "Probabilities of few points",
        text,
        ("log score", "claimed", "right", "ms, mean"),
        [(*line, f"{np.mean(ms):.0f}")],
    )


THREADED = {
    "20 points, 12 parts": (question(demo, 20, 3e-4), 12),
    "part in no folder, 12 points, 11 parts": (question(demo, 12, 3e-4, missing=True), 6),
    "6 points, 12 parts": (question(demo, 6, 3e-4), 4),
    "12 points of 2 mm, 12 parts": (question(demo, 12, 2e-3), 4),
}


def elapsed():
    """Print the elapsed and the processor time [ms] of each row of ``THREADED`` as a JSON list."""
    found = []
    for identified, count in THREADED.values():
        identified(count)  # prepares the parts
        start, processor = time.perf_counter(), sum(identified(k)[0] for k in range(count))
        found.append((1e3 * (time.perf_counter() - start) / count, processor / count))
    print(json.dumps(found))


def threads():
    """Return the table of elapsed times with one and with two threads."""
    rows = []
    for count in ("1", "2"):
        environment = {**os.environ, "OMP_NUM_THREADS": count, "OPENBLAS_NUM_THREADS": "1"}
        done = subprocess.run(
            [sys.executable, __file__, "elapsed"], env=environment, capture_output=True, text=True, check=True
        )
        rows.append(json.loads(done.stdout))
    lines = [
        (name, *(f"{value:.0f}" for value in (one[0], two[0], one[1], two[1])), f"{one[0] / two[0]:.2f}")
        for name, one, two in zip(THREADED, *rows, strict=True)
    ]
    columns = "scene", "elapsed, 1 thread", "elapsed, 2", "processor, 1 thread", "processor, 2", "ratio of elapsed"
    return Table("Two threads against one", "Means in milliseconds; aim of the ratio: 1.7.", columns, lines)


def main():
    """Print the table of the rows that the arguments name."""
    words = [word for word in sys.argv[1:] if word not in ("seeds", "history", "ratios")]
    chosen = {name: row for name, row in ROWS.items() if not sys.argv[1:] or any(word in name for word in words)}
    lines, medians = [], {}
    for name, row in chosen.items():
        if not row.memory > 0:
            row.identified(row.count)  # prepares the parts
        found = [row.identified(k) for k in range(row.count)]
        ms = [one[0] for one in found]
        medians[name] = float(np.median(ms))
        statuses = ", ".join(sorted({one[2] for one in found}))
        right = f"{sum(one[1] for one in found)} of {row.count}"
        memory = f"{max(one[3] for one in found):.0f} / {row.memory:.0f}" if row.memory > 0 else ""
        times = f"{medians[name]:.0f}", f"{max(ms):.0f}", f"{row.aim:.0f}", f"{medians[name] / row.aim:.1f}"
        lines.append((name, right, statuses, *times, memory))
        print(*lines[-1], file=sys.stderr, flush=True)
    if "seeds" in sys.argv[1:]:
        print(spread_of_seeds().markdown())
    if "history" in sys.argv[1:]:
        with (ROOT / "benchmarks" / "history.csv").open("a", encoding="utf-8") as file:
            file.write(history_of(medians))
    if "ratios" in sys.argv[1:]:
        print(history_of(medians))
    columns = "scene", "right", "statuses", "ms, median", "ms, worst", "aim", "ratio", "MB / aim"
    print(Table("Unusually slow questions", __doc__.split("\n\n")[1], columns, tuple(lines)).markdown())


if __name__ == "__main__":
    if sys.argv[1:] == ["threads"]:
        print(threads().markdown())
        sys.exit()
    if sys.argv[1:] == ["elapsed"]:
        elapsed()
        sys.exit()
    for pool in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        assert os.environ.get(pool) == "1", f"{pool}: expected 1, so that processor time is that of one thread."
    if sys.argv[1:2] == ["first"]:
        first(int(sys.argv[2]))
    elif sys.argv[1:2] == ["scores"]:
        print(scores(*map(int, sys.argv[2:5])).markdown())
    else:
        main()
