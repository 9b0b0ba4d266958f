"""OpenCV, where it is installed: the only door to it."""

from __future__ import annotations

from types import ModuleType

from tanteo.errors import MissingExtraError


def opencv() -> ModuleType:
    """The module.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        import cv2
    except ImportError as error:
        raise MissingExtraError(
            f"image: expected OpenCV to work on images, got {error}. Run pip install 'tanteo[vision]'."
        ) from error
    return cv2
