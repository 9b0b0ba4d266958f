"""What is fuzzed: each reader with files that it reads."""

from __future__ import annotations

import io
import json
import shutil
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import numpy as np

import tanteo
import tanteo.io
from log_cases import CASES
from tanteo import posterior
from tanteo.catalogue import build_catalogue, cache, open_catalogue, read_parts
from tanteo.cli import main
from tanteo.errors import InputError, PartError

EXAMPLES = Path(__file__).parents[2] / "examples"


def read_in_process(path, workers=1):
    """Read a file in another process; a file that cannot be read is a failure, not an exception."""
    for failure in read_parts([path], unit="mm", cache=False, workers=workers).failures:
        raise PartError(failure.reason)


def read_mesh(path):
    """Read a small mesh in this process."""
    read_in_process(path, workers=0)


def read_entry(path):
    """Read a part whose cache entry is damaged; the part is read again from its file and is equal."""
    name, kind = path.name.split(".", 1)
    entry = cache.cache_folder() / "parts" / name[:2] / f"{name}.{kind}"
    entry.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(path, entry)
    source = path.with_name("source.stl")
    shutil.copy(path.parent / "seeds" / "box.stl", source)
    part = read_parts([source], unit="mm", workers=0)["source"]
    posterior.prepare(part)
    assert abs(part.volume - 6e-6) < 1e-12, part.volume


def read_catalogue(path):
    """Read a catalogue with one damaged file; its parts are unchanged, or it is refused."""
    whole = path.parent / "seeds" / "catalogue"
    folder = path.with_name(f"{path.name}-of")
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(whole, folder)
    shutil.copy(path, folder / path.name)
    try:
        catalogue = open_catalogue(folder)
        volumes = [round(part.volume, 12) for part in catalogue]
        catalogue.check()
        assert volumes == [6e-6], volumes
        posterior.prepare(catalogue[0])
    finally:
        shutil.rmtree(folder)


def read_log(path):
    """Read a log of another program with the options that it needs."""
    tanteo.read_readings(path, **CASES[path.name][2])


def read_cut(path):
    """Read a log that was cut: rows above the last are those of the whole log, and so is the last of four or more.

    Three rows or fewer do not show how many decimals a program writes. DMIS has nominal points above the actual ones;
    they are used, with a note, where no actual ones are left.
    """
    options = CASES[path.name][2]
    readings = tanteo.read_readings(path, **options)
    whole = tanteo.read_readings(path.parent / "seeds" / path.name, **options)
    n = len(readings)
    if n < 3 or any("nominal" in note for note in readings.notes):
        return
    sure = n if n > 3 else n - 1
    assert n <= len(whole), (n, len(whole))
    np.testing.assert_allclose(readings.points[:sure], whole.points[:sure], rtol=0, atol=1e-9)


def answer(path):
    """Run the command line on readings; it prints one document or one error, and returns an exit code."""
    error_stream, out = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(error_stream):
        try:
            main(
                [
                    "locate",
                    str(path),
                    "--part",
                    str(EXAMPLES / "parts" / "bracket_left.step"),
                    "--json",
                    "--sd",
                    "0.1mm",
                ]
            )
        except SystemExit as ended:
            code = ended.code or 0
    document = json.loads(out.getvalue())
    if code == 1:
        assert document["schema"] == "tanteo.error/1"
        raise InputError(error_stream.getvalue())
    assert code in (0, 3), code
    assert document["schema"] == "tanteo.recognition/1"


READERS = {
    "readings": tanteo.read_readings,
    "log": read_log, "cut": read_cut, "rig": tanteo.io.read_rig, "scene": tanteo.io.read_scene,
    "prior": tanteo.io.read_prior, "record": tanteo.io.read_record, "camera": tanteo.read_camera,
    "marks": tanteo.io.read_marks, "image": tanteo.read_image, "mesh": read_mesh, "step": read_in_process,
    "cache": read_entry, "catalogue": read_catalogue,
    "answer": answer,
}  # fmt: skip
"""By kind of file."""

SHARES = {"step": 0.2, "answer": 0.2}
"""Inputs of slow kinds for one of another: a CAD file starts a process, an answer takes a second."""


def seeds(folder: Path) -> dict[str, list[Path]]:
    """Files that are read, by kind, written into a folder."""
    out = {
        "readings": [*sorted((EXAMPLES / "readings").glob("*.csv"))], "prior": [EXAMPLES / "scenes" / "feeder.toml"],
        "scene": [path for path in sorted((EXAMPLES / "scenes").glob("*.toml")) if path.stem != "feeder"],
        "camera": [EXAMPLES / "images" / "camera.yaml"], "marks": [EXAMPLES / "images" / "marks.csv"],
        "step": [EXAMPLES / "parts" / "block.step", EXAMPLES / "parts" / "flange.step"],
    }  # fmt: skip
    for beside in ("parts", "images", "readings"):  # which scenes name
        (folder / beside).symlink_to(EXAMPLES / beside)
    for name, text in TEXTS.items():
        path = folder / name
        path.write_text(text)
        out.setdefault(name.split("-")[0], []).append(path)
    for name, (_, content, _) in CASES.items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    out["log"] = out["cut"] = [folder / name for name in CASES]
    tanteo.io.write_rig(tanteo.io.read_rig("paper-gripper"), folder / "rig.toml")
    out["rig"] = [folder / "rig.toml"]
    out["mesh"] = list(_meshes(folder))
    out["image"] = list(_images(folder))
    out["record"] = [_record(folder)]
    names = "bracket_bare", "bracket_left", "too_few", "unknown_part"
    out["answer"] = [EXAMPLES / "readings" / f"{name}.csv" for name in names]
    out["cache"] = list(_entries(folder))
    build_catalogue(folder / "box.stl", folder / "catalogue", unit="mm", workers=0)
    out["catalogue"] = sorted(file for file in (folder / "catalogue").iterdir() if file.stat().st_size)
    return out


TEXTS = {
    "prior-a.toml": "[table]\ntop_mm = 0\nsd_mm = 1\n\n[box]\nlow_mm = [0, 0, 0]\nhigh_mm = [500, 400, 200]\n",
    "prior-b.toml": "[pose_prior]\nposition_mm = [400, 200, 0]\nturn_deg = [0, 0, 90]\nsd_mm = [5, 5, 1]\n"
    "turn_sd_deg = 3\n",
    "camera-b.xml": "<?xml version='1.0'?>\n<opencv_storage><image_width>640</image_width><image_height>480"
    "</image_height><camera_matrix type_id='opencv-matrix'><rows>3</rows><cols>3</cols><dt>d</dt><data>800. 0. 320. 0. "
    "800. 240. 0. 0. 1.</data></camera_matrix><distortion_coefficients type_id='opencv-matrix'><rows>1</rows>"
    "<cols>5</cols><dt>d</dt><data>0.1 0. 0. 0. 0.</data></distortion_coefficients></opencv_storage>",
    "camera-c.yaml": "cam0:\n  camera_model: pinhole\n  intrinsics: [800, 800, 320, 240]\n  distortion_model: radtan\n"
    "  distortion_coeffs: [0.1, 0, 0, 0]\n  resolution: [640, 480]\n",
    "camera-d.ini": "[image]\n\nwidth\n640\n\nheight\n480\n\n[left]\n\ncamera matrix\n800 0 320\n0 800 240\n0 0 1\n\n"
    "distortion\n0.1 0 0 0 0\n",
    "camera-a.json": '{"camera_matrix": [800, 0, 320, 0, 800, 240, 0, 0, 1], '
    '"image_width": 640, "image_height": 480, "distortion_coefficients": [0, 0, 0, 0, 0]}',
}


def _meshes(folder):
    import trimesh

    box = trimesh.creation.box((30, 20, 10))
    for suffix in ("stl", "obj", "ply", "off", "glb", "3mf"):
        path = folder / f"box.{suffix}"
        box.export(path)
        yield path
    path = folder / "text.stl"
    path.write_text(trimesh.exchange.stl.export_stl_ascii(box))
    yield path


def _images(folder):
    rows = np.add.outer(np.arange(30), np.arange(40)) % 256
    for suffix in ("png", "jpg", "tiff", "bmp"):
        path = folder / f"image.{suffix}"
        tanteo.io.write_image(path, rows)
        yield path


def _record(folder):
    """Return a session of two readings."""
    path = folder / "session.json"
    part = read_parts([folder / "box.stl"], unit="mm", workers=0)["box"]
    place = tanteo.at_place([part], np.eye(4), np.diag([1e-4] * 3 + [1e-2] * 3))
    session = tanteo.Session(place, tanteo.probe_of("keyence_il300"), tanteo.Sensing(sd=3e-4), seed=1)
    for _ in range(2):
        session.tell(session.ask().read(0.1))
    tanteo.io.write_record(session, path)
    return path


def _entries(folder):
    part = read_parts([folder / "box.stl"], unit="mm", workers=0)["box"]
    assert posterior.prepare(part).shape is not None  # which is remembered beside it
    for entry in sorted((cache.cache_folder() / "parts").rglob("*.*")):
        path = folder / entry.name
        shutil.copy(entry, path)
        yield path
