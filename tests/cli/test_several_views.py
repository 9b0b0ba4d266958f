"""``tanteo see`` and ``identify`` with several images of a camera on the hand."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tanteo.geometry import SE3, SO3
from tanteo.io import write_image
from tanteo.io.poses.hand_eye_file import hand_eye_yaml
from tanteo.parts import read_part
from tanteo.vision.camera import Mounting
from vision_scenes import hand_views

PARTS = Path(__file__).parents[2] / "examples" / "parts"
SDS = 5e-4, float(np.radians(0.05))


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    """Files of three images of a floating part by a camera on the hand, with its pose and a few touches."""
    folder = tmp_path_factory.mktemp("cell")
    part, rng = read_part(PARTS / "step_12mm.step"), np.random.default_rng(2)
    T = SE3.from_parts(SO3.exp(np.array([0.4, -0.5, 0.3])), np.array([0.4, 0.1, 0.3]))
    spread = np.diag(np.repeat(np.square(SDS), 3))
    mounting = Mounting(SE3.exp(np.array([0.03, 0.0, 0.05, 0.0, 0.0, 0.7])), spread)
    views = hand_views(part, T, mounting, np.repeat(SDS, 3) * np.array([1.0, -1, 0.5, 0.5, -0.5, 1]), rng)
    rows = ["image,hand_x_mm,hand_y_mm,hand_z_mm,hand_qw,hand_qx,hand_qy,hand_qz,hand_sd_mm,hand_sd_deg"]
    for k, view in enumerate(views):
        write_image(folder / f"{k}.png", view.pixels.astype(np.uint8))
        hand = view.camera.T_world_camera @ SE3.inverse(mounting.T_hand_camera)
        numbers = [*(1e3 * hand[:3, 3]), *SO3.as_quaternion(hand[:3, :3]), 0.05, 0.01]
        rows.append(",".join([f"{k}.png", *(f"{value:.6f}" for value in numbers)]))
    (folder / "hands.csv").write_text("\n".join([rows[0], *rows[:0:-1]]))  # the column image names the rows
    (folder / "camera.yaml").write_text(
        "image_width: 640\nimage_height: 480\ncamera_matrix: {rows: 3, cols: 3, data: [1000, 0, 319.5, 0, 1000, 239.5, "
        "0, 0, 1]}\ndistortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n"
    )
    (folder / "hand_eye.yaml").write_text(
        hand_eye_yaml(
            mounting.T_hand_camera, spread, on_hand=True, hand="tool0", camera="camera", base="base", target="target"
        )
    )
    normals = np.cross(*np.diff(part.vertices[part.triangles], axis=1).swapaxes(0, 1))
    areas = np.linalg.norm(normals, axis=1)
    chosen = rng.choice(len(areas), 10, replace=False, p=areas / areas.sum())
    a, b, c = part.vertices[part.triangles][chosen].swapaxes(0, 1)
    points = 1e3 * SE3.apply(T, (a + b + c) / 3)
    (folder / "touches.csv").write_text(
        "x_mm,y_mm,z_mm\n" + "".join("{:.4f},{:.4f},{:.4f}\n".format(*p) for p in points)
    )
    return folder, part, T


def options(folder, *names):
    files = [folder / name for name in ("0.png", "1.png", "2.png")]
    hand = (
        "--camera",
        folder / "camera.yaml",
        "--hand-poses",
        folder / "hands.csv",
        "--hand-eye",
        folder / "hand_eye.yaml",
    )
    return [*files[: len(names) or 3], *hand]


def place_of(document, T):
    """Return the distance of the best answer from the true pose in its deviations, and in metres."""
    best = document["hypotheses"][0]
    gap = np.array(best["pose"]["matrix"])[:3, 3] - T[:3, 3]
    return float(np.linalg.norm(gap))


def test_three_views_of_a_hand_camera_place_a_part(run, cell):
    folder, _, T = cell
    parts = ("--parts", PARTS / "step_12mm.step", PARTS / "wedge.step")
    done = run("see", *options(folder), "--no-table", *parts, "--picture", folder / "seen.png", "--json")
    document = json.loads(done.out)
    assert document["objects"][0]["status"] == "recognized"
    assert document["hypotheses"][0]["part"] == "step_12mm"
    assert place_of(document, T) < 2e-3
    assert (folder / "seen.png").exists()


@pytest.mark.slow
def test_views_and_touches_are_one_posterior(run, cell):
    folder, _, T = cell
    shown = [word for k in range(2) for word in ("--image", folder / f"{k}.png")]
    hand = options(folder)[3:]
    given = ("--sd", "0.1mm", "--parts", PARTS / "step_12mm.step", PARTS / "wedge.step", "--json")
    alone = json.loads(run("identify", folder / "touches.csv", *given).out)
    both = json.loads(run("identify", folder / "touches.csv", *shown, *hand, "--no-table", *given).out)
    assert both["status"] == "recognized"
    assert both["hypotheses"][0]["part"] == "step_12mm"
    assert place_of(both, T) < 1e-3
    sizes = [np.trace(np.array(d["hypotheses"][0]["covariance"]["matrix"])[:3, :3]) for d in (alone, both)]
    assert sizes[1] < sizes[0]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda words: words[:-2], "expected both"),
        (lambda words: ["missing.png", *words], "missing.png"),
        (lambda words: [*words, "--marks", "marks.csv"], "expected none beside --hand-eye"),
        (lambda words: [*words, "--hand-eye-sd", "1mm"], "1mm,0.2deg"),
    ],
)
def test_misuse_of_hand_poses_is_named(run, cell, change, words):
    result = run("see", *change(options(cell[0])), "--parts", PARTS / "wedge.step")
    assert result.code != 0
    assert words in result.err


def test_a_mounting_without_covariance_needs_one(run, cell, tmp_path):
    folder, *_ = cell
    text = (folder / "hand_eye.yaml").read_text()
    (tmp_path / "hand_eye.yaml").write_text(text.partition("\n")[2])  # as other programs write it
    words = [*options(folder)[:-1], tmp_path / "hand_eye.yaml", "--no-table", "--parts", PARTS / "wedge.step"]
    result = run("see", *words)
    assert "--hand-eye-sd 1mm,0.2deg" in result.err


def test_images_need_a_row_of_poses_each(run, cell, tmp_path):
    folder, *_ = cell
    rows = (folder / "hands.csv").read_text().splitlines()
    (tmp_path / "hands.csv").write_text("\n".join(row.partition(",")[2] for row in rows[:-1]))
    words = options(folder)
    words[words.index(folder / "hands.csv")] = tmp_path / "hands.csv"
    result = run("see", *words, "--parts", PARTS / "wedge.step")
    assert "one row for each image (3), got 2" in result.err
