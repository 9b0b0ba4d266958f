"""Logs of other programs on the command line: the same answer as from a table, and the options that each log needs."""

from __future__ import annotations

import json

import numpy as np
import pytest

POINTS = np.array([[20, 20, 30], [40, 10, 30], [10, 30, 30], [0, 20, 10], [0, 10, 20], [30, 0, 15], [50, 0, 20],
                   [20, 40, 10], [30, 40, 25], [30, 20, 0], [10, 10, 0]], dtype=float)  # fmt: skip
"""Touches of the wedge all around, in millimetres."""


def save(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    return path


def rows(values):
    return "".join(" ".join(f"{x:.6f}" for x in row) + "\n" for row in values)


@pytest.fixture
def wedge(parts):
    return "--part", parts / "wedge.stl", "--units", "mm", "--sd", "0.1mm"


def located(result):
    return json.loads(result.out)["hypotheses"][0]["pose"]["position_m"]


def test_a_log_and_a_cloud_give_the_answer_of_a_table(run, wedge, tmp_path):
    table = save(tmp_path, "t.csv", "x_mm,y_mm,z_mm\n" + rows(POINTS).replace(" ", ","))
    log = save(tmp_path, "log.txt", rows(np.c_[POINTS, np.zeros((len(POINTS), 6))]))
    head = f"ply\nformat ascii 1.0\nelement vertex {len(POINTS)}\n"
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    cloud = save(tmp_path, "cloud.ply", head + axes + "end_header\n" + rows(POINTS))
    expected = located(run("locate", table, *wedge, "--json"))
    for path, more in ((log, ["--radius", "0mm"]), (cloud, [])):
        result = run("locate", path, *wedge, *more, "--json")
        np.testing.assert_allclose(located(result), expected, atol=1e-5)
        assert "--units mm applies to the readings and to the parts" in result.err


def test_missing_facts_of_a_log_are_requested_before_parts(run, tmp_path):
    log = save(tmp_path, "log.txt", rows(np.c_[POINTS, np.zeros((len(POINTS), 6))]))
    result = run("locate", log, "--part", "none.step")
    assert result.code == 1
    assert "expected --units and --radius with a LinuxCNC probe log (PROBEOPEN)" in result.err
    assert "none.step" not in result.err


def test_notes_of_the_file_are_warnings(run, wedge, tmp_path):
    text = "".join("[PRB:{},{},{}:1]\n".format(*p) for p in POINTS) + "[PRB:0,0,-9:0]\n"
    result = run("locate", save(tmp_path, "grbl.log", text), *wedge, "--radius", "0mm", "--json")
    assert "warning: 1 probe made no contact" in result.err
    assert any("1 probe made no contact" in note for note in json.loads(result.out)["warnings"])


@pytest.mark.parametrize(
    ("args", "code", "message"),
    [
        (["--format", "grlb"], 2, "--format: expected one of csv"),
        (["--radius", "-1mm"], 2, "--radius: expected a length of zero to 1 m"),
        (["--direction", "sideways"], 2, "--direction: expected down, -z"),
        (["--tool", "0,0mm"], 2, "--tool: expected x, y, z"),
        (["--hand", "0,0,0mm"], 2, "--hand: expected x, y, z and roll, pitch, yaw"),
        (["--brand", "kukka"], 2, "--brand: expected one of"),
        (["--brand", "kukka"], 2, "Did you mean 'kuka'"),
        (["--max-points", "0"], 2, "--max-points: expected 1 or more"),
        (["--format", "dmis"], 1, "expected measured points"),
        (["--direction", "tool"], 1, "expected poses of the hand for --direction tool"),
    ],
)
def test_options_that_cannot_be(run, wedge, tmp_path, args, code, message):
    table = save(tmp_path, "t.csv", "x_mm,y_mm,z_mm\n" + rows(POINTS).replace(" ", ","))
    result = run("locate", table, *wedge, *args)
    assert result.code == code
    assert message in result.err


def test_a_mesh_is_a_file_of_readings_only_if_stated(run, wedge, tmp_path):
    head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    mesh = save(
        tmp_path, "m.ply",
        head + "element face 1\nproperty list uchar int vertex_indices\nend_header\n" + rows(POINTS[:3]) + "3 0 1 2\n",
    )  # fmt: skip
    refused = run("locate", mesh, *wedge)
    assert refused.code == 1
    assert "Use --format ply for a cloud" in refused.err
    taken = run("locate", mesh, *wedge, "--format", "ply")
    assert "It is a mesh of 1 faces: its vertices are taken as points." in taken.err
