"""What locating unlabelled readings costs in time and memory, over readings, triangles and parts."""

from __future__ import annotations

import ctypes
import gc
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from common import Table

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from bare_scenes import box_centred_pose, surface_points, touches_of
from random_parts import random_part, write_off
from tanteo.factors import ContactPoints, FreeRays
from tanteo.geometry import SE3
from tanteo.parts import Part, read_part
from tanteo.posterior import PreparedPart, identify_points, prepare

SD, NORMAL_SD = 5e-4, np.radians(3)
USUAL = 30
"""Readings where their number does not vary."""

SWEEPS: dict[str, tuple[int, ...]] = {
    "points": (3, 4, 5, 6, 7, 8, 10, 15, 20, 30, 100, 300, 1000),
    "points with normals": (3, 10, 30, 100, 300, 1000),
    "triangles": (10, 100, 1_000, 10_000, 100_000),
    "parts": (1, 10, 100, 1_000),
}
BLOBS = {10: (5, 2), 100: (10, 6), 1_000: (25, 21), 10_000: (100, 51), 100_000: (250, 201)}
"""Meridians and bands of the smooth part with that many triangles."""

SCENES, LONG = 3, 3.0
"""Scenes of which the median is taken; where the one thrown away takes longer than so many seconds, it alone."""

TEXT = f"""\
Points even by area, {1e3 * SD:g} mm a coordinate, normals {np.degrees(NORMAL_SD):g} degrees; {USUAL} points where their
number does not vary. Points: one stepped workpiece of 30 to 120 mm. Triangles: one smooth part of 80 mm without
symmetry, ever finer. Parts: different stepped workpieces, the readings on one of them. Each row is a process of its
own on one core: reading the mesh files and preparing them, once; one call of `identify_points`, process time, median
of {SCENES} scenes after one that is thrown away; where that one takes more than {LONG:g} s, it alone. Memory: what the
prepared parts keep, and what the call needs on top of that at its worst."""

COLUMNS = ("over", "number", "read [s]", "prepare [s]", "kept [MB]", "call [ms]", "needed [MB]")


def measure(sweeps: dict[str, tuple[int, ...]] = SWEEPS) -> Table:
    rows = []
    for over, numbers in sweeps.items():
        for number in numbers:
            r = _in_a_process(over, number)
            rows.append((
                over, f"{number:,}", f"{r['read']:.3g}", f"{r['prepare']:.3g}", f"{r['kept']:.0f}",
                f"{r['call']:.3g}", f"{r['needed']:.0f}",
            ))  # fmt: skip
    return Table("What it costs", TEXT, COLUMNS, rows)


def _in_a_process(over: str, number: int) -> dict[str, float]:
    command = [sys.executable, __file__, over, str(number)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return dict(json.loads(done.stdout))


def one(over: str, number: int) -> dict[str, float]:
    """Return one row: seconds, megabytes, milliseconds."""
    rng = np.random.default_rng(1991)
    _warm(rng)
    with tempfile.TemporaryDirectory() as folder:
        read, parts = _timed(lambda: _parts(over, number, Path(folder), rng))
    before = resident()
    with_normals = over == "points with normals"
    prepare, targets = _timed(lambda: [_prepared(part) for part in parts])
    count = number if over.startswith("points") else USUAL
    kept = resident() - before
    start_again()
    base = resident()
    calls: list[float] = []
    for k in range(SCENES + 1):
        touches = scene(targets[len(targets) // 2], count, with_normals, np.random.default_rng((k, count)))
        calls.append(_call(targets, touches))
        if calls[0] > LONG:
            break
    calls = calls[1:] or calls
    needed = high_water() - base
    return {"read": read, "prepare": prepare, "kept": kept, "call": 1e3 * float(np.median(calls)), "needed": needed}


def _parts(over: str, number: int, folder: Path, rng: np.random.Generator) -> list[Part]:
    if over == "triangles":
        write_off(folder / "blob.off", *blob(*BLOBS[number]))
        return [read_part(folder / "blob.off", unit="mm")]
    return [random_part(folder / f"part{k}.off", rng, slanted=0.0) for k in range(number if over == "parts" else 1)]


def _prepared(part: Part) -> PreparedPart:
    target = prepare(part)
    _ = target.shape  # else made by the first call that needs it
    return target


def blob(meridians: int, bands: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a smooth closed surface without symmetry [mm] with ``2 meridians (bands - 1)`` triangles."""
    polar = np.pi * np.arange(1, bands) / bands
    longitudes = 2 * np.pi * np.arange(meridians) / meridians
    t, a = np.meshgrid(polar, longitudes, indexing="ij")
    d = np.stack([np.sin(t) * np.cos(a), np.sin(t) * np.sin(a), np.cos(t)], axis=-1).reshape(-1, 3)
    d = np.concatenate([d, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])
    x, y, z = d.T
    size = 1 + 0.2 * x * y + 0.15 * x**3 - 0.2 * y * z * z + 0.25 * x * y * z
    ring = np.arange(meridians * (bands - 1)).reshape(bands - 1, meridians)
    after = np.roll(ring, -1, axis=1)
    top, bottom = len(d) - 2, len(d) - 1
    triangles = [np.stack([np.full(meridians, top), ring[0], after[0]], axis=-1)]
    triangles += [np.stack([ring[:-1], ring[1:], after[1:]], axis=-1).reshape(-1, 3)]
    triangles += [np.stack([ring[:-1], after[1:], after[:-1]], axis=-1).reshape(-1, 3)]
    triangles += [np.stack([ring[-1], np.full(meridians, bottom), after[-1]], axis=-1)]
    return d * size[:, None] * [40.0, 30.0, 22.0], np.concatenate(triangles)


def scene(target: PreparedPart, count: int, with_normals: bool, rng: np.random.Generator) -> ContactPoints:
    T = box_centred_pose(rng)
    p, n = surface_points(target, count, rng)
    points = SE3.apply(T, p) + SD * rng.normal(size=p.shape)
    if not with_normals:
        return touches_of(points, SD)
    n = n @ T[:3, :3].T + NORMAL_SD * rng.normal(size=n.shape)  # along itself the error only scales
    return touches_of(points, SD, normals=n / np.linalg.norm(n, axis=1, keepdims=True), normal_sd=NORMAL_SD)


def _call(targets: list[PreparedPart], touches: ContactPoints) -> float:
    start = time.process_time()
    identify_points(touches, FreeRays.none(), targets)
    return time.process_time() - start


def _timed(work: Callable[[], Any]) -> tuple[float, Any]:
    start = time.process_time()
    out = work()
    return time.process_time() - start, out


def _warm(rng: np.random.Generator) -> None:
    """Everything once on another part: libraries load and take memory when first used."""
    with tempfile.TemporaryDirectory() as folder:
        target = prepare(random_part(Path(folder) / "warm.off", rng, slanted=0.0))
    for normals in (False, True):
        _call([target], scene(target, USUAL, normals, rng))


def resident() -> float:
    """Memory in use now, what was freed given back [MB]."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    return status("VmRSS")


def high_water() -> float:
    """Return the largest memory in use since ``start_again`` [MB]."""
    return status("VmHWM")


def start_again() -> None:
    """Forget the high-water mark."""
    Path("/proc/self/clear_refs").write_text("5")


def status(name: str) -> float:
    lines = Path("/proc/self/status").read_text().splitlines()
    return float(next(line for line in lines if line.startswith(name)).split()[1]) / 1024


if __name__ == "__main__":
    for pool in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        assert os.environ.get(pool) == "1", f"{pool}: expected 1. Run benchmarks/run.py cost."
    print(json.dumps(one(sys.argv[1], int(sys.argv[2]))))
