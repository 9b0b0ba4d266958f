"""Boards of square markers (ChArUco, grids of ArUco or AprilTag markers, single markers), and their pose in an image.

OpenCV finds the markers and their corners (Garrido-Jurado and others 2014, Automatic generation and detection of highly
reliable fiducial markers under occlusion, Pattern Recognition 47). The frame of a board has its origin at the corner of
marker 0, x to the right along a row, y down along a column, z into the board.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from tanteo.errors import DegenerateError, InputError
from tanteo.geometry import SE3
from tanteo.geometry.typing import Covariances, FloatArray, Transforms
from tanteo.values import Value
from tanteo.vision.camera import Camera, opencv
from tanteo.vision.outlines import check_size
from tanteo.vision.table import fit_camera

_LEAST_CORNERS = {"charuco": 6, "grid": 8, "marker": 4}
"""Definition: least number of corners that give the pose of a board: six of a ChArUco board, two markers of a grid."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Board(Value):
    """A board of square markers, as OpenCV prints it.

    Attributes:
        pattern: ``charuco`` for markers in the white squares of a chessboard, ``grid`` for markers with gaps,
            ``marker`` for one marker.
        columns: number of squares of the chessboard, or of markers of the grid, along a row.
        rows: the same along a column.
        pitch: side of a square of the chessboard, or side of a marker and gap of a grid [m].
        marker: side of a marker [m].
        dictionary: name of the markers in OpenCV, such as ``DICT_5X5_100`` or ``DICT_APRILTAG_36h11``.
        first: number of the first marker.

    Raises:
        InputError: the sizes contradict each other, or OpenCV has no such dictionary, or too few markers in it.
        MissingExtraError: OpenCV is not installed.
    """

    pattern: Literal["charuco", "grid", "marker"]
    columns: int
    rows: int
    pitch: float
    marker: float
    dictionary: str
    first: int = 0

    def __post_init__(self) -> None:
        least = 2 if self.pattern == "charuco" else 1
        if min(self.columns, self.rows) < least or not 0 < self.marker <= self.pitch < np.inf:
            raise InputError(
                f"board: expected {least} x {least} or more, and markers from 0 up to the pitch, got {self.columns} x "
                f"{self.rows}, markers of {self.marker} m and a pitch of {self.pitch} m. Measure the print."
            )
        if self.pattern == "charuco" and self.marker == self.pitch:
            raise InputError("board: expected markers smaller than the squares, got the same size. Measure both.")
        known = len(self._dictionary().bytesList)
        count = self.columns * self.rows // (2 if self.pattern == "charuco" else 1)
        if self.first < 0 or self.first + count > known:
            raise InputError(
                f"board: expected markers that {self.dictionary} has (0 to {known - 1}), got {self.first} to "
                f"{self.first + count - 1}. Check the dictionary."
            )

    def _dictionary(self) -> Any:
        aruco = opencv().aruco
        names = [name for name in dir(aruco) if name.startswith("DICT_")]
        if self.dictionary not in names:
            raise InputError(
                f"board: expected a dictionary of OpenCV ({', '.join(sorted(names))}), got {self.dictionary}. Name the "
                "one with which the board was printed."
            )
        return aruco.getPredefinedDictionary(getattr(aruco, self.dictionary))

    def _layouts(self) -> list[Any]:
        """Return the board as OpenCV describes it. Its ChArUco boards of before 2022 begin with another colour."""
        aruco, dictionary = opencv().aruco, self._dictionary()
        size, ids = (self.columns, self.rows), np.arange(self.first, self.first + self.columns * self.rows)
        if self.pattern != "charuco":
            return [aruco.GridBoard(size, self.marker, max(self.pitch - self.marker, 1e-9), dictionary, ids)]
        ids = ids[: len(ids) // 2]
        boards = [aruco.CharucoBoard(size, self.pitch, self.marker, dictionary, ids) for _ in range(2)]
        boards[1].setLegacyPattern(True)
        return boards[: 1 + (self.rows % 2 == 0)]

    def corners_in(self, image: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Find the corners of the board in an image.

        Args:
            image: grey levels from 0 to 255 ``(rows, columns)``.

        Returns:
            Pixels ``(n, 2)``, and the points on the board ``(n, 3)`` [m].
        """
        cv2 = opencv()
        grey = np.clip(np.rint(image), 0, 255).astype(np.uint8)
        parameters = cv2.aruco.DetectorParameters()
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        best = np.zeros((0, 2)), np.zeros((0, 3))
        for layout in self._layouts():
            if self.pattern == "charuco":
                corners, ids, _, _ = cv2.aruco.CharucoDetector(layout, detectorParams=parameters).detectBoard(grey)
            else:
                corners, ids, _ = cv2.aruco.ArucoDetector(self._dictionary(), parameters).detectMarkers(grey)
            if ids is None or not len(ids):
                continue
            points, pixels = layout.matchImagePoints(corners, ids)
            if points is not None and len(points) > len(best[0]):
                best = pixels.reshape(-1, 2).astype(np.float64), points.reshape(-1, 3).astype(np.float64)
        return best


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class BoardView(Value):
    """A board in one image.

    Attributes:
        T_camera_board: pose of the board in the camera ``(4, 4)`` [m].
        covariance: its covariance ``(6, 6)`` by the residuals of the corners, board frame, right [m, rad].
        corners: number of corners that were found.
        rms: root mean square distance of the corners from their pixels by the pose [px].
    """

    T_camera_board: Transforms
    covariance: Covariances
    corners: int
    rms: float


def find_board(image: FloatArray, camera: Camera, board: Board) -> BoardView:
    """Return the pose of a board in an image.

    Args:
        image: grey levels from 0 to 255 ``(rows, columns)``.
        camera: calibrated camera; its pose is not used.
        board: the board.

    Raises:
        InputError: the image has another size than the camera, or the corners contradict the board.
        DegenerateError: the image shows too few corners of the board.
        MissingExtraError: OpenCV is not installed.

    Example:
        >>> from tanteo.vision.boards import Board, find_board
        >>> board = Board("charuco", 5, 4, 0.03, 0.022, "DICT_5X5_100")
        >>> print_ = cv2.aruco.CharucoBoard((5, 4), 0.03, 0.022, cv2.aruco.getPredefinedDictionary(5))
        >>> image = print_.generateImage((640, 480), marginSize=40)
        >>> camera = tanteo.vision.Camera(np.array([[600, 0, 319.5], [0, 600, 239.5], [0, 0, 1.0]]), (640, 480))
        >>> find_board(image, camera, board).corners
        12
    """
    check_size(image, camera)
    pixels, points = board.corners_in(image)
    least = _LEAST_CORNERS[board.pattern]
    if len(pixels) < least:
        raise DegenerateError(
            f"board: expected {least} corners of it or more, got {len(pixels)}. Is it the board that is stated, in "
            "focus and lit evenly?"
        )
    fit = fit_camera(camera, pixels, points)
    T = SE3.inverse(fit.T_world_camera)
    Ad = SE3.adjoint(fit.T_world_camera)
    return BoardView(T, Ad @ fit.covariance @ Ad.T, len(pixels), fit.rms)
