"""Rounded logs and repeated places: ``python benchmarks/rounded_logs.py [scenes] [seed] [--kind NAME]``.

An example part lies within 10 mm and 5 degrees of its prior pose and is touched at 12 places along the axes of the
machine, which writes a GRBL log with a fixed step. Noise is along the approach only, as of a probe. No standard
deviation is stated. The table has the number of scenes by status, the share of truths inside the 95 % region of the
best pose among the recognized, and the median of the largest corner sd. ``--processes`` and ``--keep`` work as in
``campaign.py``.
"""

from __future__ import annotations

import sys
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign import options, run_cases
from common import Table

import tanteo
from bare_scenes import inside, nees, surface_points
from tanteo.geometry import SE3, SO3
from tanteo.posterior import prepare

FOLDER = Path(__file__).parents[1] / "examples" / "parts"
PARTS = ("housing", "block", "bracket_left", "clamp", "step_12mm")
KINDS = {
    "30 repeats, 0.001 mm": (30, 1e-6, 2e-6),
    "5 repeats, 0.001 mm": (5, 1e-6, 2e-6),
    "0.001 mm": (1, 1e-6, 2e-7),
    "0.01 mm": (1, 1e-5, 2e-6),
    "0.1 mm": (1, 1e-4, 2e-5),
    "5 repeats, 0.1 mm": (5, 1e-4, 2e-5),
}
"""Touches of the first place, step and noise [m]."""
RADIUS, DRIFT = 1e-3, 1.2e-6


@cache
def target(name):
    """Return a prepared part."""
    return prepare(tanteo.read_part(FOLDER / f"{name}.step"))


def touches(part, T, n, rng):
    """Return contacts on flat faces that an axis of the machine meets steeply, normals and approach axes ``(n, 3)``."""
    found = []
    while len(found) < n:
        p, normals = surface_points(part, 1, rng)
        p, normal = SE3.apply(T, p)[0], normals[0] @ T[:3, :3].T
        axis = int(np.argmax(np.abs(normal)))
        aim = -np.sign(normal[axis]) * np.eye(3)[axis]
        free = part.surface.cast(SE3.apply(SE3.inverse(T), p - 0.3 * aim)[None], (aim @ T[:3, :3])[None]).distances[0]
        if abs(normal[axis]) > 0.8 and abs(free - 0.3) < 1e-6 and aim[2] < 0.5:
            found.append((p, normal, aim))
    return tuple(np.array(column) for column in zip(*found, strict=True))


def log_of(part, T, n, repeats, step, noise, rng):
    """Return the text of a GRBL log."""
    p, normal, aim = touches(part, T, n, rng)
    centres = p + RADIUS * normal
    rows = [*range(n), *[0] * (repeats - 1)]
    lines = []
    decimals = round(-np.log10(step * 1e3))
    for count, k in enumerate(rows):
        across = np.abs(aim[k]) < 0.5
        place = np.where(across, np.round(centres[k] / step) * step, centres[k])
        # the commanded place is on the grid: the contact moves along the approach accordingly
        slope = normal[k] @ (place - centres[k]) / (normal[k] @ aim[k])
        place = place - (slope - noise * rng.normal() - DRIFT * count) * aim[k]
        lines.append("[PRB:" + ",".join(f"{x * 1e3:.{decimals}f}" for x in place) + ":1]")
    return "\n".join(lines) + "\n"


def run_one(kind, seed, k):
    """Return status, consistency and size of the answer of one scene."""
    rng = np.random.default_rng((seed, list(KINDS).index(kind), k))
    repeats, step, noise = KINDS[kind]
    part = target(PARTS[k % len(PARTS)])
    middle = SE3.from_parts(np.eye(3), np.array([0.3, 0.2, -0.05]))
    xi = rng.normal(size=6) * np.array([5e-3, 5e-3, 5e-3, 0.01, 0.01, 0.05])
    T = middle @ SE3.from_parts(SO3.exp(xi[3:]), xi[:3])
    text = log_of(part, T, 12, repeats, step, noise, rng)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.txt"
        path.write_text(text)
        readings = tanteo.read_readings(path, radius=RADIUS)
    near = tanteo.PosePrior(T_world_part=middle, covariance=np.diag(np.repeat([0.01, 0.09], 3) ** 2))
    answer = tanteo.locate(readings, part, priors=tanteo.Priors(pose=near))
    best = answer.hypotheses[0]
    value, dof = nees(part.part, best.T_world_part, best.covariance, T)
    wrong = answer.status == "recognized" and value > 10 * dof
    return {"status": answer.status, "covered": bool(inside(value, dof)), "corner": best.corner_sd,
            "nees": value / dof, "wrong": bool(wrong)}  # fmt: skip


def main():
    """Print the table."""
    rest, keep, processes = options(sys.argv[1:])
    kinds = [rest.pop(rest.index("--kind") + 1)] if "--kind" in rest else KINDS
    scenes, seed = [*map(int, (text for text in rest if text.isdecimal())), *(100, 1)[len(rest) :]][:2]
    out = []
    for kind in kinds:
        rows = run_cases(run_one, [(kind, seed, k) for k in range(scenes)], keep, processes)
        some = [row for row in rows if row["status"] == "recognized"]
        share = np.mean([row["covered"] for row in some]) if some else np.nan
        counts = ", ".join(
            f"{sum(row['status'] == s for row in rows)} {s}" for s in dict.fromkeys(row["status"] for row in rows)
        )
        corner = 1e3 * np.median([row["corner"] for row in some]) if some else np.nan
        error = np.sqrt(max(share * (1 - share), 1 / len(rows)) / max(len(some), 1))
        out.append((kind, counts, f"{share:.2f} +- {error:.2f}", f"{np.median([r['nees'] for r in rows]):.2f}",
                    str(sum(row["wrong"] for row in rows)), f"{corner:.3g}"))  # fmt: skip
        print(*out[-1], sep="\t", flush=True)
    columns = ("kind", "status", "covered", "median NEES / dof", "recognized and wrong", "corner sd mm")
    print(Table("Rounded logs", f"{scenes} scenes a row, seed {seed}.", columns, out).markdown())


if __name__ == "__main__":
    main()
