"""``tanteo sense part --image``: a session that starts from what a camera sees."""

import json
from pathlib import Path

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


def test_the_image_says_where_and_the_hand_says_which(sense):
    """No rough place: the camera alone sends the hand; few readings are left to make."""
    code, out, err = sense("--image", "render", "--json")
    assert code == 0
    document = json.loads(out)
    assert document["hypotheses"][0]["part"] == "step_12mm"
    assert document["sensing"]["readings"] <= 12
    assert document["sensing"]["least_clearance_m"] > 0.006
    first = err.splitlines()[0]
    assert first.startswith("The image: step_1")
    assert "none of these" in first
    assert "It leaves open: sense from above" in first


def test_an_image_from_a_file_and_a_camera_of_its_own(sense):
    """The picture is of another place, where there is nothing to be read: the hand goes there all the same."""
    image = str(EXAMPLES / "images" / "twins.png")
    code, _, err = sense("--image", image, *CAMERA, *MARKS, "--most", "1")
    assert code == 3
    assert "The image: step_1" in err
    assert "of step_1" in err.splitlines()[1]


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (CAMERA, 2, "--camera, --marks: expected with --image"),
        (("--image", "render", *CAMERA), 1, "expected a key T_world_camera, where it stands"),
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
