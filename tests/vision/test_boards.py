"""Boards of markers in images: their pose, and boards that contradict the image."""

from __future__ import annotations

import numpy as np
import pytest

from board_images import CAMERA, photographed
from tanteo.errors import DegenerateError, InputError
from tanteo.geometry import SE3, SO3
from tanteo.vision.boards import Board, find_board

BOARDS = [
    Board("charuco", 7, 5, 0.03, 0.022, "DICT_5X5_100"),
    Board("charuco", 6, 4, 0.03, 0.022, "DICT_4X4_50"),
    Board("grid", 5, 4, 0.036, 0.028, "DICT_APRILTAG_36h11"),
    Board("grid", 4, 3, 0.04, 0.03, "DICT_ARUCO_ORIGINAL"),
    Board("marker", 1, 1, 0.12, 0.12, "DICT_6X6_250", 7),
]
IDS = ["charuco", "charuco_even", "april", "aruco", "marker"]


def posed(board, rng):
    turn = SO3.exp(np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(-2, 2)]))
    middle = np.array([board.columns, board.rows, 0]) * 0.5 * board.pitch
    return SE3.from_parts(turn, np.array([0.0, 0.0, 0.45]) - turn @ middle)


@pytest.mark.parametrize("board", BOARDS, ids=IDS)
def test_boards_have_the_pose_at_which_they_were_seen(board):
    rng = np.random.default_rng(5)
    for _ in range(2):
        T = posed(board, rng)
        seen = find_board(photographed(board, T, rng), CAMERA, board)
        gap = SE3.log(SE3.inverse(seen.T_camera_board) @ T)
        assert seen.rms < 0.5
        sds = np.sqrt(np.diag(seen.covariance))
        assert np.all(np.abs(gap) < 5 * sds), (gap, sds)
        assert np.abs(gap[:3]).max() < 1e-3


def test_an_image_without_the_board_is_refused():
    rng = np.random.default_rng(2)
    image = photographed(BOARDS[0], posed(BOARDS[0], rng), rng)
    with pytest.raises(DegenerateError, match="got 0"):
        find_board(image, CAMERA, BOARDS[2])


@pytest.mark.parametrize(
    "values",
    [
        ("charuco", 7, 5, 0.03, 0.03, "DICT_5X5_100"),
        ("charuco", 1, 5, 0.03, 0.02, "DICT_5X5_100"),
        ("grid", 5, 5, 0.02, 0.03, "DICT_5X5_100"),
        ("grid", 11, 10, 0.04, 0.03, "DICT_5X5_100"),
        ("grid", 5, 5, 0.04, 0.03, "DICT_5X5_101"),
    ],
)
def test_impossible_boards_are_refused(values):
    with pytest.raises(InputError, match="board: expected"):
        Board(*values)
