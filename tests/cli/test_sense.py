"""``tanteo sense``: words, JSON, record and exit codes."""

import json
from pathlib import Path

import numpy as np
import pytest

from tanteo.cli import main
from tanteo.hand.acquisition import features_of
from tanteo.io import read_readings, read_rig

SCENE = str(Path(__file__).parents[2] / "examples" / "scenes" / "bracket.toml")


def run(capsys, *argv):
    with pytest.raises(SystemExit) as end:
        main(["sense", *argv])
    out, err = capsys.readouterr()
    return end.value.code, out, err


def test_a_plane_in_words(capsys):
    code, out, err = run(capsys, "plane", "--scene", SCENE, "-v")
    assert (code, err) == (0, "")
    assert out.startswith("acquired: plane at x ")
    phrases = "mm, outward normal (", "in the world", "mm along the normal", "deg about x", "80 ranges of front_left"
    for words in (*phrases, "s simulated", "the stand-off was 20 mm", "look"):
        assert words in out


@pytest.mark.slow
def test_an_edge_in_json_and_its_record(capsys, tmp_path):
    record = tmp_path / "record.csv"
    code, out, _ = run(capsys, "edge", "--scene", SCENE, "--json", "--record", str(record))
    document = json.loads(out)
    assert code == 0
    assert (document["schema"], document["status"], document["kind"]) == ("tanteo.sensed/1", "acquired", "edge")
    assert document["least_clearance_m"] > 0.01
    replayed, notes = features_of(read_readings(record), read_rig("paper-gripper"))
    assert notes == ()
    for feature in (document["feature"], *document["others"]):
        np.testing.assert_array_equal(feature["T_world_feature"], replayed[feature["label"]].T_world_feature)
    matrix = np.array(document["feature"]["covariance"]["matrix"])
    np.testing.assert_allclose(np.diag(matrix)[[0, 3]], 0)
    assert np.linalg.eigvalsh(matrix).min() > -1e-12


@pytest.mark.slow
def test_seed_and_standoff(capsys):
    options = ((), ("--seed", "1", "--standoff", "20mm"), ("--seed", "2"))
    outs = [run(capsys, "plane", "--scene", SCENE, *more)[1] for more in options]
    assert outs[0] == outs[1] != outs[2]


@pytest.mark.slow
def test_forbidden_boxes_are_kept_out_of(capsys):
    code, out, _ = run(capsys, "plane", "--scene", SCENE, "--forbid", "100,0,0,160,70,250mm", "-v")
    assert code == 3
    assert "forbidden box '100,0,0,160,70,250mm'" in out


@pytest.mark.slow
def test_a_forbidden_box_elsewhere_changes_nothing(capsys):
    elsewhere = "--forbid", "900,0,0,960,70,250mm"
    code, out, _ = run(capsys, "plane", "--scene", SCENE, *elsewhere, "--standoff", "30mm")
    assert code == 0
    assert "the stand-off was 30 mm" in out


def test_what_is_not_acquired_exits_with_three(capsys, tmp_path):
    far = Path(SCENE).read_text(encoding="utf-8").replace("point_mm = [85, 35, 50]", "point_mm = [85, 35, 450]")
    far = far.replace("../parts", str(Path(SCENE).parents[1] / "parts"))
    (tmp_path / "far.toml").write_text(far, encoding="utf-8")
    code, out, _ = run(capsys, "plane", "--scene", str(tmp_path / "far.toml"))
    assert code == 3
    assert out.startswith("nothing: no plane")
    assert "start nearer" in out


def test_the_hand_comes_near_from_out_of_range(capsys, tmp_path):
    far = Path(SCENE).read_text(encoding="utf-8").replace("front_mm = [75, 35, 130]", "front_mm = [75, 35, 400]")
    far = far.replace("../parts", str(Path(SCENE).parents[1] / "parts"))
    (tmp_path / "far.toml").write_text(far, encoding="utf-8")
    code, out, _ = run(capsys, "plane", "--scene", str(tmp_path / "far.toml"), "-v")
    assert code == 0
    steps = [line.split()[2:4] for line in out.splitlines() if line.endswith("at the demanded pose.")]
    assert steps[:2] == [["go", "to"], ["go", "to"]]  # over the place, and down to it


@pytest.mark.parametrize(
    ("argv", "code", "message"),
    [
        (("plane", "--scene", "none.toml"), 1, "expected a scene file"),
        (("vertex", "--scene", SCENE), 1, r"expected a table [sense.vertex]"),
        (("plane", "--scene", SCENE, "--standoff", "20"), 2, "expected a unit"),
        (("plane", "--scene", SCENE, "--standoff", "0mm"), 2, "expected a length of 1 mm to 1 m"),
        (("plane", "--scene", SCENE, "--forbid", "1,2,3mm"), 2, "--forbid: expected two corners"),
        (("plane", "--scene", SCENE, "--forbid", "1,2,3,0,4,5mm"), 2, "expected a low and a high corner"),
        (("plane", "--scene", SCENE, "--seed", "-1"), 2, "--seed: expected 0 or more"),
    ],
)
def test_refusals(capsys, argv, code, message):
    got, out, err = run(capsys, *argv)
    assert (got, out) == (code, "")
    assert message in err
