"""Draw ``docs/pictures/catalogue.svg`` from the table "Measured" in ``docs/catalogue.md``.

``python docs/pictures/make_catalogue.py [folder]``. The picture shows the table, which
``python benchmarks/bench_catalogue.py`` prints, and the slope of each curve.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
from make_cost import ORANGE
from make_pictures import BLUE, GREEN, GREY, HEIGHT, INK, PAPER, RED, WIDTH, Drawing

HERE = Path(__file__).resolve().parent
PAGE = HERE.parent / "catalogue.md"
CURVES = (
    ("6 labelled faces", BLUE, "6 labelled faces"),
    ("10 points with sensed normals", GREEN, "10 normals"),
    ("centres and radii", INK, "holes"),
    ("30 points", ORANGE, "30 points"),
    ("12 points", RED, "12 points"),
)
"""Start of the row in the table, colour, and name of each curve."""


def table(page: Path) -> dict[str, np.ndarray]:
    """Return the rows of the table, number of parts and seconds, by kind of readings."""
    rows: dict[str, list[tuple[float, float]]] = {}
    for line in page.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 10 and cells[0].replace(",", "").isdigit():
            rows.setdefault(cells[1], []).append((float(cells[0].replace(",", "")), float(cells[3])))
    return {sensed: np.array(sorted(some)) for sensed, some in rows.items()}


LEFT, RIGHT, TOP, BOTTOM = 110, 960, 40, 400
PARTS, SECONDS = (2, 5), (-1, 2)
"""Powers of ten at the ends of the axes."""


def place(parts: float, seconds: float) -> np.ndarray:
    """Return a position on the page."""
    x = (np.log10(parts) - PARTS[0]) / (PARTS[1] - PARTS[0])
    y = (np.log10(seconds) - SECONDS[0]) / (SECONDS[1] - SECONDS[0])
    return np.array([LEFT + (RIGHT - LEFT) * x, BOTTOM - (BOTTOM - TOP) * y])


def frame(out: Drawing) -> None:
    """Draw the grid, and the numbers and names of the axes."""
    out.add("rect", width=WIDTH, height=HEIGHT, fill=PAPER)
    for e in range(SECONDS[0], SECONDS[1] + 1):
        a, b = place(10 ** PARTS[0], 10.0**e), place(10 ** PARTS[1], 10.0**e)
        out.line(a, b, stroke="#e3e7ea", width=1)
        out.text(a[0] - 8, a[1] + 5, f"{10.0**e:g} s", 15, GREY, text_anchor="end")
    for e in range(PARTS[0], PARTS[1] + 1):
        a, b = place(10**e, 10.0 ** SECONDS[0]), place(10**e, 10.0 ** SECONDS[1])
        out.line(a, b, stroke="#e3e7ea", width=1)
        out.text(a[0], a[1] + 22, f"{10**e:,}", 15, GREY, text_anchor="middle")
    out.text((LEFT + RIGHT) / 2, BOTTOM + 48, "parts in the catalogue", 16, INK, text_anchor="middle")
    out.text(LEFT - 70, TOP - 16, "time of the processor, median", 16, INK)


def make(path: Path) -> None:
    """Draw the table of the page."""
    rows, out, names = table(PAGE), Drawing(), []
    frame(out)
    for begin, colour, name in CURVES:
        known = next(rows[sensed] for sensed in rows if sensed.startswith(begin))
        places = [place(*row) for row in known]
        for a, b in pairwise(places):
            out.line(a, b, stroke=colour, width=2.5)
        for p in places:
            out.add("circle", cx=f"{p[0]:.1f}", cy=f"{p[1]:.1f}", r=4, fill=colour)
        slope = np.polyfit(np.log(known[:, 0]), np.log(known[:, 1]), 1)[0]
        names.append((places[-1][1], f"{name}, slope {slope:.2f}", colour))
    below = np.inf
    for y, name, colour in sorted(names, reverse=True):  # labels from the bottom, without overlap
        below = min(y, below - 20)
        out.text(RIGHT + 12, below + 5, name, 16, colour)
    out.write(path, "Seconds to recognize a part over the number of parts")


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE
    folder.mkdir(parents=True, exist_ok=True)
    make(folder / "catalogue.svg")
