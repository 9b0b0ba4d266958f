"""Draw ``docs/pictures/cost.svg`` from the table "Cost over points, triangles and parts" in ``docs/benchmarks.md``.

``python docs/pictures/make_cost.py [folder]``. The picture shows the table, which
``python benchmarks/run.py cost`` prints.
"""

from __future__ import annotations

import re
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
from make_pictures import BLUE, GREEN, GREY, HEIGHT, INK, PAPER, RED, WIDTH, Drawing

HERE = Path(__file__).resolve().parent
PAGE = HERE.parent / "benchmarks.md"
ORANGE = "#b4690e"
LEFT, GAP, SIDE, TOP, BOTTOM = 74, 92, 318, 84, 390
"""Layout of the panels on the page [px]."""

PANELS = (
    ("points", "readings", (("points", BLUE, "points alone"), ("points with normals", GREEN, "points with normals"))),
    ("triangles", "triangles of the part", (("triangles", BLUE, "an answer"),)),
    ("parts", "parts", (("parts", BLUE, "an answer"),)),
)
"""Sweep, name of the axis, and curves of calls (rows, colour, name) of each panel."""


def table(page: Path) -> dict[str, np.ndarray]:
    """Return the rows of the table by sweep: number, read, prepare [s], kept [MB], call [ms], needed [MB]."""
    rows: dict[str, list[list[float]]] = {}
    for line in page.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 7 and all(re.fullmatch(r"-?\d[\d.,e+-]*", cell) for cell in cells[1:]):
            rows.setdefault(cells[0], []).append([float(cell.replace(",", "")) for cell in cells[1:]])
    return {over: np.array(some) for over, some in rows.items()}


_DASHES = ("none", "8 4", "2 4")


class Axes:
    """Panel with logarithmic axes: milliseconds over a number."""

    def __init__(self, out: Drawing, k: int, numbers: np.ndarray, milliseconds: np.ndarray) -> None:
        self.out, self.left = out, LEFT + k * (SIDE + GAP)
        self.x = np.log10([numbers.min(), numbers.max()])
        self.y = np.array([np.floor(np.log10(milliseconds.min())), np.ceil(np.log10(milliseconds.max()))])

    def page(self, number: np.ndarray, milliseconds: np.ndarray) -> np.ndarray:
        """Return positions on the page [px]."""
        x = self.left + SIDE * (np.log10(number) - self.x[0]) / np.ptp(self.x)
        y = BOTTOM - (BOTTOM - TOP) * (np.log10(milliseconds) - self.y[0]) / np.ptp(self.y)
        return np.stack([x, y], axis=-1)

    def frame(self, words: str) -> None:
        """Draw the grid, and the numbers and names of the axes."""
        for e in range(int(self.y[0]), int(self.y[1]) + 1):
            a, b = self.page(10.0 ** np.array(self.x), np.full(2, 10.0**e))
            self.out.line(a, b, stroke="#e3e7ea", width=1)
            name = f"{10**e:,} ms" if e < 3 else f"{10 ** (e - 3):,} s"
            self.out.text(a[0] - 6, a[1] + 4, name, 12, GREY, text_anchor="end")
        for e in range(int(np.ceil(self.x[0])), int(self.x[1]) + 1):
            a, b = self.page(np.full(2, 10.0**e), 10.0 ** np.array(self.y))
            self.out.line(a, b, stroke="#e3e7ea", width=1)
            self.out.text(a[0], a[1] + 18, f"{10**e:,}", 12, GREY, text_anchor="middle")
        self.out.text(self.left + SIDE / 2, BOTTOM + 40, words, 14, INK, text_anchor="middle")

    def curve(self, number: np.ndarray, milliseconds: np.ndarray, colour: str, name: str, row: int) -> None:
        """Draw a measured curve with marked points, and its name in the legend."""
        places = self.page(number, milliseconds)
        for a, b in pairwise(places):
            self.out.line(a, b, stroke=colour, width=2, stroke_dasharray=_DASHES[row])
        for p in places:
            self.out.add("circle", cx=f"{p[0]:.1f}", cy=f"{p[1]:.1f}", r=3.2, fill=colour)
        y = TOP - 12 - 17 * row
        a = np.array([self.left, y - 4])
        self.out.line(a, a + np.array([22, 0]), stroke=colour, width=3, stroke_dasharray=_DASHES[row])
        self.out.text(self.left + 28, y, name, 13, colour)


def make(path: Path) -> None:
    """Draw the table of the page."""
    rows, out = table(PAGE), Drawing()
    out.add("rect", width=WIDTH, height=HEIGHT, fill=PAPER)
    for k, (sweep, words, calls) in enumerate(PANELS):
        curves = [(rows[over][:, 0], rows[over][:, 4], colour, name) for over, colour, name in calls]
        if sweep != "points":
            once = rows[sweep]
            curves += [
                (once[:, 0], 1e3 * once[:, 2], ORANGE, "prepare the part, once"),
                (once[:, 0], 1e3 * once[:, 1], RED, "read the file, once"),
            ]
        axes = Axes(out, k, np.concatenate([c[0] for c in curves]), np.concatenate([c[1] for c in curves]))
        axes.frame(words)
        for row, curve in enumerate(curves):
            axes.curve(*curve, row)
    out.write(path, "Time over the number of readings, of triangles and of parts")


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE
    folder.mkdir(parents=True, exist_ok=True)
    make(folder / "cost.svg")
