"""Read and write sets as folders: CAD files of parts, readings files of scenes, a table of true poses."""

from __future__ import annotations

import csv
import tomllib
from pathlib import Path

import numpy as np

from tanteo.bench.generated import tolerance_of
from tanteo.bench.sets import BenchScene, BenchSet, range_scene
from tanteo.catalogue import read_parts
from tanteo.errors import InputError
from tanteo.geometry.typing import Transforms
from tanteo.io import pose_as_brand, pose_from_brand, read_readings, read_rig, write_readings, write_rig
from tanteo.io.documents import rig_text
from tanteo.parts import read_whole
from tanteo.sensors import Readings, Rig

_POSE = ("x_mm", "y_mm", "z_mm", "qx", "qy", "qz", "qw")
_MM = 1e-3
_UNITS = np.r_[np.full(3, _MM), np.ones(4)]


def read_set(folder: str | Path) -> BenchSet:
    """Read a set from a folder: ``set.toml``, ``parts/``, ``scenes/*.csv``, ``truth.csv`` (``docs/formats_scenes.md``).

    Args:
        folder: folder of the set.

    Raises:
        InputError: a file is missing or malformed; the message names it.
    """
    folder = Path(folder)
    for name in ("set.toml", "truth.csv", "parts", "scenes"):
        if not (folder / name).exists():
            raise InputError(f"{folder}: expected {name} in it, got none. docs/formats_scenes.md describes a set.")
    try:
        header = tomllib.loads(read_whole(folder / "set.toml", "the head of a set").decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{folder / 'set.toml'}: expected TOML, got {error}.") from None
    parts = tuple(read_parts([folder / "parts"], unit=header.get("unit")))
    truth = _truth(folder / "truth.csv")
    files = sorted((folder / "scenes").iterdir())
    missing = [file.name for file in files if file.stem not in truth]
    if missing:
        raise InputError(f"{folder / 'truth.csv'}: expected a row for each scene, got none of {', '.join(missing)}.")
    rig = read_rig(folder / "rig.toml") if (folder / "rig.toml").exists() else None
    scenes = tuple(_scene(file, rig, *truth[file.stem]) for file in files)
    tolerance = header.get("tolerance_mm", tolerance_of(parts) / _MM)
    if isinstance(tolerance, bool) or not isinstance(tolerance, int | float):
        raise InputError(f"{folder / 'set.toml'}, tolerance_mm: expected a number, got {tolerance!r}.")
    return BenchSet(str(header.get("name", folder.name)), parts, scenes, _MM * tolerance, str(header.get("words", "")))


def _truth(path: Path) -> dict[str, tuple[str | None, Transforms | None]]:
    """Return part and pose of each scene; None for an unknown object, and for an unknown pose."""
    rows = list(csv.DictReader(read_whole(path, "a table of truths").decode("utf-8-sig").splitlines()))
    if not rows or not {"scene", "part"} <= set(rows[0]):
        raise InputError(f"{path}: expected the columns scene, part, {', '.join(_POSE)}, got {list(rows[:1])}.")
    out: dict[str, tuple[str | None, Transforms | None]] = {}
    for line, row in enumerate(rows, 2):
        typed = [(row.get(name) or "").strip() for name in _POSE]
        pose = None
        if any(typed):
            try:
                pose = pose_from_brand("ros", np.array([float(word) for word in typed]) * _UNITS)
            except ValueError as error:  # raised by float or by the conversion of the pose
                raise InputError(f"{path}, line {line}: expected {', '.join(_POSE)}, got {typed}: {error}") from None
        out[row["scene"].strip()] = (row["part"].strip() or None, pose)
    return out


def _scene(path: Path, rig: Rig | None, part: str | None, pose: Transforms | None) -> BenchScene:
    readings = read_readings(path, rig=rig)
    if rig is not None:
        return range_scene(path.stem, readings, rig, part, pose)
    sds = readings.sds.values
    if not len(sds) or not readings.points.given.all():
        raise InputError(f"{path}: expected points with a standard deviation each, got others.")
    points = readings.points[:]
    normals = readings.normals[:] if readings.normals.given.all() else None
    spread = float(np.sqrt(np.mean(readings.normal_sds[:] ** 2))) if normals is not None else float(np.pi)
    return BenchScene(path.stem, points, float(np.sqrt(np.mean(sds**2))), normals, spread, part, pose)


def write_set(bench_set: BenchSet, folder: str | Path) -> None:
    """Write a set into a new folder, with its parts as STL in millimetres; :func:`read_set` reads it.

    Args:
        bench_set: set to write.
        folder: folder to create; it must not exist yet.

    Raises:
        InputError: the folder, or a file of that name, exists.
        OSError: the folder cannot be written.
    """
    import trimesh  # slow to import

    folder = Path(folder)
    if folder.exists():
        raise InputError(f"{folder}: expected no folder of that name, got one. Choose another name.")
    for name in ("parts", "scenes"):
        (folder / name).mkdir(parents=True)
    words = bench_set.words.replace("\\", "/").replace('"', "'")
    lines = f'name = "{bench_set.name}"', f'words = "{words}"', 'unit = "mm"'
    header = "\n".join([*lines, f"tolerance_mm = {bench_set.tolerance / _MM:.9g}", ""])
    (folder / "set.toml").write_text(header, encoding="utf-8")
    for part in bench_set.parts:
        mesh = trimesh.Trimesh(part.vertices / _MM, part.triangles, process=False)
        mesh.export(folder / "parts" / f"{part.name}.stl")
    with (folder / "truth.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(["scene", "part", *_POSE])
        for scene in bench_set.scenes:
            T = scene.T_world_part
            pose = [""] * 7 if T is None else [f"{v:.12g}" for v in pose_as_brand("ros", T) / _UNITS]
            table.writerow([scene.name, scene.truth or "", *pose])
    rigs = {rig_text(scene.rig): scene.rig for scene in bench_set.scenes if scene.rig is not None}
    if len(rigs) > 1 or (rigs and any(scene.rig is None for scene in bench_set.scenes)):
        raise InputError(f"set {bench_set.name!r}: expected one rig of all scenes, got several. Write several sets.")
    for rig in rigs.values():
        write_rig(rig, folder / "rig.toml")
    for scene in bench_set.scenes:
        _write_scene(scene, folder / "scenes" / f"{scene.name}.csv")


def _write_scene(scene: BenchScene, path: Path) -> None:
    if scene.readings is not None:
        write_readings(scene.readings, path)
        return
    n = len(scene.points)
    normal_sds = None if scene.normals is None else np.full(n, scene.normal_sd)
    sds = np.full(n, scene.sd)
    write_readings(Readings.from_columns(scene.points, sds=sds, normals=scene.normals, normal_sds=normal_sds), path)
