"""``tanteo sense part --image``: a session that starts from a camera image."""

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("cv2")

EXAMPLES = Path(__file__).parents[2] / "examples"
SCENE = EXAMPLES / "scenes" / "part_seen.toml"
CAMERA = ("--camera", str(EXAMPLES / "images" / "camera.yaml"))
MARKS = ("--marks", str(EXAMPLES / "images" / "marks.csv"))
PARTS = ["--parts", *(str(EXAMPLES / "parts" / f"step_{n}mm.step") for n in (12, 15))]


@pytest.fixture
def sense(run):
    return lambda *options, scene=SCENE: run("sense", "part", "--scene", str(scene), *PARTS, *options)


@pytest.mark.slow
def test_the_image_gives_the_pose_and_the_hand_the_part(sense):
    """No prior pose: the camera alone sends the hand; few readings are left to make."""
    code, out, err = sense("--image", "render", "--json")
    assert code == 0
    document = json.loads(out)
    assert document["hypotheses"][0]["part"] == "step_12mm"
    assert document["sensing"]["readings"] <= 12
    assert document["sensing"]["least_clearance_m"] > 0.006
    first = err.splitlines()[0]
    assert first.startswith("The image: step_1")
    assert "unknown object" in first
    assert "To decide, sense from above" in first


def test_an_image_from_a_file_and_a_camera_of_its_own(sense):
    """The picture shows another place, where no reading is possible: the hand goes there all the same."""
    image = str(EXAMPLES / "images" / "twins.png")
    code, _, err = sense("--image", image, *CAMERA, *MARKS, "--max-measurements", "1")
    assert code == 3
    assert "The image: step_1" in err
    assert "of step_1" in err.splitlines()[1]


@pytest.mark.parametrize("json_too", [(), ("--json",)])
def test_an_image_that_shows_nothing_is_an_answer(sense, tmp_path, json_too):
    """A table without a part is no failure of the program: the answer is unknown, and no hand is sent."""
    import cv2

    image = tmp_path / "table.png"
    cv2.imwrite(str(image), np.full((480, 640), 120, dtype=np.uint8))
    code, out, err = sense("--image", str(image), *json_too)
    assert code == 3
    assert "The image shows no part." in err
    if json_too:
        document = json.loads(out)
        assert (document["status"], document["hypotheses"], document["unknown_probability"]) == ("unknown", [], 1.0)
    else:
        assert out.startswith("unknown: The image shows no part on the table")


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (CAMERA, 2, "--camera, --marks: expected with --image"),
        (("--image", "render", *CAMERA), 1, "expected a key T_world_camera, the pose of the camera"),
        (("--image", "/no/such.png"), 1, "expected an image"),
        (("--image", "render", "--camera", "/no/such.yaml"), 1, "expected a calibration file"),
    ],
)
def test_refusals(sense, options, code, message):
    got, out, err = sense(*options)
    assert (got, out) == (code, "")
    assert message in err


def test_a_scene_needs_a_camera_and_a_table_for_its_own_image(sense, tmp_path):
    scene = EXAMPLES / "scenes" / "part_unknown.toml"
    code, _, err = sense("--image", "render", scene=scene)
    assert code == 1
    assert "expected a table [camera]" in err
    text = SCENE.read_text().replace("[table]\ntop_mm = 0\n", "").replace('"../', f'"{EXAMPLES}/')
    bare = tmp_path / "bare.toml"
    bare.write_text(text)
    code, _, err = sense("--image", "render", scene=bare)
    assert code == 1
    assert "expected a table [table] on which the part lies" in err


@pytest.fixture
def feature(run):
    return lambda kind, *options: run("sense", kind, "--scene", str(SCENE), *options, "--standoff", "20mm")


@pytest.mark.slow
def test_a_face_is_gone_to_where_the_image_puts_it(feature):
    """The hand starts out of range of everything; the sensed place agrees with the image, within both spreads."""
    code, out, err = feature("plane", *PARTS, "--image", "render", "--json")
    assert code == 0
    assert "The hand goes to face 6 of step_12mm, P = 0." in err
    document = json.loads(out)
    expected, T = document["expected"], np.array(document["feature"]["T_world_feature"])
    assert expected["name"] == "face 6"
    assert 0 < expected["sd_m"] < 2e-3
    off = (np.array(expected["point"]) - T[:3, 3]) @ T[:3, 2]
    assert abs(off) < 4 * np.hypot(expected["sd_m"], np.sqrt(document["feature"]["covariance"]["matrix"][2][2]))
    assert document["least_clearance_m"] > 0.005


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (("--image", "render"), 2, "--image: expected with --parts"),
        (PARTS, 2, "--parts, --face, --units: expected with --image"),
        pytest.param(
            ("--parts", str(EXAMPLES / "parts" / "flange.step"), "--image", "render"),
            1,
            "got an unknown object with",
            marks=pytest.mark.slow,
        ),
        (
            (*PARTS, "--image", "render", "--face", "face 99"),
            1,
            "expected face 'face 99' that faces the hand, got faces:",
        ),
    ],
)
def test_ideas_that_an_image_cannot_give(feature, options, code, message):
    got, out, err = feature("edge", *options)
    assert (got, out) == (code, "")
    assert message in err
