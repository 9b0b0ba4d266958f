"""Read numbers in replies of controllers: digits with a point, without exponents, infinities or other spellings."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from tanteo.geometry.typing import Vectors

NUMBER = re.compile(r"-?\d{1,7}(\.\d{0,12})?")
"""Number in a reply of GRBL (``grbl/print.c``) or of ``%f`` in LinuxCNC; 10 km is more than any machine."""


def numbers_of(texts: Sequence[str], expected: str, reply: str, least: int = 3, most: int = 9) -> Vectors:
    """Return the numbers of a reply ``(n,)``.

    Args:
        texts: numbers as received.
        expected: expected reply, for the error.
        reply: reply as received, for the error.
        least: smallest accepted number of texts.
        most: largest accepted number of texts; controllers have up to nine axes.

    Raises:
        ValueError: the reply has another number of texts, or one that is no number.
    """
    if not least <= len(texts) <= most or not all(map(NUMBER.fullmatch, texts)):
        raise ValueError(expected, reply)
    return np.array([float(v) for v in texts])
