"""Images of printed boards by a homography: two samples for each pixel and axis, blur and noise."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.vision import Camera
from tanteo.vision.camera import rays

K = np.array([[900.0, 0, 319.5], [0, 900.0, 239.5], [0, 0, 1]])
SIZE = 640, 480
LENS = np.array([-0.12, 0.05, 1e-3, -5e-4])
CAMERA = Camera(K, SIZE, LENS)
FINE = 2
"""Samples of a pixel along each axis."""

PIXELS = 4000.0
"""Pixels of the print for a metre."""


def printed(board):
    """Return the print of a board of OpenCV with a white margin, and the pixel of its origin."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
    side = round(board.marker * PIXELS)
    if board.pattern == "charuco":
        layout = cv2.aruco.CharucoBoard((board.columns, board.rows), board.pitch, board.marker, dictionary)
        size = [round(n * board.pitch * PIXELS) for n in (board.columns, board.rows)]
        sheet = layout.generateImage(size)
    else:
        pitch = round(board.pitch * PIXELS)
        sheet = np.full((pitch * board.rows, pitch * board.columns), 255, np.uint8)
        for k in range(board.rows * board.columns):
            row, column = divmod(k, board.columns)
            marker = cv2.aruco.generateImageMarker(dictionary, board.first + k, side)
            sheet[row * pitch : row * pitch + side, column * pitch : column * pitch + side] = marker
    return np.pad(sheet, 80, constant_values=255), 80.0


@cache
def _rays():
    """Return the rays of the samples of all pixels."""
    x, y = np.meshgrid(np.arange(SIZE[0] * FINE), np.arange(SIZE[1] * FINE))
    middle = 0.5 * (FINE - 1)
    return rays(CAMERA, np.stack([(x - middle) / FINE, (y - middle) / FINE], axis=-1))


def photographed(board, T_camera_board, rng):
    """Return the image of a board in front of a grey wall."""
    sheet, margin = printed(board)
    at = _rays()
    plane = np.linalg.inv(T_camera_board[:3, [0, 1, 3]])
    on = at @ plane.T
    on = on[..., :2] / on[..., 2:] * PIXELS + margin - 0.5
    wide = cv2.remap(
        sheet.astype(np.float32), *np.moveaxis(on.astype(np.float32), -1, 0), cv2.INTER_LINEAR, borderValue=120
    )
    image = cv2.GaussianBlur(40 + 0.7 * wide.reshape(SIZE[1], FINE, SIZE[0], FINE).mean(axis=(1, 3)), (0, 0), 0.7)
    return np.clip(np.rint(image + rng.normal(0, 2, image.shape)), 0, 255)


def cell_of_boards(board, count, rng):
    """Return poses of a hand, images of a board that does not move, and the pose of the camera on the hand."""
    X = SE3.exp(np.array([0.03, -0.02, 0.06, 0.1, -0.05, 0.8]))
    middle = np.array([board.columns, board.rows, 0]) * 0.5 * board.pitch
    T_base_board = SE3.from_parts(SO3.exp(np.array([0.05, 3.0, 0.1])), np.array([0.5, 0.1, 0.02]))
    hands, images = [], []
    for _ in range(count):
        turn = SO3.exp(np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(-0.6, 0.6)]))
        T_camera_board = SE3.from_parts(turn, np.array([0, 0, rng.uniform(0.35, 0.5)]) - turn @ middle)
        images.append(photographed(board, T_camera_board, rng))
        hands.append(T_base_board @ SE3.inverse(T_camera_board) @ SE3.inverse(X))
    return hands, images, X
