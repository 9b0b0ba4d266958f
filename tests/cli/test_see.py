"""``tanteo see``: the example images as a new user opens them, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tanteo.io import read_image, write_image

EXAMPLES = Path(__file__).parents[2] / "examples"
IMAGES = EXAMPLES / "images"
CAMERA = IMAGES / "camera.yaml"
PLACED = ("--camera", CAMERA, "--marks", IMAGES / "marks.csv")


@pytest.fixture
def few(tmp_path):
    """Three of the parts."""
    folder = tmp_path / "few"
    folder.mkdir()
    for name in ("clamp", "flange", "housing"):
        (folder / f"{name}.step").write_bytes((EXAMPLES / "parts" / f"{name}.step").read_bytes())
    return folder


LEFT, TOP, SIZE = 190, 230, 200


@pytest.fixture
def close_up(tmp_path):
    """The flange cut out of an example image, and the camera matrix of the cut, which has no place."""
    path = tmp_path / "close_up.png"
    write_image(path, read_image(IMAGES / "three_parts.png")[TOP : TOP + SIZE, LEFT : LEFT + SIZE])
    return path, f"[[620, {{skew}}, {316.8 - LEFT}], [0, 621.86, {242.1 - TOP}], [0, 0, 1]]"


def truth(image):
    rows = [line.split(",") for line in (IMAGES / "truth.csv").read_text().splitlines()[1:]]
    return {row[1]: np.array(row[2:5], dtype=float) * 1e-3 for row in rows if row[0] == image}


def test_a_hidden_part_is_named_and_placed(run, few, tmp_path):
    picture, written = tmp_path / "seen.png", tmp_path / "seen.json"
    targets = ("--picture", picture, "--write-detections", written)
    result = run("see", IMAGES / "half_hidden.png", *PLACED, "--parts", few, *targets)
    assert "clamp at x" in result.out
    assert "Camera fitted to 12 marks" in result.err
    assert read_image(picture).shape == (1000, 1280)  # twice as large, with a legend
    first = json.loads(written.read_text())["detections"][0]
    assert first["header"]["frame_id"] == "world"
    assert first["results"][0]["hypothesis"]["class_id"] == "clamp"


def test_one_document_with_every_object(run, few):
    result = run("see", IMAGES / "three_parts.png", "--parts", few, *PLACED, "--json")
    document = json.loads(result.out)
    assert document["schema"] == "tanteo.recognition/1"
    assert len(document["objects"]) == 3
    assert document["hypotheses"] == document["objects"][0]["hypotheses"]
    places = truth("three_parts")
    for seen in document["objects"]:
        total = seen["unknown_probability"] + sum(h["probability"] for h in seen["hypotheses"])
        assert total <= 1 + 1e-9
        assert seen["region"]["outline"]["area"]["sd"] > 0
    best = [seen["hypotheses"][0] for seen in document["objects"]]
    for part in ("flange", "housing"):
        apart = [np.linalg.norm(np.array(h["pose"]["position_m"]) - places[part]) for h in best if h["part"] == part]
        assert min(apart) < 1.5e-3
    # the bracket is not among these parts
    assert result.code == 3


@pytest.mark.parametrize(
    ("arguments", "code", "word"),
    [
        ((IMAGES / "none.png", *PLACED), 1, "none.png"),
        ((IMAGES / "twins.png", "--camera", IMAGES / "none.yaml"), 1, "none.yaml"),
        ((IMAGES / "twins.png", "--camera", CAMERA, "--marks", CAMERA), 1, "camera.yaml"),
        ((IMAGES / "twins.png", *PLACED, "--top", "0"), 2, "--top"),
        ((IMAGES / "twins.png", *PLACED, "--units", "paces"), 2, "paces"),
        ((IMAGES / "twins.png", *PLACED, "--picture", IMAGES / "seen.unknown"), 2, "suffix"),
    ],
)
def test_what_cannot_be_meant_is_refused(run, parts, arguments, code, word):
    result = run("see", *arguments, "--parts", parts, *(() if "--units" in arguments else ("--units", "mm")))
    assert result.code == code
    assert word in result.err
    assert "Traceback" not in result.err
    assert result.out == ""


@pytest.mark.slow
def test_without_a_place_of_the_camera_poses_are_in_its_frame(run, tmp_path, close_up):
    image, matrix = close_up
    camera = tmp_path / "camera.yaml"
    size = f"image_width: {SIZE}\nimage_height: {SIZE}\n"
    camera.write_text(
        f"{size}camera_matrix: {matrix.format(skew=0)}\ndistortion_coefficients: [-0.12, 0.05, 0, 0, 0]\n"
    )
    part = EXAMPLES / "parts" / "flange.step"
    result = run("see", image, "--camera", camera, "--parts", part)
    assert "flange at x" in result.out
    assert "in the camera;" in result.out
    assert "The pose of the camera is unknown" in result.err
    result = run("see", image, "--camera", camera, "--parts", part, "--json")
    assert {h["pose"]["frame"] for h in json.loads(result.out)["hypotheses"]} == {"camera"}


def test_marks_with_x_and_y_exchanged_are_refused(run, tmp_path):
    marks = tmp_path / "marks.csv"
    marks.write_text((IMAGES / "marks.csv").read_text().replace("x_mm,y_mm", "y_mm,x_mm"))
    result = run("see", IMAGES / "twins.png", "--camera", CAMERA, "--marks", marks, "--parts", EXAMPLES / "parts")
    assert result.code == 1
    assert "exchanged" in result.err
    assert result.out == ""


def test_an_image_may_come_after_the_parts(run, parts):
    result = run("see", "--parts", parts, IMAGES / "none.png", *PLACED, "--units", "mm")
    assert result.code == 1
    assert "none.png" in result.err


@pytest.mark.slow
def test_what_a_camera_file_lacks_is_assumed_with_a_warning(run, tmp_path, close_up):
    """A size and a projection that the file does not have, and a skew."""
    image, matrix = close_up
    camera = tmp_path / "intrinsics.yaml"
    camera.write_text(f"intrinsics: {matrix.format(skew=-0.3)}\n", encoding="utf-8")
    words = ("--camera", camera, "--rectified", "--json")
    got = run("see", image, *words, "--parts", EXAMPLES / "parts" / "flange.step")
    assert got.err.count("warning: ") == 3
    warnings = " ".join(json.loads(got.out)["warnings"])
    for phrase in (f"{SIZE} x {SIZE} pixels, as the image", "no projection_matrix", "the skew of the camera matrix is"):
        assert phrase in warnings
