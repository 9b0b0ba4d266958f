"""Recognition by an outline on a table, alone and with a dozen points: ``python benchmarks/outlines.py CATALOGUE``.

``python benchmarks/outlines.py CATALOGUE [SCENES] [KIND...] [--seed N] [--verbose]``, for a catalogue of parts of
``families.py``. Scenes are rendered (``tests/vision_scenes.py``): one part in a stable pose, random light and shadow,
the camera 0.5 to 0.7 m away and 5 to 35 degrees off the vertical, the pose of the table with errors as stated. Points
are sensed at the pose of the image, at places drawn at random over the whole surface.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from bench_catalogue import SD, Outcome, points_on, shares_of
from common import Table

import tanteo
from tanteo.factors import ContactPoints, FreeRays, surface_points
from tanteo.geometry import SE3
from tanteo.posterior import Priors, WholeObject, identify_points
from tanteo.vision import outline_of_readings, prepare_vision, see_table
from tanteo.vision.outlines import narrowed
from vision_scenes import random_shot, stated_table

KINDS = {
    "outline": "the outline alone",
    "image": "an image",
    "points12": "12 points",
    "both": "12 points and an image",
    "points30": "30 points",
    "both30": "30 points and an image",
}


@dataclass
class Seen(Outcome):
    """Outcomes of scenes with an outline."""

    left: list[int] = field(default_factory=list)
    outline: int = 0


def sensed(part: tanteo.Part, T: np.ndarray, count: int, rng: np.random.Generator) -> ContactPoints:
    """Points of a part at a pose, without normals or labels."""
    p, _ = points_on(part, np.arange(len(part.triangles)), count, rng)
    p = SE3.apply(T, p) + SD * rng.normal(size=p.shape)
    return surface_points(p, SD)


def answered(
    catalogue: tanteo.catalogue.Catalogue, kind: str, part: tanteo.Part, rng: np.random.Generator, out: Seen
) -> tuple[str, float, dict[str, float]] | None:
    """Status, probability of the unknown object and of each part in one scene; None where the part leaves the image."""
    shot = random_shot([prepare_vision(part)], rng)
    T_world_table = stated_table(shot, part, rng)
    points = sensed(part, shot.T_world_part, 30 if kind.endswith("30") else 12, rng)
    start = time.process_time()
    try:
        outline = outline_of_readings(shot.image, shot.camera, points.points, T_world_table=T_world_table).outline
    except tanteo.InputError:
        return None
    log = outline.log_likelihood(catalogue)
    elapsed, start = time.process_time() - start, time.process_time()
    chosen = narrowed(outline, catalogue)
    out.left.append(len(chosen.rows))
    out.outline += int(catalogue.row_of(part.name)) in chosen.rows.tolist()
    if kind == "outline":
        out.cpu.append(elapsed)
        shares = np.exp(log - log.max()) / np.exp(log - log.max()).sum()
        rest = chosen.rest / (chosen.shares.sum() + chosen.rest)
        return "ambiguous", rest, {catalogue.name(int(row)): float(shares[row]) for row in chosen.rows}
    if kind == "image":
        sight = see_table(shot.image, shot.camera, catalogue, T_world_table=T_world_table, top=1000)
        answer = sight.objects[0].answer
    else:
        whole = WholeObject(outline=outline) if kind.startswith("both") else None
        answer = identify_points(points, FreeRays.none(), catalogue, top=10_000, priors=Priors(whole=whole))
    out.cpu.append(time.process_time() - start + elapsed * kind.startswith("both"))
    return answer.status, answer.unknown_probability, shares_of(answer)


def run(catalogue: tanteo.Catalogue, kind: str, scenes: int, seed: int = 1, *, verbose: bool = False) -> Seen:
    """Run scenes with parts drawn from the whole catalogue."""
    out = Seen()
    for number in range(scenes):
        rng = np.random.default_rng((seed, number))
        part = catalogue[int(rng.integers(len(catalogue)))]
        found = answered(catalogue, kind, part, rng, out)
        if found is None:
            continue
        status, unknown, shares = found
        best = out.count(part.name, status, unknown, shares)
        if verbose:
            own = f"own {shares.get(part.name, 0):.3f}, unknown {unknown:.3f}"
            print(number, part.name, status, best, own, f"{out.left[-1]} left, {out.cpu[-1]:.1f} s", flush=True)
    return out


def row_of(size: int, kind: str, out: Seen) -> tuple[str, ...]:
    """Return a row of the table."""
    n = len(out.cpu)
    return (
        f"{size:,}", KINDS[kind], str(n), f"{np.median(out.cpu):.1f}", f"{np.quantile(out.cpu, 0.9):.1f}",
        f"{np.median(out.left):.0f}", f"{100 * out.outline / n:.0f} %", *out.rates(),
    )  # fmt: skip


COLUMNS = (
    "parts", "sensed by", "scenes", "CPU s, median", "90 %", "left by the outline, median", "true part among them",
    "true part kept", "right", "among several", "left open", "wrong and sure",
)  # fmt: skip


def main() -> None:
    """Measure one catalogue, and print a table."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("catalogue")
    words.add_argument("scenes", type=int, nargs="?", default=20)
    words.add_argument("kinds", nargs="*", metavar="KIND", default=list(KINDS))
    words.add_argument("--seed", type=int, default=1)
    words.add_argument("--verbose", action="store_true", help="print a line for each scene")
    given = words.parse_args()
    catalogue = tanteo.open_catalogue(given.catalogue)
    found = {kind: run(catalogue, kind, given.scenes, given.seed, verbose=given.verbose) for kind in given.kinds}
    rows = [row_of(len(catalogue), kind, out) for kind, out in found.items()]
    print(Table("Outlines", "Scenes whose part leaves the image are excluded.", COLUMNS, rows).markdown())


if __name__ == "__main__":
    main()
