"""What readings of a part say of the cell, in words."""

from __future__ import annotations

import re

import numpy as np

from tanteo.planning import CellCheck, CellError
from tanteo.render.text.layout import PLAIN, Layout, printable

_UNKNOWN = 0.1
"""Share of an error's variance that is explained, below which the readings say next to nothing of it."""


def cell_lines(check: CellCheck, *, layout: Layout = PLAIN) -> list[str]:
    """Each error of the cell, which are contradicted, which cannot be told from each other, and what to sense next.

    Args:
        check: what was found.
        layout: where it is shown.
    """
    wrong = [error for error in check.errors if error.contradicted]
    head = f"contradicted: {', '.join(map(_meaning, wrong))}" if wrong else "nothing of the cell is contradicted"
    lines = [layout.bold(printable(head))]
    for error in check.errors:
        lines += _lines(error)
    for one, other, r in check.correlated:
        lines.append(printable(f"  not told from each other: {one}, {other} (correlation {r:.2f})"))
    return [*lines, "", _next(check)]


def _lines(error: CellError) -> list[str]:
    words = "" if error.explained > _UNKNOWN else "; the readings say next to nothing of it"
    verdict = "  CONTRADICTED" if error.contradicted else ""
    return [
        printable(f"  {_meaning(error)}: p {error.p_value:.2g}{verdict}{words}"),
        f"    stated sd   {_values(error.stated, error)}",
        f"    estimate    {_values(error.estimate, error)}",
        f"    its sd      {_values(error.sd, error)}",
    ]


def _meaning(error: CellError) -> str:
    """In words, without the units of a program: the values beside it have their own."""
    return re.sub(r" \[[^\]]*\]", "", error.meaning)


def _values(values: np.ndarray, error: CellError) -> str:
    """Lengths in mm; the last three of six are angles; a scale has no unit."""
    if error.name.startswith("scale"):
        return " ".join(f"{v:.4g}" for v in values)
    angles = values[3:] if len(values) == 6 else values[:0]
    lengths = values[: len(values) - len(angles)]
    text = " ".join(f"{1e3 * v:.3f}" for v in lengths) + " mm"
    return text + (" " + " ".join(f"{np.degrees(v):.4f}" for v in angles) + " deg" if len(angles) else "")


def _next(check: CellCheck) -> str:
    one = check.following
    if one is None:
        return "No further reading of this part tells more of these errors."
    x, y, z = 1e3 * one.point
    dx, dy, dz = one.direction
    ax, ay, az = one.axis
    turned = (
        f"turned by {np.degrees(one.turn):.0f} deg about ({ax:.2f}, {ay:.2f}, {az:.2f})" if one.turn else "as it was"
    )
    return printable(
        f"Next: {one.face} at ({x:.1f}, {y:.1f}, {z:.1f}) mm along ({dx:.3f}, {dy:.3f}, {dz:.3f}), the hand {turned}: "
        f"it tells {one.gain:.2f} nats of these errors."
    )
