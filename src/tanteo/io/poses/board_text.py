"""Read a board of markers from text, such as ``charuco:7x5,30mm,22mm,DICT_5X5_100``."""

from __future__ import annotations

import re

from tanteo.errors import InputError
from tanteo.io.readings.units import parse_length
from tanteo.vision.boards import Board

_FORMS = {
    "charuco": "charuco:7x5,30mm,22mm,DICT_5X5_100 (squares along a row and a column, side of a square, of a marker)",
    "grid": "grid:6x6,24mm,7.2mm,DICT_APRILTAG_36h11 (markers along a row and a column, side of a marker, gap)",
    "marker": "marker:12,50mm,DICT_APRILTAG_36h11 (number and side of a marker)",
}
"""Definition: the accepted texts, with what their numbers mean."""


def parse_board(text: str) -> Board:
    """Return a board of markers.

    Args:
        text: kind, sizes with their units, and the dictionary of OpenCV; ``DICT_`` may be missing.

    Raises:
        InputError: the text has another form, a size has no unit, or there is no such board.
        MissingExtraError: OpenCV is not installed.

    Example:
        >>> from tanteo.io.poses.board_text import parse_board
        >>> board = parse_board("grid:6x6,24mm,7.2mm,DICT_APRILTAG_36h11")
        >>> board.columns, round(1e3 * board.pitch, 3)
        (6, 31.2)
    """
    pattern, _, rest = text.partition(":")
    fields = [field.strip() for field in rest.split(",")]
    if pattern not in _FORMS or len(fields) != (3 if pattern == "marker" else 4):
        raise InputError(f"board: expected {'; '.join(_FORMS.values())}, got '{text}'. Write it so.")
    name = fields[-1] if fields[-1].startswith("DICT_") else f"DICT_{fields[-1]}"
    if pattern == "marker":
        side = parse_length(fields[1], "board, side of the marker")
        return Board("marker", 1, 1, side, side, name, _whole(fields[0], text))
    counts = re.fullmatch(r"(\d{1,3})\s*[xX]\s*(\d{1,3})", fields[0])
    if counts is None:
        raise InputError(
            f"board: expected numbers along a row and a column such as 7x5, got '{fields[0]}'. Count them."
        )
    columns, rows = map(int, counts.groups())
    first, second = (parse_length(one, "board") for one in fields[1:3])
    if pattern == "charuco":
        return Board("charuco", columns, rows, first, second, name)
    return Board("grid", columns, rows, first + second, first, name)


def _whole(field: str, text: str) -> int:
    if not re.fullmatch(r"\d{1,6}", field):
        raise InputError(f"board: expected the number of the marker, got '{field}' in '{text}'. Give a whole number.")
    return int(field)
