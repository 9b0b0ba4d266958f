"""Read and write image files with OpenCV (extra ``vision``)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry.typing import FloatArray
from tanteo.parts import RECORD, read_whole
from tanteo.replaced import replaced
from tanteo.vision.camera import PIXELS, opencv

_PNG = b"\x89PNG\r\n\x1a\n"


def read_image(path: str | Path) -> FloatArray:
    """Read an image as grey levels from 0 to 255 ``(rows, columns)``.

    OpenCV converts colours to grey; 16-bit levels are scaled to 255.

    Args:
        path: image file: PNG, JPEG, TIFF, BMP or another format that OpenCV reads.

    Raises:
        InputError: the file does not exist, is not an image, is too large, or has neither 8 nor 16 bits a channel.
        MissingExtraError: OpenCV is not installed.

    Example:
        >>> image = tanteo.read_image("images/three_parts.png")
        >>> image.ndim, bool(image.max() <= 255)
        (2, True)
    """
    cv2 = opencv()
    path = Path(path)
    content = read_whole(path, "an image", RECORD)
    _check_chunks(content, path)
    data = np.frombuffer(content, dtype=np.uint8)
    # the orientation tag is ignored: the calibration refers to the stored pixels
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        image = cv2.imdecode(data, flags) if len(data) else None
    except cv2.error as error:
        large = "CV_IO_MAX_IMAGE" in str(error)
        got = f"more than {PIXELS // 10**6} million pixels. Scale it down" if large else "a damaged one. Save it again"
        raise InputError(f"{path}: expected an image, got {got}.") from None
    if image is None:
        raise InputError(f"{path}: expected an image (PNG, JPEG, TIFF), got other content. Save it as PNG.")
    if image.size > PIXELS:
        raise InputError(f"{path}: expected an image, got more than {PIXELS // 10**6} million pixels. Scale it down.")
    if image.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{path}: expected 8 or 16 bits a pixel, got {image.dtype}. Save it with one of these.")
    scale = 255.0 / 65535.0 if image.dtype == np.uint16 else 1.0
    return np.asarray(image, dtype=np.float64) * scale


def _check_chunks(content: bytes, path: Path) -> None:
    """Refuse a PNG that is shorter than the lengths of its chunks, for which OpenCV would allocate memory.

    The format is that of the PNG specification (W3C), section 5.3: a signature of eight bytes, then chunks of a length,
    a type, as many bytes, and a checksum.
    """
    at = len(_PNG)
    while content.startswith(_PNG) and at + 8 <= len(content):
        length = int.from_bytes(content[at : at + 4], "big")
        if length > len(content) - at - 12:
            raise InputError(
                f"{path}: expected an image, got one that breaks off: a part of {length} bytes in a "
                f"file of {len(content)}. Copy or save it again."
            )
        if content[at + 4 : at + 8] == b"IEND":
            return
        at += 12 + length


def write_image(path: str | Path, picture: np.ndarray) -> None:
    """Write an image file in the format of the path's suffix.

    Args:
        path: file to write.
        picture: levels from 0 to 255, grey ``(rows, columns)`` or red, green, blue ``(rows, columns, 3)``.

    Raises:
        InputError: the suffix names no known format, or the file cannot be written.
        MissingExtraError: OpenCV is not installed.
    """
    cv2 = opencv()
    path = Path(path)
    levels = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
    levels = levels[..., ::-1] if levels.ndim == 3 else levels
    try:
        done, data = cv2.imencode(path.suffix or ".", levels)
    except cv2.error:
        done = False
    if not done:
        raise InputError(f"{path}: expected a name that ends in .png or .jpg, got '{path.name}'. Add the suffix.")
    try:
        with replaced(path) as file:
            file.write_bytes(data.tobytes())
    except OSError as error:
        raise InputError(
            f"{path}: expected a place to write to, got: {error.strerror or error}. Name another."
        ) from None
