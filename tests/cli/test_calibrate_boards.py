"""``tanteo calibrate hand-eye --board``: from images of a board and poses of the hand to the pose of the camera."""

from __future__ import annotations

import json

import numpy as np
import pytest

from board_images import CAMERA, cell_of_boards
from tanteo import io
from tanteo.geometry import SE3, SO3
from tanteo.vision.boards import Board

BOARD = Board("charuco", 7, 5, 0.03, 0.022, "DICT_5X5_100")
TEXT = "charuco:7x5,30mm,22mm,5X5_100"


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    """Files of eleven images, one of them without the board, and the pose of the camera on the hand."""
    folder = tmp_path_factory.mktemp("boards")
    hands, images, X = cell_of_boards(BOARD, 10, np.random.default_rng(3))
    images.insert(4, np.full(images[0].shape, 90.0))
    hands.insert(4, hands[0])
    lines = ["image,hand_x_mm,hand_y_mm,hand_z_mm,hand_qw,hand_qx,hand_qy,hand_qz"]
    for k, (hand, image) in enumerate(zip(hands, images, strict=True)):
        io.write_image(str(folder / f"{k:02}.png"), image.astype(np.uint8))
        lines.append(",".join([f"{k:02}.png", *map(str, [*(1e3 * hand[:3, 3]), *SO3.as_quaternion(hand[:3, :3])])]))
    (folder / "hands.csv").write_text("\n".join(lines) + "\n")
    camera = {
        "camera_matrix": {"rows": 3, "cols": 3, "data": CAMERA.K.ravel().tolist()},
        "distortion_coefficients": {"rows": 1, "cols": 4, "data": CAMERA.distortion.tolist()},
        "image_width": 640, "image_height": 480,
    }  # fmt: skip
    (folder / "camera.yaml").write_text(json.dumps(camera))
    return folder, X


def options(folder, *more):
    return (
        "calibrate", "hand-eye", *(str(one) for one in sorted(folder.glob("*.png"))), "--camera",
        str(folder / "camera.yaml"), "--hand-poses", str(folder / "hands.csv"), *more,
    )  # fmt: skip


@pytest.mark.slow
def test_images_of_a_board_give_the_camera_on_the_hand(run, cell, tmp_path):
    folder, X = cell
    target = tmp_path / "hand_eye.yaml"
    done = run(*options(folder, "--board", TEXT, "--json", "--write", str(target)))
    assert done.code == 0
    document = json.loads(done.out)
    assert document["status"] == "calibrated"
    C = np.array(document["camera"]["covariance"]["matrix"])
    gap = SE3.log(SE3.inverse(np.array(document["camera"]["pose"]["matrix"])) @ X)
    assert gap @ np.linalg.solve(C, gap) < 22.5  # 99.9 % of chi-square with 6
    assert np.abs(gap[:3]).max() < 1e-3
    assert target.exists()
    assert "04.png is excluded" in done.err
    assert "00.png: 24 corners of the board" in done.err


def test_options_of_boards_that_are_incomplete_are_named(run, cell):
    folder, _ = cell
    without = run(*options(folder))
    assert without.code == 2
    assert "--board, --camera, --hand-poses: expected all three" in without.err
    other = run(*options(folder, "--board", "chess:7x5,30mm"))
    assert other.code == 1
    assert "charuco:7x5,30mm,22mm" in other.err
    wrong = run(*options(folder, "--board", "grid:5x4,28mm,8mm,APRILTAG_36h11"))
    assert wrong.code == 1
    assert "none that shows it" in wrong.err
