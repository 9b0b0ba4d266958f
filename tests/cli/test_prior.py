"""``--table``, ``--box``, ``--pose-prior``, ``--prior``: from the command line to the answer."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tanteo.geometry import SE3, SO3

FILE = "[pose_prior]\nposition_mm = [300, 100, 20]\nturn_deg = [0, 0, 30]\nsd_mm = 3\nturn_sd_deg = 3\n"
NEAR = "300,100,20mm 0,0,30deg +- 3mm 3deg"
TRUTH = SE3.from_parts(SO3.axis_rotation(2, np.radians(31.0)), np.array([0.301, 0.099, 0.02]))


@pytest.fixture
def corner(tmp_path):
    """Eight touches about one corner of the block, which fit at other corners as well [mm]."""
    rng = np.random.default_rng(1)
    local = np.array([[90, 20, 5], [90, 30, 12], [90, 40, 8], [70, 50, 6], [80, 50, 14], [60, 50, 9], [70, 20, 20],
                      [80, 30, 20]]) * 1e-3  # fmt: skip
    points = 1e3 * SE3.apply(TRUTH, local) + 0.05 * rng.normal(size=local.shape)
    path = tmp_path / "touches.csv"
    path.write_text("x_mm,y_mm,z_mm\n" + "".join(",".join(map(repr, p)) + "\n" for p in points.tolist()))
    return path


@pytest.fixture
def locate(run, corner, parts):
    def call(*args):
        return run("locate", corner, "--part", parts / "block.stl", "--units", "mm", "--sd", "0.05mm", *args)

    return call


def pose(result):
    return np.array(json.loads(result.out)["hypotheses"][0]["pose"]["matrix"])


def test_a_prior_pose_decides_what_touches_leave_open(locate, tmp_path):
    open_ = locate("--json")
    assert open_.code == 3
    (tmp_path / "prior.toml").write_text(FILE)
    for args in (("--pose-prior", NEAR), ("--prior", tmp_path / "prior.toml")):
        known = locate("--json", *args)
        assert known.code == 0, known.err
        gap = SE3.log(SE3.inverse(TRUTH) @ pose(known))
        assert np.linalg.norm(gap[:3]) < 1e-3
        assert np.linalg.norm(gap[3:]) < 0.02


def test_the_answer_states_its_prior(locate):
    result = locate("--pose-prior", NEAR, "--table", "20+-1mm", "--box", "200,0,0,400,300,100mm")
    (line,) = [line for line in result.out.splitlines() if line.startswith("  known")]
    assert line.split(maxsplit=1)[1] == (
        "rests on a table at z 20 mm (sd 1 mm); in the box from (200, 0, 0) to (400, 300, 100) mm; "
        "near (300, 100, 20) mm, roll pitch yaw (0, 0, 30) deg (sd up to 3 mm, 3 deg)"
    )
    assert "  known" not in locate().out


def test_a_prior_that_is_wrong_is_named_as_a_reason(locate):
    result = locate("--box", "900,900,0,990,990,50mm")
    assert result.code == 3
    assert result.out.startswith("unknown")
    assert "it is not at the prior pose" in result.out
    assert "not at the prior pose" not in locate("--pose-prior", NEAR).out


def test_planes_of_a_fixture_from_options_and_file(locate, tmp_path):
    (tmp_path / "jaw.toml").write_text("[[rests]]\npoint_mm = [0, 0, 20]\nnormal = [0, 0, 1]\nsd_mm = 1\n")
    stated = "touches a plane at (0, 0, 20) mm, normal (0, 0, 1), (sd 1 mm)"
    for args in (("--rests", "0,0,20mm 0,0,1 +- 1mm"), ("--prior", tmp_path / "jaw.toml")):
        result = locate("--pose-prior", NEAR, *args)
        assert (result.code, stated in result.out) == (0, True), result.err


def test_options_and_file_together(locate, tmp_path):
    (tmp_path / "prior.toml").write_text("[table]\ntop_mm = 20\nsd_mm = 1\n")
    both = locate("--prior", tmp_path / "prior.toml", "--pose-prior", NEAR)
    assert both.code == 0
    assert "rests on a table at z 20 mm (sd 1 mm); near (300, 100, 20) mm" in both.out


@pytest.mark.parametrize(
    ("args", "code", "message"),
    [
        (["--table", "0mm"], 2, "--table: expected a value and its standard deviation"),
        (["--table", "-5+-1"], 2, "--table: expected a unit"),
        (["--rests", "0,0,0mm 1,0 +- 1mm"], 2, "--rests: expected a normal of three numbers, got '1,0'"),
        (["--rests", "0,0,0mm 1,0,0 +- 1mm", "--rests", "9,0,0mm -1,0,0 +- 1mm"], 2, "--rests: expected at most three"),
        (["--box", "1,2,3mm"], 2, "--box: expected six lengths"),
        (["--pose-prior", "1,2,3mm +- 1mm"], 2, "--pose-prior: expected x, y, z and roll, pitch, yaw"),
        (["--pose-prior", NEAR, "--as-published"], 2, "--as-published: expected no prior knowledge of the pose"),
        (["--prior", "none.toml"], 1, "none.toml: expected"),
        (["--prior", "prior.toml"], 1, "prior.toml, table: expected top_mm"),
        (["--prior", "near.toml", "--pose-prior", NEAR], 2, "--pose-prior: expected it once, got it in near.toml too"),
    ],
)
def test_misuse(locate, tmp_path, monkeypatch, args, code, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "prior.toml").write_text("[table]\nsd_mm = 1\n")
    (tmp_path / "near.toml").write_text(FILE)
    result = locate(*args)
    assert (result.code, result.out) == (code, "")
    assert result.err.startswith("error: ")
    assert message in result.err


def test_what_is_not_known_for_certain_is_a_warning(locate, corner, tmp_path):
    """An unverified angle convention; a sensor without known errors, though its name is nearly a known one."""
    warned = locate("--pose-prior", "epson 300,100,20,30,0,0 +- 3mm 3deg")
    assert "--pose-prior: the angle convention of epson (X Y Z U V W) was not verified" in warned.err
    path = tmp_path / "near.toml"
    path.write_text("[pose_prior]\nepson = [300, 100, 20, 30, 0, 0]\nsd_mm = 3\nturn_sd_deg = 3\n")
    warned = locate("--prior", str(path))
    assert f"{path}, near: the angle convention of epson (X Y Z U V W) was not verified" in warned.err
    assert "convention" not in locate("--pose-prior", "kuka 300,100,20,30,0,0 +- 3mm 3deg").err
    rows = corner.read_text().splitlines()
    for name, words in (("vl53l0", "Did you mean 'vl53l0x'?"), ("vl53l0x", ""), ("left", "")):
        corner.write_text("\n".join([rows[0] + ",sensor", *(f"{row},{name}" for row in rows[1:]), ""]))
        warnings = locate("--pose-prior", NEAR).err
        assert words in warnings
        assert bool(words) == ("column sensor" in warnings)
