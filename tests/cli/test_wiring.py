"""From the command line to ``identify`` and back: arguments in SI units, one document, exit codes, warnings."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest

from tanteo.posterior import Answer, Hypothesis
from tanteo.words.findings import NoPart

READINGS = (
    "x_mm,y_mm,z_mm,hand_x_mm,hand_y_mm,hand_z_mm,hand_qw,hand_qx,hand_qy,hand_qz\n"
    "0,0,10,0,0,50,1,0,0,0\n10,0,20,0,0,50,1,0,0,0\n20,0,5,0,0,50,1,0,0,0\n"
)


@pytest.fixture
def readings(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text(READINGS)
    return path


@pytest.fixture
def identified(monkeypatch):
    """A stand-in for the search: it records its arguments and answers with a given status."""
    calls = []

    def answer(status="recognized"):
        def identify(readings, parts, **options):
            calls.append((readings, parts, options))
            best = Hypothesis(
                parts[0].name, parts[0].source, 0.9, np.eye(4), np.eye(6) * 1e-6, 1e-3, (), 1, np.zeros((0, 4, 4)),
                1.0, 2, 0.6, 1e-4, (), (),
            )  # fmt: skip
            return Answer(status, (NoPart(),), (best,), 0.1, {"search": 0.01, "total": 0.02}, options["seed"])

        monkeypatch.setattr("tanteo.recognition.identify", identify, raising=False)
        return calls

    return answer


def test_arguments_arrive_in_si_units(run, readings, parts, identified):
    calls = identified()
    result = run(
        "identify", readings, "--parts", parts / "wedge.stl", parts / "block.stl", "--units", "mm", "--sd", "200um",
        "--form-sd", "0.1mm", "--tip-sd", "1.5,1.5,0.3mm", "--robot", "xarm", "--sensor", "ball_tip_on_cobot",
        "--significance", "0.05", "--top", "3", "--seed", "11", "--as-published",
    )  # fmt: skip
    assert (result.code, result.err) == (0, "")
    ((got, given, options),) = calls
    assert len(got) == 3
    assert sorted(p.name for p in given) == ["block", "wedge"]
    assert options.pop("tip_sd") == pytest.approx((1.5e-3, 1.5e-3, 3e-4))
    assert options == {
        "sensor": "ball_tip_on_cobot", "sd": pytest.approx(2e-4), "tolerance": pytest.approx(1e-4), "robot": "xarm",
        "rig": None, "significance": 0.05, "top": 100, "as_published": True, "priors": None, "seed": 11,
        "shared_errors": (), "conventions": False, "factors": (), "views": (), "count": None,
    }  # fmt: skip


def test_locate_is_identify_with_one_part(run, readings, parts, identified):
    calls = identified()
    result = run("locate", readings, "--part", parts / "wedge.stl", "--units", "mm", "--sd", "1mm")
    assert result.code == 0
    assert result.out.startswith("wedge at x 0.00 y 0.00 z 0.00 mm")
    assert [p.name for p in calls[0][1]] == ["wedge"]


@pytest.mark.parametrize("command", ["identify", "locate"])
def test_what_is_known_of_the_pose_arrives(run, readings, parts, identified, command):
    calls = identified()
    part = ["--parts" if command == "identify" else "--part", parts / "wedge.stl"]
    result = run(
        command, readings, *part, "--units", "mm", "--sd", "1mm", "--table", "-5+-1mm", "--box", "-1,-2,-3,4,5,6mm",
        "--pose-prior", "ur 0.1,0.2,0.3,0,0,0 +- 5mm 3deg",
    )  # fmt: skip
    assert (result.code, result.err) == (0, "")
    pose = calls[0][2]["priors"].pose
    assert (pose.table.point[2], pose.table.sd) == pytest.approx((-5e-3, 1e-3))
    np.testing.assert_allclose(pose.box, [[-1e-3, -2e-3, -3e-3], [4e-3, 5e-3, 6e-3]])
    np.testing.assert_allclose(pose.T_world_part[:3, 3], [0.1, 0.2, 0.3])
    np.testing.assert_allclose(np.sqrt(np.diag(pose.covariance)), [*[5e-3] * 3, *[np.radians(3)] * 3])


@pytest.mark.parametrize(("status", "code"), [("recognized", 0), ("ambiguous", 3), ("unknown", 3), ("insufficient", 3)])
def test_exit_codes_and_streams(run, readings, parts, identified, status, code):
    identified(status)
    args = ["identify", readings, "--parts", parts, "--units", "mm", "--sd", "1mm"]
    plain = run(*args)
    assert (plain.code, plain.err) == (code, "")
    message = plain.out.splitlines()[-1]
    assert message.startswith("None of the parts explains the readings.")
    assert ("Sense face" in message) == (status in ("ambiguous", "insufficient"))  # then one more reading can decide
    both = run(*args, "--json")
    document = json.loads(both.out, parse_constant=pytest.fail)
    assert both.code == code
    assert document["status"] == status
    assert set(document["elapsed_s"]) == {"load", "search", "conventions", "total"}
    assert document["elapsed_s"]["total"] >= document["elapsed_s"]["load"] > 0
    assert both.err == ("" if code == 0 else f"{status}: {message}\n")
    assert document["message"] == message


def test_a_part_that_cannot_be_read_is_a_warning_beside_others(run, readings, parts, identified):
    calls = identified()
    (parts / "broken.stl").write_bytes(b"\0" * 80 + struct.pack("<I", 0))
    result = run("identify", readings, "--parts", parts, "--units", "mm", "--sd", "1mm", "--json")
    assert result.code == 0
    assert result.err.startswith("warning: broken.stl")
    assert len(calls[0][1]) == 2
    json.loads(result.out)


def test_readings_may_come_after_the_parts(run, readings, parts, identified):
    calls = identified()
    result = run(
        "identify", "--sd", "1mm", "--units", "mm", "--parts", parts / "wedge.stl", parts / "block.stl", readings
    )
    assert result.code == 0
    assert len(calls[0][1]) == 2


def test_a_rig_arrives(run, tmp_path, parts, identified):
    calls = identified()
    (tmp_path / "rig.toml").write_text(
        '[sensors.eye]\npreset = "vl53l0x"\nposition_mm = [0, 0, 50]\ndirection = [0, 0, 1]\n'
    )
    (tmp_path / "r.csv").write_text(
        "range_mm,sensor,status,hand_x_mm,hand_y_mm,hand_z_mm,hand_qw,hand_qx,hand_qy,hand_qz\n"
        "100,eye,,0,0,0,1,0,0,0\n,eye,none,0,0,0,1,0,0,0\n"
    )
    result = run("identify", tmp_path / "r.csv", "--parts", parts, "--units", "mm", "--rig", tmp_path / "rig.toml")
    assert (result.code, result.err) == (0, "")
    readings, _, options = calls[0]
    assert [s.name for s in options["rig"].sensors] == ["eye"]
    assert readings.is_free.tolist() == [False, True]


def test_readings_much_smaller_than_the_parts_are_a_warning(run, tmp_path, readings, parts, identified):
    identified()
    readings.write_text(READINGS.replace("x_mm,y_mm,z_mm,", "x_um,y_um,z_um,", 1))
    result = run("identify", readings, "--parts", parts, "--units", "mm", "--sd", "1um")
    assert result.code == 0
    assert result.err.startswith("warning: All readings lie within 0.0")
