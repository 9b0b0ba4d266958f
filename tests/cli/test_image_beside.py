"""``tanteo identify --image``: an image of the object beside its readings."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from tanteo.geometry import SE3, SO3
from tanteo.parts import read_part

EXAMPLES = Path(__file__).parents[2] / "examples"
IMAGE, CAMERA, MARKS = (EXAMPLES / "images" / name for name in ("three_parts.png", "camera.yaml", "marks.csv"))
SEEN = ("--image", IMAGE, "--camera", CAMERA, "--marks", MARKS)


def pose_of(name):
    """Return the true pose of a part in the image."""
    rows = [line.split(",") for line in (EXAMPLES / "images" / "truth.csv").read_text().splitlines()[1:]]
    (row,) = [row for row in rows if row[:2] == ["three_parts", name]]
    place, (w, *v) = np.array(row[2:5], dtype=float) * 1e-3, np.array(row[5:], dtype=float)
    length = np.linalg.norm(v)
    turn = np.array(v) / length * 2 * np.arctan2(length, w)
    return SE3.from_parts(SO3.exp(turn), place)


@pytest.fixture(scope="module")
def readings(tmp_path_factory):
    """Five points of the housing in the image, which leave open what they are of."""
    part, rng = read_part(EXAMPLES / "parts" / "housing.step"), np.random.default_rng(3)
    corners = part.vertices[part.triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    a, b, c = corners[rng.choice(len(corners), 5, p=areas / areas.sum())].transpose(1, 0, 2)
    u, v = np.sort(rng.uniform(size=(2, 5, 1)), axis=0)
    points = 1e3 * SE3.apply(pose_of("housing"), u * a + (v - u) * b + (1 - v) * c)
    file = tmp_path_factory.mktemp("readings") / "five.csv"
    rows = [",".join(f"{x:.3f}" for x in p) for p in points + rng.normal(0, 0.1, (5, 3))]
    file.write_text("\n".join(["x_mm,y_mm,z_mm", *rows, ""]))
    return file


@pytest.fixture
def few(tmp_path):
    folder = tmp_path / "few"
    folder.mkdir()
    for name in ("block", "housing", "step_12mm", "wedge"):
        (folder / f"{name}.step").write_bytes((EXAMPLES / "parts" / f"{name}.step").read_bytes())
    return folder


def shares(run, *args):
    """Return the probability of every part, and the message."""
    done = run("identify", *args, "--sd", "0.1mm", "--json")
    assert done.out, done.err
    out: dict[str, float] = {}
    for h in json.loads(done.out)["hypotheses"]:
        out[h["part"]] = out.get(h["part"], 0.0) + h["probability"]
    return out, done.err


@pytest.mark.slow
def test_an_image_changes_the_odds_of_the_parts(run, readings, few):
    alone, _ = shares(run, readings, "--parts", few, "--top", "50")
    seen, shares_stated = shares(run, readings, "--parts", few, "--top", "50", *SEEN)
    assert max(alone.values()) < 0.9
    assert max(seen, key=seen.get) == "housing"
    assert seen["housing"] > 2 * alone.get("housing", 0.0)
    assert "px of the image (of 3)" in shares_stated
    assert "Parts that fit its outline: 1 of 4" in shares_stated


@pytest.mark.slow
def test_several_images_take_one_camera_or_one_each(run, readings, few):
    """The same image twice: as plumbing, not as evidence."""
    both, shares_stated = shares(run, readings, "--parts", few, *SEEN, "--image", IMAGE)
    assert max(both, key=both.get) == "housing"
    assert shares_stated.count("px of the image (of 3)") == 2


def test_readings_of_another_place_are_refused(run, few, tmp_path):
    file = tmp_path / "away.csv"
    for rows, words in (
        ("900,900,0\n910,900,0\n900,910,0\n", "expected the places of the readings in it, got 0 of 3"),
        ("-120,-120,0\n-120,-119,0\n-119,-120,0\n", "expected an object where the readings are, got 3 elsewhere"),
    ):
        file.write_text("x_mm,y_mm,z_mm\n" + rows)
        done = run("identify", file, "--parts", few, "--sd", "0.1mm", *SEEN)
        assert (done.code, done.out) == (1, "")
        assert words in done.err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--image", IMAGE), "--image: expected --camera beside it"),
        (("--image", IMAGE, "--camera", CAMERA), "--camera: expected the camera.s pose .* --marks FILE"),
        (("--camera", CAMERA, "--marks", MARKS), "--image: expected an image beside --camera"),
        ((*SEEN, "--as-published"), "--as-published: expected only readings"),
        (
            (*SEEN, "--image", IMAGE, "--image", IMAGE, "--camera", CAMERA),
            r"--camera: expected one for all images or one each \(3\), got 2",
        ),
    ],
)
def test_half_of_an_image_is_refused(run, readings, few, options, words):
    done = run("identify", readings, "--parts", few, "--sd", "0.1mm", *options)
    assert (done.code, done.out) == (2, "")
    assert re.search(words, " ".join(done.err.split()))
