"""Reads every CAD file of the example and data folders and prints a table as markdown.

``python benchmarks/reading.py [data folder] [another folder]...``. Times are those of one fresh call each: in this
process, in worker processes, and from the cache (kept in a temporary folder). The CAD kernel alone reads,
transfers and meshes the STEP files of a set ("kernel", processor time). Other folders are read too, each as one set, in
millimetres where its files say no unit. Files that cannot be read are listed with the reason, and
those whose surface is not just as they have it.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.STEPControl import STEPControl_Reader

from tanteo.catalogue import Parts, read_parts
from tanteo.catalogue.file_warnings import cad_files, repaired

ROOT = Path(__file__).resolve().parents[1]


def sets(data: Path, more: list[Path]) -> dict[str, tuple[list[Path], str | None]]:
    """Name, files or folders, and unit of the files that carry none."""
    meshes = [data / "bracket", data / "cmm_block", data / "fixture_touches"]
    found = {
        "examples (STEP)": ([ROOT / "examples" / "parts"], None),
        "step_parts": ([data / "step_parts"], None),
        "step_nist": ([data / "step_nist"], None),
        "step_confusable": ([data / "step_confusable"], None),
        "bracket, block, fixture (STL)": (meshes, "mm"),
        "fingertip models (OFF)": ([data / "fingertip_touches" / "models"], "m"),
        "field cases": (cad_files(sorted((data / "field_cases").glob("[0-9t]*"))), "mm"),
    }
    found.update({folder.name: ([folder], None if _states_units(folder) else "mm") for folder in more})
    return {name: given for name, given in found.items() if given[0] and all(path.exists() for path in given[0])}


def _states_units(folder: Path) -> bool:
    return all(
        file.suffix.lower() in (".step", ".stp", ".igs", ".iges", ".glb", ".3mf") for file in cad_files([folder])
    )


def timed(paths: list[Path], unit: str | None, **rest: object) -> tuple[Parts, float]:
    start = time.perf_counter()
    parts = read_parts(paths, unit=unit, **rest)  # type: ignore[arg-type]
    return parts, time.perf_counter() - start


def by_kernel(parts: Parts) -> float:
    """Return the processor time [s] in which the CAD kernel alone reads and meshes the STEP files of some parts."""
    start = time.process_time()
    for part in parts:
        if not part.source.lower().endswith((".step", ".stp")):
            continue
        reader = STEPControl_Reader()
        reader.ReadFile(part.source)
        reader.TransferRoots()
        BRepMesh_IncrementalMesh(reader.OneShape(), 3e-4 * 1e3 * part.diagonal, False, 0.25, False)  # as Tanteo's first
    return time.process_time() - start


def row(name: str, paths: list[Path], unit: str | None) -> tuple[str, Parts]:
    begun = time.process_time()
    serial, _ = timed(paths, unit, workers=0, cache=False)
    alone = time.process_time() - begun
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
        sum(not part.closed for part in parts),
        f"{alone:.2f}",
        f"{by_kernel(serial):.2f}",
        f"{together:.2f}",
        f"{cached:.2f}",
    ]
    return "| " + " | ".join(map(str, cells)) + " |", parts


def main(data: Path, *more: Path) -> None:
    read_parts([ROOT / "examples" / "parts" / "block.step"], workers=0, cache=False)  # Imports are not reading.
    columns = "set, files, read, refused, planes, curved, of them free, edges, corners, symmetric, repaired, open"
    columns += ", s of processor in one process, s of the kernel, s in workers, s from the cache"
    print("| " + " | ".join(columns.split(", ")) + " |")
    print("|" + " --- |" * len(columns.split(", ")))
    failures, odd = [], []
    with tempfile.TemporaryDirectory() as folder:
        os.environ["TANTEO_CACHE"] = folder
        for name, (paths, unit) in sets(data, list(more)).items():
            line, parts = row(name, paths, unit)
            failures += parts.failures
            odd += list(repaired(parts))
            print(line, flush=True)
    print("\nRefused:\n")
    for failure in failures:
        print(f"- {failure.reason}")
    print("\nNot just as the file has it:\n")
    for sentence in odd:
        print(f"- {Path(sentence.split(': ', 1)[0]).name}: {sentence.split(': ', 1)[1]}")


if __name__ == "__main__":
    main(*(map(Path, sys.argv[1:]) if len(sys.argv) > 1 else [ROOT.parent / "shared" / "data"]))
