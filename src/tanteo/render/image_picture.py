"""Drawing of the result of an image: outlines, edges of the best answers, names, and a legend."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.vision import Camera, Sight, Sighting
from tanteo.vision.camera import opencv, project
from tanteo.vision.edges import check_image, map_edges
from tanteo.vision.fit import meet
from tanteo.vision.settings import EVIDENCE

FOUND, MISSED, OUTLINE = (86, 200, 255), (255, 140, 0), (125, 18, 217)
"""Colours of the part's edges found and not found in the image, and of the objects' outlines
(tests/test_colours.py)."""

_WORD = (255, 220, 40)
_AXES = {"x": (230, 60, 50), "y": (40, 200, 60), "z": (70, 130, 230)}
_SCALE = 2
_SHIFT = 4
"""Number of fractional bits of the coordinates of OpenCV's drawing functions."""

_PAPER, _INK, _ROW, _TEXT = 255, (34, 48, 60), 40, 0.7
"""Legend: grey value of the background, colour of the text, height of a row [px], and size of the letters."""


def draw_sight(image: FloatArray, camera: Camera, sight: Sight) -> np.ndarray:
    """Draw the result of an image over the image, twice as large, with a legend below.

    The drawing has the outlines of the regions and, for the best answer of each object, the part's edges, axes, name
    and probability over all poses. Edges found in the image are blue dots, others are orange crosses.

    Args:
        image: grey image ``(rows, columns)``, 0 to 255.
        camera: camera of the image.
        sight: result of the image.

    Returns:
        Picture as red, green and blue, 0 to 255 ``(2 rows + legend, 2 columns, 3)``.
    """
    cv2 = opencv()
    grey = np.clip(np.rint(check_image(image)), 0, 255).astype(np.uint8)
    large = cv2.resize(grey, None, fx=_SCALE, fy=_SCALE, interpolation=cv2.INTER_LINEAR)
    picture = np.ascontiguousarray(np.repeat(large[..., None], 3, axis=2))
    edges = map_edges(sight.edges)
    for seen in sight.objects:
        if seen.region is not None:
            cv2.polylines(picture, [_at(seen.region.contour)], True, OUTLINE, 1, cv2.LINE_AA, _SHIFT)
        # the best part of an unknown object is none of it
        if seen.modes and (seen.answer.status != "unknown" or seen.modes[0].probability > EVIDENCE.missed):
            best = seen.modes[0]
            edges_found = meet(best.model.frame, camera, edges, best.T_camera_part, EVIDENCE.reach)
            for pixel, inside, hit in zip(edges_found.pixels, edges_found.inside, edges_found.hits, strict=True):
                if inside:
                    _mark(picture, _at(pixel), hit=bool(hit))
            _draw_axes(picture, camera, best.T_camera_part, 0.3 * best.model.part.diagonal)
        _write(picture, seen)
    return np.concatenate([picture, _legend(picture.shape[1])])


def stacked(pictures: Sequence[np.ndarray]) -> np.ndarray:
    """Return pictures below each other ``(rows, columns, 3)``, each with white to its right up to the widest."""
    width = max(picture.shape[1] for picture in pictures)
    filled = [np.pad(p, ((0, 0), (0, width - p.shape[1]), (0, 0)), constant_values=_PAPER) for p in pictures]
    return np.concatenate(filled)


def _legend(width: int) -> np.ndarray:
    """Return the legend as a strip of a width [px], with as many rows as needed."""
    cv2 = opencv()
    words = {
        "dot": "edge of the part, found", "cross": "edge of the part, not found", "line": "outline of the object",
        "x y z": "axes of the part's CAD frame",
    }  # fmt: skip
    places, x, y = [], 12, 0
    for sign, meaning in words.items():
        (length, _), _ = cv2.getTextSize(meaning, cv2.FONT_HERSHEY_SIMPLEX, _TEXT, 1)
        if x > 12 and x + 46 + length > width:
            x, y = 12, y + _ROW
        places.append((sign, meaning, x, y + _ROW // 2))
        x += 46 + length + 24
    strip = np.full((y + _ROW, width, 3), _PAPER, dtype=np.uint8)
    for sign, meaning, left, middle in places:
        _sign(strip, sign, left, middle)
        _put(strip, meaning, (left + 46, middle + 7), _INK)
    return strip


def _sign(strip: np.ndarray, sign: str, left: int, middle: int) -> None:
    """Draw a sign of the legend."""
    cv2 = opencv()
    if sign == "line":
        cv2.line(strip, (left, middle), (left + 28, middle), OUTLINE, 2, cv2.LINE_AA)
    elif sign in ("dot", "cross"):
        for x in (left + 4, left + 15, left + 26):
            _mark(strip, np.array([x << _SHIFT, middle << _SHIFT]), hit=sign == "dot")
    else:
        for x, name in zip((left, left + 14, left + 28), _AXES, strict=True):
            _put(strip, name, (x, middle + 7), _AXES[name], 2)


def _put(picture: np.ndarray, text: str, at: tuple[int, int], colour: tuple[int, ...], width: int = 1) -> None:
    cv2 = opencv()
    cv2.putText(picture, text, at, cv2.FONT_HERSHEY_SIMPLEX, _TEXT, colour, width, cv2.LINE_AA)


def _at(pixels: FloatArray) -> np.ndarray:
    """Return pixel coordinates in the enlarged picture, in the fixed-point format of OpenCV."""
    scaled = (pixels + 0.5) * _SCALE - 0.5
    whole = np.rint(np.nan_to_num(scaled) * (1 << _SHIFT)).astype(np.int32)
    return whole if whole.ndim > 1 else tuple(int(v) for v in whole)  # type: ignore[return-value]


def _mark(picture: np.ndarray, at: np.ndarray, *, hit: bool) -> None:
    """Draw a dot for an edge found in the image, otherwise a cross, so that colour is not the only cue."""
    cv2 = opencv()
    if hit:
        cv2.circle(picture, at, 2 << _SHIFT, FOUND, -1, cv2.LINE_AA, _SHIFT)
        return
    (x, y), arm = at, 3 << _SHIFT
    for slant in (arm, -arm):
        cv2.line(picture, (x - arm, y - slant), (x + arm, y + slant), MISSED, 2, cv2.LINE_AA, _SHIFT)


def _draw_axes(picture: np.ndarray, camera: Camera, T_camera_part: Transforms, length: float) -> None:
    cv2 = opencv()
    tips = SE3.apply(T_camera_part, np.concatenate([np.zeros((1, 3)), length * np.eye(3)]))
    pixels = project(camera, tips)
    if not np.all(np.isfinite(pixels)):
        return
    for tip, (name, colour) in zip(pixels[1:], _AXES.items(), strict=True):
        cv2.line(picture, _at(pixels[0]), _at(tip), colour, 2, cv2.LINE_AA, _SHIFT)
        x, y = (v >> _SHIFT for v in _at(tip))
        _put_outlined(picture, name, (x + 4, y + 4), 0.7)


def _write(picture: np.ndarray, seen: Sighting) -> None:
    cv2 = opencv()
    answer = seen.answer
    best = answer.hypotheses[0] if answer.hypotheses else None
    name = "unknown" if best is None or answer.status == "unknown" else best.part
    of_part = sum(h.probability for h in answer.hypotheses if h.part == name)  # over all poses
    p = answer.unknown_probability if name == "unknown" else of_part
    text = f"{name} {100 * min(p, 0.999):.1f} %"
    corner = (10, 10) if seen.region is None else (seen.region.box[0], seen.region.box[2])
    (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.9, 1)
    x = int(np.clip(_SCALE * corner[0], 4, max(picture.shape[1] - width - 4, 4)))
    y = int(np.clip(_SCALE * corner[1] - 8, height + 6, picture.shape[0] - 6))
    _put_outlined(picture, text, (x, y), 0.9)


def _put_outlined(picture: np.ndarray, text: str, at: tuple[int, int], size: float) -> None:
    """Draw text with a dark outline, so that it is legible on light and dark."""
    cv2 = opencv()
    for x, y in ((-1, -1), (-1, 1), (1, -1), (1, 1), (0, 0)):
        colour = (0, 0, 0) if x else _WORD
        cv2.putText(picture, text, (at[0] + x, at[1] + y), cv2.FONT_HERSHEY_SIMPLEX, size, colour, 1, cv2.LINE_AA)
