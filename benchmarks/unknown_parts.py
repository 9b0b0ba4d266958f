"""Rate at which an unknown part is taken for a known one: ``python benchmarks/unknown_parts.py [scenes] [seed]``.

One of eight example parts is sensed without correspondences. The catalogue holds once only the seven others, once all
eight. The first table has the answers in both cases, the probability of the unknown object, and how often the part
itself is named if it is in the catalogue. The second table has two parts that differ by one face, 3 mm higher; one is
sensed while the catalogue holds the other. ``--processes`` and ``--keep`` work as in ``campaign.py``.
"""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign import options, run_cases
from common import Table
from region_coverage import FOLDER, PARTS

import tanteo
from bare_scenes import SENSORS, box_centred_pose, scene
from tanteo.factors import FreeRays
from tanteo.posterior import identify_points, prepare

COUNTS = 10, 16, 25
STEPS = "step_12mm", "step_15mm"


@cache
def catalogue():
    """Return the eight prepared parts."""
    return [prepare(tanteo.read_part(FOLDER / f"{name}.step")) for name in PARTS]


def both(name, s, n, seed, k):
    """Return the answers to one scene, without the part in the catalogue and with it."""
    targets, sensing = catalogue(), SENSORS[s]
    own = targets[PARTS.index(name)]
    rng = np.random.default_rng((seed, PARTS.index(name), s, n, k))
    touches, _, _ = scene(own, box_centred_pose(rng), sensing, n, rng)
    row = {}
    for kind, some in (("without", [t for t in targets if t is not own]), ("with", targets)):
        answer = identify_points(touches, FreeRays.none(), some)
        best = answer.hypotheses[0].part if answer.hypotheses else ""
        row[kind] = {"status": answer.status, "best": best, "unknown": answer.unknown_probability}
    return row


def summary(rows):
    """Return the rates of the answers without the part, and with it."""
    without, with_ = ([(case[0], row[kind]) for case, row in rows] for kind in ("without", "with"))
    n = len(rows)
    return (
        f"{sum(r['status'] == 'recognized' for _, r in without)}/{n}",
        f"{sum(r['status'] == 'unknown' for _, r in without)}/{n}",
        f"{np.mean([r['unknown'] for _, r in without]):.2f}",
        f"{sum(r['status'] == 'recognized' and r['best'] == name for name, r in with_)}/{n}",
        f"{sum(r['status'] == 'recognized' and r['best'] != name for name, r in with_)}/{n}",
        f"{sum(r['status'] == 'unknown' for _, r in with_)}/{n}",
        f"{np.mean([r['unknown'] for _, r in with_]):.3f}",
    )


@cache
def steps():
    """Two parts of which one has a higher step, prepared."""
    return {name: prepare(tanteo.read_part(FOLDER / f"{name}.step")) for name in STEPS}


def of_one_face(name, s, n, seed, k):
    """Return the answer about a part by a catalogue that holds the other, and the number of readings off that one."""
    own, sensing = steps()[name], SENSORS[s]
    other = steps()[next(x for x in STEPS if x != name)]
    rng = np.random.default_rng((seed, STEPS.index(name), s, n, k))
    T = box_centred_pose(rng)
    touches, _, _ = scene(own, T, sensing, n, rng)
    answer = identify_points(touches, FreeRays.none(), [other, *(t for t in catalogue() if "step" not in t.part.name)])
    off = other.surface.closest((touches.points - T[:3, 3]) @ T[:3, :3]).distances > 5 * sensing.sd
    return {"status": answer.status, "off": int(off.sum()), "face": "readings agree" in answer.message}


def variants(scenes, seed, keep, processes):
    """Two parts that differ by one face."""
    cases = [(name, s, n, seed, k) for k in range(scenes) for s in (0, 1) for n in COUNTS for name in STEPS]
    done = list(zip(cases, run_cases(of_one_face, cases, keep, processes), strict=True))
    table = []
    for s in (0, 1):
        for low, high in ((0, 0), (1, 1), (2, 99)):
            rows = [r for c, r in done if c[1] == s and low <= r["off"] <= high]
            rates = [f"{sum(r['status'] == x for r in rows)}/{len(rows)}" for x in ("recognized", "unknown")]
            off = f"{low}" if low == high else f"{low} or more"
            table.append((SENSORS[s].name, off, *rates, f"{sum(r['face'] for r in rows)}"))
    columns = "sensor", "readings off the known part", "taken for it", "unknown", "face named"
    text = f"{' and '.join(STEPS)}, {scenes} scenes each, {', '.join(map(str, COUNTS))} readings, seed {seed}."
    return Table("One face elsewhere", text, columns, table)


def run(scenes, seed, keep, processes):
    """Return a table of all scenes."""
    cases = [
        (name, s, n, seed, k) for k in range(scenes) for s in range(len(SENSORS)) for n in COUNTS for name in PARTS
    ]
    done = list(zip(cases, run_cases(both, cases, keep, processes), strict=True))
    rows = [
        (sensing.name, str(n), *summary([(c, r) for c, r in done if c[1] == s and c[2] == n]))
        for s, sensing in enumerate(SENSORS)
        for n in COUNTS
    ]
    columns = (
        "sensor", "readings", "taken for another", "unknown", "P(none), mean",
        "in the catalogue: named", "another named", "unknown", "P(none), mean",
    )  # fmt: skip
    return Table("Strangers", f"8 parts x {scenes} scenes a row, seed {seed}.", columns, rows)


if __name__ == "__main__":
    rest, keep, processes = options(sys.argv[1:])
    scenes, seed = (int(rest[i]) if len(rest) > i else default for i, default in ((0, 4), (1, 20261203)))
    print(run(scenes, seed, keep, processes).markdown())
    print(variants(5 * scenes, seed, keep and keep.with_suffix(".variants.jsonl"), processes).markdown())
