"""What a person is warned of on standard error, a program finds in the document."""

from __future__ import annotations

import json
import os
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def touches(tmp_path):
    """Three places of a face: too little, but readings."""
    file = tmp_path / "r.csv"
    file.write_text("x_mm,y_mm,z_mm,sd_mm\n10,10,0,0.1\n30,10,0,0.1\n20,30,0,0.1\n")
    return file


def warnings_of(run, *words):
    """Return the warnings of the document, which equal those on standard error."""
    result = run(*words, "--json")
    assert result.out, result.err
    found = json.loads(result.out).get("warnings", [])
    assert [line.removeprefix("warning: ") for line in result.err.splitlines() if line.startswith("warning")] == found
    return found


def test_a_part_that_could_not_be_read(run, parts, touches):
    assert warnings_of(run, "identify", touches, "--parts", parts, "--units", "mm") == []
    (parts / "broken.stl").write_text("no mesh")
    (warning,) = warnings_of(run, "identify", touches, "--parts", parts, "--units", "mm")
    assert "broken.stl" in warning


def test_a_folder_within_the_folder(run, parts, touches):
    (parts / "old").mkdir()
    (parts / "empty").mkdir()
    (parts / "wedge.stl").rename(parts / "old" / "wedge.stl")
    (warning,) = warnings_of(run, "identify", touches, "--parts", parts, "--units", "mm")
    words = "1 CAD file in it is not read, because subfolders are not searched. Name it, too."
    assert warning == f"{parts / 'old'}: {words}"
    assert warnings_of(run, "identify", touches, "--parts", parts, "--parts", parts / "old", "--units", "mm") == []
    (parts / "block.stl").rename(parts / "old" / "block.stl")
    code, _, err = run("identify", touches, "--parts", parts, "--units", "mm")
    assert code == 1
    assert "2 CAD files in it are not read" in err


def test_a_unit_instead_of_that_of_the_file(run, touches, parts):
    pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")
    part = EXAMPLES / "parts" / "wedge.step"
    (warning, *_) = warnings_of(run, "locate", touches, "--part", part, "--units", "in")
    assert warning.startswith(f"{part}: Read in in as requested: the file itself states mm.")
    assert warnings_of(run, "locate", touches, "--part", part, "--units", "millimetres") == []
    step = parts / "x.step"
    step.write_bytes(part.read_bytes())
    (warning, *_) = warnings_of(run, "identify", touches, "--parts", parts, "--units", "in")
    assert warning == f"--units in applies to files without a unit. Others keep their own: {step} in mm."


def test_a_command_repeats_no_warnings_of_the_one_before(run, parts, touches):
    (parts / "broken.stl").write_text("no mesh")
    assert len(warnings_of(run, "identify", touches, "--parts", parts, "--units", "mm")) == 1
    assert warnings_of(run, "locate", touches, "--part", parts / "wedge.stl", "--units", "mm") == []


@pytest.mark.slow
def test_a_hand_warns_too(run, tmp_path):
    pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")
    (tmp_path / "wedge.step").write_bytes((EXAMPLES / "parts/wedge.step").read_bytes())
    (tmp_path / "broken.step").write_text("ISO-10303-21;\n")
    words = [
        "sense",
        "part",
        "--scene",
        EXAMPLES / "scenes/part_unknown.toml",
        "--parts",
        tmp_path,
        "--max-measurements",
        "1",
    ]
    (warning,) = warnings_of(run, *words)
    assert "broken.step" in warning


def test_a_mesh_far_from_its_origin(run, touches, tmp_path, parts):
    mesh, far = trimesh.load(parts / "wedge.stl"), tmp_path / "far.stl"
    for away, count in ((1e5, 1), (1e4, 0)):
        mesh.vertices = np.array(trimesh.load(parts / "wedge.stl").vertices) + np.array([away, 0, 0])
        mesh.export(far)
        warnings = warnings_of(run, "locate", touches, "--part", far, "--units", "mm")
        assert sum("single precision resolves" in w for w in warnings) == count


def test_a_folder_that_may_not_be_read(run, parts, touches, monkeypatch):
    """It is reported, without a traceback; root may read all, so the test simulates the system's answer."""
    locked, real = parts / "locked", os.scandir
    locked.mkdir()

    def scandir(path):
        if Path(path) == locked:
            raise PermissionError(13, "Permission denied")
        return real(path)

    monkeypatch.setattr(os, "scandir", scandir)
    assert warnings_of(run, "identify", touches, "--parts", parts, "--units", "mm") == []
    code, out, err = run("identify", touches, "--parts", locked, "--units", "mm", "--report", parts / "r.html")
    assert (code, out) == (1, "")
    assert "expected a folder that may be read" in err


def test_a_file_that_states_inches_but_contains_millimetres(run, tmp_path):
    box = trimesh.creation.box((80, 60, 50))
    rows = "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*v) for v in box.vertices)
    corners = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*t) for t in box.faces)
    path = tmp_path / "box.3mf"
    with zipfile.ZipFile(path, "w") as file:
        head = '<model unit="inch" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>'
        mesh = f"<mesh><vertices>{rows}</vertices><triangles>{corners}</triangles></mesh>"
        build = '</resources><build><item objectid="1"/></build></model>'
        file.writestr("3D/3dmodel.model", f'{head}<object id="1">{mesh}</object>{build}')
    points = box.sample(20, seed=1)
    (tmp_path / "r.csv").write_text("x_mm,y_mm,z_mm\n" + "\n".join(",".join(f"{x:.3f}" for x in p) for p in points))
    _, _, err = run("locate", tmp_path / "r.csv", "--sd", "0.1mm", "--part", path)
    assert "Did you mean --units mm" in err
    code, out, err = run("locate", tmp_path / "r.csv", "--sd", "0.1mm", "--part", path, "--units", "mm")
    assert code in (0, 3)
    assert "box at x" in out
    assert "Read in mm as requested: the file itself states in." in err
