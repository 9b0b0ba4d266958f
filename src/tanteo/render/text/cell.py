"""Check of a cell as lines of text."""

from __future__ import annotations

import re

import numpy as np

from tanteo.planning import CellCheck, CellError
from tanteo.render.text.layout import PLAIN, Layout, printable
from tanteo.words import percent

_UNKNOWN = 0.1
"""Explained fraction of an error's variance below which the readings hardly determine it."""


def cell_lines(check: CellCheck, *, layout: Layout = PLAIN) -> list[str]:
    """Return the check of a cell as lines of text: errors, contradictions, correlations, and the next reading.

    Args:
        check: result of :func:`tanteo.planning.check_cell`.
        layout: width and style of the output.
    """
    wrong = [error for error in check.errors if error.contradicted]
    head = f"contradicted: {', '.join(map(_meaning, wrong))}" if wrong else "no error of the cell is contradicted"
    lines = [layout.bold(printable(head))]
    for error in check.errors:
        lines += _lines(error)
    for one, other, r in check.correlated:
        lines.append(printable(f"  not separated: {one}, {other} (correlation {r:.2f})"))
    return [*lines, "", _next(check)]


def _lines(error: CellError) -> list[str]:
    words = "" if error.explained > _UNKNOWN else "; the readings hardly determine it"
    verdict = "  CONTRADICTED" if error.contradicted else ""
    return [
        printable(f"  {_meaning(error)}: p {error.p_value:.2g}{verdict}{words}"),
        f"    stated sd   {_values(error.stated, error)}",
        f"    estimate    {_values(error.estimate, error)}",
        f"    its sd      {_values(error.sd, error)}",
    ]


def _meaning(error: CellError) -> str:
    """Return the meaning of an error without units, which its values have."""
    return re.sub(r" \[[^\]]*\]", "", error.meaning)


def _values(values: np.ndarray, error: CellError) -> str:
    """Return values in mm; the last three of six are angles, and a scale has no unit."""
    if error.meaning.endswith("[rad]"):
        return " ".join(f"{np.degrees(v):.4f}" for v in values) + " deg"
    if error.name.startswith("scale"):
        return " ".join(f"{v:.4g}" for v in values)
    angles = values[3:] if len(values) == 6 else values[:0]
    lengths = values[: len(values) - len(angles)]
    text = " ".join(f"{1e3 * v:z.3f}" for v in lengths) + " mm"
    return text + (" " + " ".join(f"{np.degrees(v):.4f}" for v in angles) + " deg" if len(angles) else "")


def _next(check: CellCheck) -> str:
    one = check.following
    if one is None:
        return "No further reading of this part gives information about these errors."
    x, y, z = 1e3 * one.point
    dx, dy, dz = one.direction
    ax, ay, az = one.axis
    about = f"about ({ax:z.2f}, {ay:z.2f}, {az:z.2f})"
    turned = f"rotated by {np.degrees(one.turn):.0f} deg {about}" if one.turn else "as before"
    along = f"({dx:z.3f}, {dy:z.3f}, {dz:z.3f})"
    return printable(
        f"Next: {one.face} at ({x:z.1f}, {y:z.1f}, {z:z.1f}) mm along {along}, the hand {turned}: "
        f"expected to exclude {percent(-np.expm1(-one.gain))} of the errors that are still possible."
    )
