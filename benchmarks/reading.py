"""Reads every CAD file of the example and data folders and prints a table as markdown.

``python benchmarks/reading.py [data folder]``. Times are those of one fresh call each: in this process, in one worker
process per core, and from the cache (kept in a temporary folder).
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from tanteo.catalogue import Parts, read_parts

ROOT = Path(__file__).resolve().parents[1]


def sets(data: Path) -> dict[str, tuple[list[Path], str]]:
    """Name, files or folders, and unit of the files that carry none."""
    meshes = [data / "bracket", data / "cmm_block", data / "fixture_touches"]
    found = {
        "examples (STEP)": ([ROOT / "examples" / "parts"], "mm"),
        "step_parts": ([data / "step_parts"], "mm"),
        "step_nist": ([data / "step_nist"], "mm"),
        "step_confusable": ([data / "step_confusable"], "mm"),
        "bracket, block, fixture (STL)": (meshes, "mm"),
        "fingertip models (OFF)": ([data / "fingertip_touches" / "models"], "m"),
    }
    return {name: given for name, given in found.items() if all(path.exists() for path in given[0])}


def timed(paths: list[Path], unit: str, **rest: object) -> tuple[Parts, float]:
    start = time.perf_counter()
    parts = read_parts(paths, unit=unit, **rest)  # type: ignore[arg-type]
    return parts, time.perf_counter() - start


def row(name: str, paths: list[Path], unit: str) -> tuple[str, Parts]:
    serial, alone = timed(paths, unit, workers=0, cache=False)
    parts, together = timed(paths, unit, cache=True)
    again, cached = timed(paths, unit, cache=True)
    assert len(serial) == len(parts) == len(again)
    faces = Counter(face.surface for part in parts for face in part.faces)
    curved = sum(count for kind, count in faces.items() if kind != "plane")
    cells = [
        name,
        len(parts) + len(parts.failures),
        len(parts),
        len(parts.failures),
        faces["plane"],
        curved,
        faces["freeform"],
        sum(len(part.edges) for part in parts),
        sum(len(part.corners) for part in parts),
        sum(part.symmetry.order > 1 or part.symmetry.continuous for part in parts),
        sum(bool(part.repairs) for part in parts),
        f"{alone:.2f}",
        f"{together:.2f}",
        f"{cached:.2f}",
    ]
    return "| " + " | ".join(map(str, cells)) + " |", parts


def main(data: Path) -> None:
    read_parts([ROOT / "examples" / "parts" / "block.step"], workers=0, cache=False)  # Imports are not reading.
    columns = "set, files, read, failed, planes, curved, of them free, edges, corners, symmetric, repaired"
    columns += ", s in one process, s in workers, s from the cache"
    print("| " + " | ".join(columns.split(", ")) + " |")
    print("|" + " --- |" * len(columns.split(", ")))
    failures = []
    with tempfile.TemporaryDirectory() as folder:
        os.environ["TANTEO_CACHE"] = folder
        for name, (paths, unit) in sets(data).items():
            line, parts = row(name, paths, unit)
            failures += parts.failures
            print(line, flush=True)
    print("\nFailed:\n")
    for failure in failures:
        print(f"- {failure.reason}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT.parent / "shared" / "data")
