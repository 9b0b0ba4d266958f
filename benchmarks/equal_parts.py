"""Several equal parts in one set of readings: ``python benchmarks/equal_parts.py [scenes] [seed] [--kind NAME]``.

Two or three parts lie beside each other, turned about z, and each is touched 9 to 14 times, in mixed order. In the
other kinds there is one part, and several must not be found. The table has the scenes in which the true number was
found with every pose within five corner sds. Beside it are those in which each part is recognized from its own readings
alone: no more can be expected. The last columns count the scenes with several parts found, and with a pose farther off.
"""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign import options, run_cases
from common import Table

import tanteo
from bare_scenes import beams, box_centred_pose, off
from tanteo.geometry import SE3, SO3
from tanteo.posterior import prepare

FOLDER = Path(__file__).parents[1] / "examples" / "parts"
PARTS = ("block", "bracket_left", "clamp", "housing", "wedge", "flange", "t_slot", "step_12mm")
KINDS = {"two": 2, "three": 3, "one": 1, "one, a third outliers": 1, "one, noise x 4": 1, "one, bent 2 mm": 1,
         "one, half read elsewhere": 1}  # fmt: skip
SD = 5e-5


@cache
def target(name):
    """Return a prepared part."""
    return prepare(tanteo.read_part(FOLDER / f"{name}.step"))


def run_one(kind, seed, k):
    """Return the number of parts found and whether their poses are right."""
    rng = np.random.default_rng((seed, list(KINDS).index(kind), k))
    part, count = target(PARTS[k % len(PARTS)]), KINDS[kind]
    first = box_centred_pose(rng, 0.3)
    Ts = [first]
    for n in range(1, count):
        turn = SO3.axis_rotation(2, rng.uniform(-0.1, 0.1))
        step = np.array([n * rng.uniform(1.05, 1.6) * part.part.diagonal, 0, 0])
        Ts.append(SE3.from_parts(turn @ first[:3, :3], first[:3, 3] + step))
    points, directions, numbers = [], [], []
    for number, T in enumerate(Ts):
        n = int(rng.integers(9, 15)) * (1 if count > 1 else 2)
        p, d = beams(part, n, rng, tilt=0.2)
        if kind == "one, bent 2 mm":
            axes = np.linalg.svd(p - p.mean(axis=0), full_matrices=False)[2]
            along = (p - p.mean(axis=0)) @ axes[0]
            p = p + (2e-3 * (along / np.abs(along).max()) ** 2)[:, None] * axes[2]
        points.append(SE3.apply(T, p))
        directions.append(d @ T[:3, :3].T)
        numbers += [number] * n
    points, directions = np.concatenate(points), np.concatenate(directions)
    points = points + (4 if kind == "one, noise x 4" else 1) * SD * rng.normal(size=points.shape)
    rows = rng.permutation(len(points))
    if kind == "one, a third outliers":
        some = rows[: len(points) // 3]
        points[some] += rng.uniform(-0.02, 0.02, (len(some), 1)) * directions[some]
    if kind == "one, half read elsewhere":  # the part moved between two halves of the run
        points[len(points) // 2 :] += rng.normal(size=3) * 2e-3
    mixed = rows if k % 2 else np.arange(len(points))
    numbers = np.array(numbers)

    def located(rows):
        """Return the answer of some of the readings."""
        aimed = {"directions": directions[rows]} if k % 4 < 2 else {}
        readings = tanteo.Readings.from_columns(points=points[rows], sds=np.full(len(rows), SD), **aimed)
        return tanteo.locate(readings, part, conventions=False)

    answer = located(mixed)
    alone = all(located(mixed[numbers[mixed] == n]).status == "recognized" for n in range(count) if count > 1)
    found = (answer, *answer.equal)
    best = [one.hypotheses[0] for one in found if one.hypotheses]
    near = [any(off(part.part, h.T_world_part, T)[0] < 5 * h.corner_sd + 1e-5 for T in Ts) for h in best]
    return {"status": answer.status, "found": len(found), "right": len(found) == count and all(near),
            "alone": alone, "wrong": answer.status == "recognized" and not all(near)}  # fmt: skip


def main():
    """Print the table."""
    rest, keep, processes = options(sys.argv[1:])
    kinds = [rest.pop(rest.index("--kind") + 1)] if "--kind" in rest else KINDS
    scenes, seed = [*map(int, (text for text in rest if text.isdecimal())), *(100, 1)[len(rest) :]][:2]
    out = []
    for kind in kinds:
        rows = run_cases(run_one, [(kind, seed, k) for k in range(scenes)], keep, processes)
        several = sum(row["found"] > 1 for row in rows)
        right = sum(row["right"] and row["status"] == "recognized" for row in rows)
        alone = sum(row["alone"] for row in rows) if KINDS[kind] > 1 else "-"
        out.append((kind, str(right), str(alone), str(several), str(sum(row["wrong"] for row in rows))))
        print(*out[-1], sep="\t", flush=True)
    columns = ("kind", "recognized, right number", "recognized alone", "several found", "a pose farther off")
    print(Table("Several equal parts", f"{scenes} scenes a row, seed {seed}.", columns, out).markdown())


if __name__ == "__main__":
    main()
