"""One setting of the search over several values: ``python benchmarks/sweep.py search.rounds 4 8 12 --rows touch=40``.

Every value answers the same scenes of ``against_scenes.py`` (rows as there; default: touch, hard_walls, labelled,
prior) in the same process by turns, so that a slow machine slows all values. The table has one row for each value and
prior) in the same process by turns, so that a slow machine slows all values. The table has one row for each value and
the images of ``vision_sweep.py`` instead. A number of ``posterior/settings.py`` that names
rows was chosen so: the smallest effort, or the widest margin, from which "right" does not rise any more.
"""

from __future__ import annotations

import os

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import vision_sweep
from against import BRACKET, chosen
from against_scenes import draw
from against_worker import judge, options, part_reader
from common import Table, machine

import tanteo
from tanteo.posterior import DEFAULTS

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES, DEMO = ROOT / "examples" / "parts", ROOT / "src" / "tanteo" / "bench" / "demo" / "parts"
ROWS = "touch", "hard_walls", "labelled", "prior"


def answers(name: str, values: list[float], rows: dict[str, int], seeds: int) -> dict[tuple[str, float], list[dict]]:
    """Return what every value answers to every scene and seed, judged, with its CPU time [ms]."""
    out: dict[tuple[str, float], list[dict]] = {}
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        part = part_reader(EXAMPLES, DEMO, BRACKET, folder)
        for row, count in rows.items():
            for k in range(count):
                scene = draw(row, k, 1991, part)
                readings = tanteo.Readings.from_columns(**scene.columns)
                parts, more = [part(key) for key in scene.among], options(scene, folder)
                if not k:
                    tanteo.identify(readings, parts, **more)  # prepares the parts
                for seed in range(seeds):
                    for value in values:
                        settings = DEFAULTS.changed(name, value)
                        start = time.process_time()
                        answer = tanteo.identify(readings, parts, seed=seed, settings=settings, **more)
                        ms = 1e3 * (time.process_time() - start)
                        out.setdefault((row, value), []).append(judge(answer, scene, part) | {"ms": ms})
            print(f"{row}: {count} scenes", file=sys.stderr, flush=True)
    return out


def table(name: str, found: dict[tuple[str, float], list[dict]]) -> Table:
    """Return one line for each kind of scene and value."""
    lines = []
    for (row, value), each in found.items():
        nees = [a["nees"] / a["dof"] for a in each if a["right"] and a["nees"] is not None]
        ms = [a["ms"] for a in each]
        lines.append((
            row, f"{value:g}", f"{sum(a['right'] for a in each)}/{len(each)}", f"{np.mean([a['P'] for a in each]):.3f}",
            f"{np.median(nees):.2f}" if nees else "", f"{np.median(ms):.3g}", f"{np.mean(ms):.3g}",
        ))  # fmt: skip
    columns = ("scenes", name, "right", "claimed", "NEES / dof, median", "ms, median", "ms, mean")
    return Table(
        f"Sweep of {name}", "The value in use is the default of `tanteo.posterior.settings.Settings`.", columns, lines
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("setting", help="group and field, such as search.rounds or vision.search.kept")
    parser.add_argument("values", nargs="+", type=float)
    parser.add_argument("--rows", nargs="+", default=list(ROWS), help="kinds of scenes: touch, touch=48, hard")
    parser.add_argument("--count", type=int, help="scenes of each row, instead of the usual number")
    parser.add_argument("--seeds", type=int, default=1, help="seeds of the search for each scene")
    given = parser.parse_args()
    if given.setting.startswith("vision."):
        count = 10 if given.count is None else given.count
        found = vision_sweep.sweep(given.setting.removeprefix("vision."), given.values, count, count // 2)
        print(f"{machine()}\n\n{found.markdown()}")
        return
    rows = {row: count for row, count in chosen(given.rows, given.count).items() if not row.startswith("session")}
    found = answers(given.setting, given.values, rows, given.seeds)
    print(f"{machine()}\n\n{table(given.setting, found).markdown()}")


if __name__ == "__main__":
    main()
