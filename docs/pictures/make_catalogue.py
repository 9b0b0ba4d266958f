"""Draw ``docs/pictures/catalogue.svg`` from the table "What it takes" in ``docs/catalogue.md``.

``python docs/pictures/make_catalogue.py [folder]``. The picture shows what stands in the table, which
``python benchmarks/bench_catalogue.py`` prints, and the slope of each curve.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from make_cost import GREEN, HEIGHT, ORANGE, PAPER, RED, WIDTH, Axes, Drawing
from make_pictures import BLUE

HERE = Path(__file__).resolve().parent
PAGE = HERE.parent / "catalogue.md"
CURVES = (
    ("6 labelled faces", BLUE, "6 labelled faces"),
    ("10 points with sensed normals", GREEN, "10 normals"),
    ("30 points", ORANGE, "30 points"),
    ("12 points", RED, "12 points"),
)
"""What the row begins with, colour, name."""


def table(page: Path) -> dict[str, np.ndarray]:
    """Rows of the table by what was sensed: parts, seconds."""
    rows: dict[str, list[tuple[float, float]]] = {}
    for line in page.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 10 and cells[0].replace(",", "").isdigit():
            rows.setdefault(cells[1], []).append((float(cells[0].replace(",", "")), float(cells[3])))
    return {sensed: np.array(sorted(some)) for sensed, some in rows.items()}


def make(path: Path) -> None:
    """Draw what the page says."""
    rows, out = table(PAGE), Drawing()
    out.add("rect", width=WIDTH, height=HEIGHT, fill=PAPER)
    found = [(next(rows[s] for s in rows if s.startswith(begin)), colour, name) for begin, colour, name in CURVES]
    every = np.concatenate([one for one, *_ in found])
    axes = Axes(out, 0, every[:, 0], 1e3 * every[:, 1])
    axes.frame("parts of the catalogue")
    for row, (one, colour, name) in enumerate(found):
        slope = np.polyfit(np.log(one[:, 0]), np.log(one[:, 1]), 1)[0]
        axes.curve(one[:, 0], 1e3 * one[:, 1], colour, f"{name}: slope {slope:.2f}", min(row, 2))
    out.write(path, "Time to recognise one of so many parts")


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE
    folder.mkdir(parents=True, exist_ok=True)
    make(folder / "catalogue.svg")
