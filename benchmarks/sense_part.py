"""Which part is it and where, by a hand that touches nothing: ``python benchmarks/sense_part.py [scenes] [policies]``.

A part of the examples, turned anyhow, on a table with a clamp beside it; its middle is known to 15, 15 and 5 mm, its
attitude to 2, 2 and 8 degrees (1 sd), nothing else. The paper's gripper senses until one of the twelve parts has a
probability of 99 % and all corners are within 2 mm with 95 %, or until 60 readings. Every policy has the same scenes.
``--processes`` and ``--keep`` as in ``campaign.py``.
"""

from __future__ import annotations

import os
import sys
import time
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign import options, run_cases
from common import Table

from tanteo.parts import read_part
from tanteo.planning import sense_part
from tanteo.posterior import prepare
from unknown_scenes import off, unknown_scene, unknown_session

FOLDER = Path(__file__).parents[1] / "examples" / "parts"
TOLERANCE = 2e-3


@cache
def _targets():
    return [prepare(read_part(path)) for path in sorted(FOLDER.glob("*.step"))]


def run_one(policy, k):
    """Return the result of one scene, and its true error."""
    targets = _targets()
    rng = np.random.default_rng((1991, k))
    number = k % len(targets)
    unknown = unknown_scene(targets, number, rng)
    session = unknown_session(unknown, policy, seed=k, tolerance=TOLERANCE, max_measurements=60)
    start = time.process_time()
    done = sense_part(session, unknown.robot, unknown.rules, furniture=unknown.furniture)
    P = session.state.of_parts()
    return {
        "k": k, "part": targets[number].part.name, "right": bool(len(P) and np.argmax(P) == number),
        "reached": done.end.reached, "status": session.answer().status,
        "off": off(session, number, unknown.T_world_part), "readings": session.count,
        "stops": sum(v.step is not None for v in done.visits), "asked": len(done.visits), "seconds": done.seconds,
        "travel": done.travel, "clear": unknown.clear, "cpu": time.process_time() - start,
    }  # fmt: skip


def summary(policy, rows):
    """Return one row of the table."""
    ended = [r for r in rows if r["reached"]]

    def spread(name, unit=1.0, digits=0):
        values = unit * np.array([r[name] for r in rows])
        return f"{np.median(values):.{digits}f} ({np.percentile(values, 90):.{digits}f})"

    return (
        policy, str(len(rows)), f"{sum(r['right'] for r in rows)}", f"{len(ended)}",
        f"{sum(r['off'] <= TOLERANCE for r in ended)}", spread("off", 1e3, 2), spread("readings"), spread("stops"),
        spread("seconds"), spread("travel", 1.0, 1), f"{1e3 * min(r['clear'] for r in rows):.1f} mm",
        f"{sum(r['clear'] <= 0 for r in rows)}", spread("cpu", 1.0, 0),
    )  # fmt: skip


def main() -> None:
    arguments, keep, processes = options(sys.argv[1:])
    scenes = int(arguments[0]) if arguments else 12
    policies = arguments[1:] or ["information"]
    cases = [(policy, k) for policy in policies for k in range(scenes)]
    rows = run_cases(run_one, cases, keep, processes)
    table = [summary(policy, rows[k * scenes :][:scenes]) for k, policy in enumerate(policies)]
    columns = (
        "policy", "scenes", "right part", "goal reached", "of these within 2 mm", "worst corner off, mm", "readings",
        "stops of the hand", "seconds", "travel, m", "least clearance", "contacts", "processor seconds",
    )  # fmt: skip
    text = f"Median (90th percentile); load of the machine {os.getloadavg()[0]:.1f}."
    print(Table("A part sensed by a hand", text, columns, table).markdown())


if __name__ == "__main__":
    main()
