"""Opening a thousand prepared parts in a new process: time, and memory that they keep."""

from __future__ import annotations

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

from bench_cost import resident, scene, status

from tanteo.catalogue import read_parts
from tanteo.factors import FreeRays
from tanteo.posterior import identify_points, prepare, prepare_all

COUNT, ROUNDS = 1_000, 5
TIME_TARGET, MEMORY_TARGET = 0.2, 150.0

TEXT = f"""\
{COUNT:,} stepped and slanted workpieces of 30 to 120 mm, read and prepared before and remembered on disk; a new
process opens them: `read_parts`, then all their shapes. Time so far, median of {ROUNDS} processes, files in the
system's cache; aim: {TIME_TARGET:g} s. Memory is what the process has resident more than before, without and with the
pages of files that it has mapped, which the system may take back; aim: {MEMORY_TARGET:g} MB. One search is
`identify_points` with 30 readings on one of the parts."""

COLUMNS = ("after", "elapsed [s]", "processor [s]", "memory of its own [MB]", "with mapped files [MB]")
STEPS = {"read": "`read_parts`", "shapes": "all shapes", "search": "one search"}


def measure(make: Callable[[Path], None] | None = None) -> Table:
    with tempfile.TemporaryDirectory() as folder:
        parts, cache = Path(folder) / "parts", Path(folder) / "cache"
        parts.mkdir()
        (make or workpieces)(parts)
        _one("prepare", parts, cache)
        rounds = [_one("open", parts, cache) for _ in range(ROUNDS)]
    rows = [
        (name, *(f"{np.median([r[step][k] for r in rounds]):.3g}" for k in range(4))) for step, name in STEPS.items()
    ]
    return Table(f"Opening {COUNT:,} parts", TEXT, COLUMNS, rows)


def workpieces(folder: Path) -> None:
    """Meshes, as ``tests/random_parts.py`` makes them."""
    from random_parts import slanted_mesh, stepped_mesh, write_off

    rng = np.random.default_rng(1991)
    for k in range(COUNT):
        write_off(folder / f"part{k:04d}.off", *(slanted_mesh(rng) if rng.uniform() < 0.3 else stepped_mesh(rng)))


def _one(what: str, parts: Path, cache: Path) -> dict[str, list[float]]:
    command = [sys.executable, __file__, what, str(parts)]
    done = subprocess.run(
        command, capture_output=True, text=True, check=True, env={**os.environ, "TANTEO_CACHE": str(cache)}
    )
    return dict(json.loads(done.stdout))


def prepared(folder: str) -> dict[str, list[float]]:
    """Everything read and prepared, and so remembered."""
    for part in read_parts(folder, unit="mm", workers=0).parts:
        _ = prepare(part).shape
    return {}


def opened(folder: str) -> dict[str, list[float]]:
    """Seconds, elapsed and of the processor, and megabytes after each step."""
    out: dict[str, list[float]] = {}
    before, spent = (_own(), resident()), [0.0, 0.0]

    def step(name: str, work: Callable[[], Any]) -> Any:
        start = time.perf_counter(), time.process_time()
        made = work()
        spent[0] += time.perf_counter() - start[0]
        spent[1] += time.process_time() - start[1]
        now = _own(), resident()
        out[name] = [*spent, now[0] - before[0], now[1] - before[1]]
        return made

    parts = step("read", lambda: read_parts(folder, unit="mm", workers=0).parts)
    targets = prepare_all("parts", parts)
    kept = step("shapes", lambda: [target.shape for target in targets])
    points = scene(targets[len(kept) // 2], 30, False, np.random.default_rng(0))
    step("search", lambda: identify_points(points, FreeRays.none(), targets))
    return out


def _own() -> float:
    """Memory that is no page of a file [MB]."""
    return status("RssAnon")


if __name__ == "__main__":
    print(json.dumps({"prepare": prepared, "open": opened}[sys.argv[1]](sys.argv[2])))
