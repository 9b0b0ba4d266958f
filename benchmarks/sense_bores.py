"""Plates that differ in a bore, sensed by a hand: ``python benchmarks/sense_bores.py [scenes] [policies] [seed]``.

Every scene has a plate of its own with two bores (8 to 16 mm in radius) and two like it: one bore is moved by 3 to 6 mm
or larger by 1.5 to 3 mm. One of the three lies on a table beside a clamp; its middle is known to 15, 15 and 5 mm, its
attitude to 2, 2 and 8 degrees. The paper's gripper senses until one has 99 % and all corners are within 2 mm with 95 %,
or until 200 readings: once it may acquire bores whole, once it only reads where it rests.
``--processes`` and ``--keep`` as in ``campaign.py``.
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
from holes import part_of
from OCP.Message import Message

from bare_scenes import nees
from felt_scenes import gripper
from tanteo.planning import sense_part
from tanteo.planning.execution import acquirable
from tanteo.posterior import prepare
from unknown_scenes import off, unknown_scene, unknown_session

TOLERANCE, MOST = 2e-3, 200
NINETY_FIVE = 12.592
"""Of chi2 with six degrees of freedom."""

WAYS = "bores whole", "readings only"


def _specs(rng):
    """Return a plate and two similar ones, made as in ``holes.py`` [mm]."""
    half, thick = rng.uniform([80, 60], [100, 75]), float(rng.uniform(18, 30))
    places = [np.array([s * rng.uniform(30, 45), rng.uniform(-25, 25)]) for s in (-1, 1)]
    radii = rng.uniform(8, 16, 2)
    turn = rng.uniform(0, 2 * np.pi)
    moved = [places[0] + rng.uniform(3, 6) * np.array([np.cos(turn), np.sin(turn)]), places[1]]
    larger = radii + np.array([0.0, rng.uniform(1.5, 3)])
    each = (places, radii), (moved, radii), (places, larger)
    return [(False, half, thick, [(p, float(r), False) for p, r in zip(*one, strict=True)], []) for one in each]


@cache
def _targets(seed, k):
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    rng = np.random.default_rng((seed, k))
    with tempfile.TemporaryDirectory() as folder:
        specs = enumerate(_specs(rng))
        return [prepare(part_of(spec, f"plate_{'abc'[n]}", Path(folder))) for n, spec in specs]


def run_one(way, policy, seed, k):
    """Return the result of one scene, and its true error."""
    targets, rng = _targets(seed, k), np.random.default_rng((seed, k, 1))
    number = int(rng.integers(3))
    unknown = unknown_scene(targets, number, rng)
    session = unknown_session(unknown, policy, seed=k, tolerance=TOLERANCE, max_measurements=MOST)
    if way == WAYS[0]:
        session.whole = acquirable(gripper(), unknown.rules, session.probe.retreat)
    done = sense_part(session, unknown.robot, unknown.rules, furniture=unknown.furniture)
    P, T = session.state.of_parts(), unknown.T_world_part
    right = bool(len(P) and np.argmax(P) == number)
    planned = [v for v in done.visits if v.action.acquires]
    best = session.answer().hypotheses[0] if right else None
    return {
        "k": k, "right": right, "probability": float(P[number]), "reached": done.end.reached,
        "off": off(session, number, T), "readings": session.count, "seconds": done.seconds,
        "planned": len(planned), "acquired": sum(v.step is not None for v in planned), "clear": unknown.clear,
        "nees": None if best is None else nees(targets[number].part, best.T_world_part, best.covariance, T)[0],
        "notes": [v.note for v in planned],
    }  # fmt: skip


def summary(way, policy, rows):
    """Return one row of the table."""
    ended = [r for r in rows if r["reached"]]
    inside = [r["nees"] <= NINETY_FIVE for r in rows if r["nees"] is not None and r["off"] < 0.02]
    spread = [f"{np.median(v):.0f} ({np.percentile(v, 90):.0f})" for v in
              ([r["readings"] for r in rows], [r["seconds"] for r in rows])]  # fmt: skip
    return (
        f"{policy}, {way}", str(len(rows)), str(sum(r["right"] for r in rows)), str(len(ended)),
        f"{sum(r['right'] for r in ended)}; {sum(r['off'] <= TOLERANCE for r in ended)}",
        f"{sum(inside)} of {len(inside)}", f"{sum(r['acquired'] for r in rows)} of {sum(r['planned'] for r in rows)}",
        *spread, f"{1e3 * min(r['clear'] for r in rows):.1f} mm",
    )  # fmt: skip


def main() -> None:
    arguments, keep, processes = options(sys.argv[1:])
    count = int(arguments[0]) if arguments else 12
    policies = arguments[1].split(",") if len(arguments) > 1 else ["information"]
    seed = int(arguments[2]) if len(arguments) > 2 else 1
    kinds = [(way, policy) for policy in policies for way in WAYS]
    rows = run_cases(run_one, [(*kind, seed, k) for kind in kinds for k in range(count)], keep, processes)
    table = [summary(*kind, rows[n * count :][:count]) for n, kind in enumerate(kinds)]
    columns = (
        "policy", "scenes", "likeliest is right", "goal reached", "of these right; within 2 mm", "in the 95 % region",
        "bores acquired", "readings", "seconds", "least clearance",
    )  # fmt: skip
    print(Table("Plates that differ in a bore", "Median (90th percentile).", columns, table).markdown())


if __name__ == "__main__":
    main()
