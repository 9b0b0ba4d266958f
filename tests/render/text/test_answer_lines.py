"""The answer as text and as JSON, from results made by hand."""

import json

import numpy as np
import pytest

from tanteo import __version__
from tanteo.geometry import SE3, SO3
from tanteo.io import recognition_document
from tanteo.io.documents import recognition_json
from tanteo.posterior import Answer, Hypothesis
from tanteo.render.text import answer_lines
from tanteo.words.findings import GivenTwice, NoPart, NothingSensed

T = SE3.from_parts(
    SO3.axis_rotation(2, np.deg2rad(30)) @ SO3.axis_rotation(1, np.deg2rad(20)) @ SO3.axis_rotation(0, np.deg2rad(10)),
    np.array([0.1, -0.02, 0.3]),
)


def hypothesis(**changes):
    values = {
        "part": "bracket",
        "file": "parts/bracket.step",
        "probability": 0.97,
        "T_world_part": T,
        "covariance": np.diag(np.array([1e-3, 2e-3, 3e-3, 0.01, 0.02, 0.03]) ** 2),
        "corner_sd": 3e-4,
        "unobserved": (),
        "symmetry_order": 1,
        "symmetry_poses": np.zeros((0, 4, 4)),
        "chi2": 11.2,
        "dof": 9,
        "p_value": 0.26,
        "rms": 2e-4,
        "outliers": (),
        "pairings": (("1", "plane 12"),),
    }
    return Hypothesis(**(values | changes))


FOUND = GivenTwice("bracket")


def recognition(*hypotheses, status="recognized", unknown=0.03, found=FOUND):
    return Answer(status, (found,), hypotheses, unknown, {"load": 0.4, "search": 0.02, "total": 0.5}, 7)


def test_the_first_line_is_the_answer():
    lines = answer_lines(recognition(hypothesis()))
    assert lines[0] == (
        "bracket at x 100.00 y -20.00 z 300.00 mm, roll 10.00 pitch 20.00 yaw 30.00 deg in the world; "
        "probability 97.0 %, largest corner sd 0.3 mm"
    )
    assert lines[-1] == GivenTwice("bracket").message
    text = "\n".join(lines)
    assert "quaternion  w 0.951549  x 0.038135  y 0.189308  z 0.239298" in text
    assert "sd          x 1  y 2  z 3 mm" in text
    assert "Unknown object: 3.0 %." in text
    assert "It could also be" not in text
    assert "T_world_part" not in text


def test_order_of_what_follows():
    other = hypothesis(part="mirrored [bold]", probability=0.2, T_world_part=np.eye(4))
    best = hypothesis(probability=0.7, outliers=("7", "9"), unobserved=("rotation about part z",), symmetry_order=2)
    text = "\n".join(answer_lines(recognition(best, other, status="ambiguous"), verbose=True))
    marks = [
        "ambiguous, best guess bracket at", "2 equivalent poses", "T_world_part (metres):", "1 on plane 12",
        "It could also be:", "mirrored [bold]", "20.0 %", "Unknown object", "Readings that do not fit: 7, 9.",
        "Not observed: rotation about part z.", "Time: load 0.400 s", GivenTwice("bracket").message,
    ]  # fmt: skip
    assert sorted(marks, key=text.index) == marks


@pytest.mark.parametrize(
    ("status", "start"),
    [("unknown", "unknown, nearest bracket"), ("insufficient", "insufficient, best guess bracket")],
)
def test_undecided_headlines(status, start):
    assert answer_lines(recognition(hypothesis(), status=status))[0].startswith(start)


def test_a_rejection_of_likely_parts_is_reported():
    lines = answer_lines(recognition(hypothesis(), status="unknown", unknown=1e-6))
    assert not any(line.startswith("Unknown object") for line in lines)
    assert any(line.startswith("The goodness-of-fit test rejects every part.") for line in lines)


def test_no_hypothesis_at_all():
    lines = answer_lines(recognition(status="unknown", unknown=1.0, found=NoPart()))
    assert lines[0] == "unknown: no part fits these readings"
    assert "Unknown object: > 99.9 %." in lines
    assert lines[-1] == NoPart().message


def test_no_readings_leave_the_parts_at_their_prior():
    lines = answer_lines(recognition(status="insufficient", unknown=1.0, found=NothingSensed()))
    assert lines == ["insufficient: too little was sensed", "", NothingSensed().message]


@pytest.mark.parametrize(
    ("p", "text"), [(0.99999, "> 99.9 %"), (1.0, "> 99.9 %"), (0.0, "< 0.1 %"), (1e-9, "< 0.1 %"), (0.5, "50.0 %")]
)
def test_probabilities_never_round_to_certainty(p, text):
    assert f"probability {text}" in answer_lines(recognition(hypothesis(probability=p)))[0]


def test_tables_fit_the_width():
    long = hypothesis(part="a very long name of a part " * 8, probability=0.2)
    assert max(map(len, answer_lines(recognition(hypothesis(), long))[1:])) <= 122


def test_control_characters_do_not_reach_the_terminal():
    text = "\n".join(answer_lines(recognition(hypothesis(part="\x1b[31mred", outliers=("\x07",)))))
    assert "\x1b" not in text
    assert "\\x1b[31mred" in text


def test_outliers_have_their_distance():
    lines = answer_lines(recognition(hypothesis(outliers=("7", "9"), outlier_distances=(0.0021, np.nan))))
    assert any("7 (2.1 mm off), 9." in line for line in lines)


def test_same_robot_covariance_is_in_the_words_and_the_document():
    same = hypothesis(covariance_relative=1e-8 * np.eye(6))
    assert any("unshared    x 0.1 y 0.1 z 0.1 mm" in line for line in answer_lines(recognition(same)))
    (h,) = recognition_document(recognition(same))["hypotheses"]
    assert h["covariance_relative"]["order"] == "x y z rx ry rz"


def test_document_follows_the_contract():
    turned = T @ SE3.from_parts(SO3.axis_rotation(2, np.pi), np.zeros(3))
    result = recognition(hypothesis(symmetry_order=2, symmetry_poses=turned[None], outliers=("7",)))
    document = json.loads(recognition_json(result))
    assert document == recognition_document(result)
    assert list(document) == [
        "schema", "version", "seed", "status", "message", "hypotheses", "parts", "unknown_probability",
        "missed_probability", "elapsed_s", "findings",
    ]  # fmt: skip
    assert (document["schema"], document["version"], document["seed"]) == ("tanteo.recognition/1", __version__, 7)
    assert document["elapsed_s"] == {"load": 0.4, "search": 0.02, "total": 0.5}
    (h,) = document["hypotheses"]
    assert list(h) == [
        "part", "file", "probability", "pose", "covariance", "corner_sd_m", "unobserved", "symmetry", "fit",
        "noise_scale", "outliers", "pairings", "outlier_distances_m", "covariance_relative",
    ]  # fmt: skip
    assert list(h["pose"]) == ["frame", "position_m", "quaternion_wxyz", "matrix"]
    np.testing.assert_allclose(h["pose"]["matrix"], T)
    np.testing.assert_allclose(SO3.from_quaternion(h["pose"]["quaternion_wxyz"]), T[:3, :3])
    assert {k: v for k, v in h["covariance"].items() if k != "matrix"} == {
        "order": "x y z rx ry rz", "frame": "part", "perturbation": "right", "units": "m rad",
    }  # fmt: skip
    assert np.shape(h["covariance"]["matrix"]) == (6, 6)
    assert h["symmetry"]["order"] == 2
    np.testing.assert_allclose(h["symmetry"]["poses"][0]["matrix"], turned)
    assert h["fit"] == {"chi2": 11.2, "dof": 9, "p_value": 0.26, "rms_m": 2e-4}
    assert h["outliers"] == ["7"]
    assert h["pairings"] == [{"reading": "1", "feature": "plane 12"}]


def test_json_has_no_nan():
    C = np.diag([1.0, np.inf, 1, 1, 1, np.nan])
    text = recognition_json(recognition(hypothesis(covariance=C, corner_sd=np.inf, part="ä\ud800")))
    document = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} in JSON"))
    assert document["hypotheses"][0]["corner_sd_m"] is None
    assert document["hypotheses"][0]["covariance"]["matrix"][1][1] is None
    assert text.isascii()


def test_no_minus_zero_is_printed():
    slight = SE3.from_parts(SO3.exp(np.array([-1e-7, -2e-7, -1e-7])), np.array([-1e-9, 0.0, -4e-9]))
    assert "-0.0" not in answer_lines(recognition(hypothesis(T_world_part=slight)))[0]
