"""Collisions of a simulated cell: ``python benchmarks/cell.py [runs seed readings sensors]``.

A UR5e with the paper's hand senses a part on the table of ``tanteo.bench.demo``, beside a vise. In each run the part is
another one of the twelve candidates, and its pose is drawn from the prior of the scene: 15 mm and 8 degrees about the
vertical (one standard deviation). A session ends at a probability of 99 %, or after ``readings``. ``sensors`` is
``camera,proximity`` or ``proximity``. Printed are: runs in which a link of the arm or the hand touched something by the
true scene, with the upper bound of 95 % on their rate; the least clearance of the hand; how often the part was right;
commands that the controller limited; the processor time.

``--keep FILE`` and ``--processes N``: ``campaign.py``. Needs the extra ``sim``.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from functools import cache
from importlib import resources

import numpy as np
from campaign import options, run_cases
from common import Table
from scipy.stats import beta

from tanteo import io
from tanteo.catalogue import read_parts
from tanteo.geometry import SE3, SO3
from tanteo.hand.simulator import Scene, Solid
from tanteo.io.scenes.hand_camera import HandCamera
from tanteo.planning import Stop, sense_part
from tanteo.posterior import prepare_all

RUNS, SEED, READINGS, SENSORS = 12, 571, 30, "camera,proximity"
ARM, PROBABILITY, SPREAD, TURN = "ur5e", 0.99, 0.015, np.radians(8.0)
BESIDE = 0.02
"""Least distance of the part from the vise [m]."""


@cache
def cell():
    """Return the scene of the demo and its candidate parts."""
    with resources.as_file(resources.files("tanteo.bench.demo")) as folder:
        scene = io.scenes.sessions.on_arm(io.read_scene(folder / "cell.toml"), ARM)
        return scene, prepare_all("parts", list(read_parts([folder / "parts"], unit="mm").parts))


def drawn(run, seed):
    """Return the scene of a run with another part in a random pose, and the name of the part."""
    scene, targets = cell()
    part, rng = targets[run % len(targets)].part, np.random.default_rng([seed, run])
    vise = min(solid.vertices[:, 0].min() for solid in scene.furniture if solid.name.startswith("vise"))
    yaw = np.arctan2(scene.prior.T[1, 0], scene.prior.T[0, 0])
    while True:
        T = SE3.from_parts(SO3.axis_rotation(2, yaw + TURN * rng.normal()), np.zeros(3))
        T[:2, 3] = scene.prior.T[:2, 3] - SE3.apply(T, part.centroid)[:2] + SPREAD * rng.normal(size=2)
        T[2, 3] = -SE3.apply(T, part.vertices)[:, 2].min()
        if SE3.apply(T, part.vertices)[:, 0].max() < vise - BESIDE:
            break
    solids = [s for s in scene.scene.solids if s.name != "unknown"]
    solids.append(Solid.at("unknown", part.vertices, part.triangles, T))
    return replace(scene, scene=Scene.of(solids), seed=int(rng.integers(1 << 30))), part.name


def run_cell(run, seed, readings, sensors):
    """Return what happened in one run."""
    scene, name = drawn(run, seed)
    begun = time.process_time()
    start, _ = io.scenes.start_of(scene, cell()[1])
    session, robot, rules = io.scenes.session_of(scene, start, Stop(probability=PROBABILITY, max_measurements=readings))
    eyes = HandCamera(scene, robot, start.targets, start) if "camera" in sensors else None
    done = sense_part(
        session, robot, rules, furniture=io.scenes.furniture_of(scene), errors=scene.cell.robot, reach=robot.carrier,
        eyes=eyes,
    )  # fmt: skip
    answer, facts = session.answer(), robot.carrier.facts
    best = answer.hypotheses[0].part if answer.hypotheses else ""
    return {
        "part": name, "named": best, "status": answer.status, "reached": done.end.reached,
        "contacts": [f"{one['link']} {one['solid']}" for one in facts["contacts"]], "stops": facts["stops"],
        "clearance": io.scenes.least_clearance(scene, robot), "seconds": done.seconds, "readings": session.count,
        "views": 0 if eyes is None else len(eyes.views), "spent": time.process_time() - begun,
    }  # fmt: skip


def report(rows):
    """Return a table with one row for all runs."""
    n, touched = len(rows), sum(bool(r["contacts"]) or r["clearance"] <= 0 for r in rows)
    sure = [r for r in rows if r["status"] == "recognized"]
    most = float(beta.ppf(0.95, touched + 1, n - touched))
    median = {name: float(np.median([r[name] for r in rows])) for name in ("readings", "views", "seconds", "spent")}
    head = (
        "runs with contact", "rate below (95 %)", "least clearance [mm]", "recognized", "of these right",
        "runs with limited commands", "readings", "views", "simulated time [s]", "CPU [s]",
    )  # fmt: skip
    row = (
        f"{touched} of {n}", f"{100 * most:.1f} %", f"{1e3 * min(r['clearance'] for r in rows):.1f}", str(len(sure)),
        str(sum(r["named"] == r["part"] for r in sure)), str(sum(bool(r["stops"]) for r in rows)),
        *(f"{median[name]:.0f}" for name in ("readings", "views", "seconds", "spent")),
    )  # fmt: skip
    return Table("Collisions of a simulated cell", "Medians of readings, views and times.", head, [row])


def main():
    arguments, keep, processes = options(sys.argv[1:])
    runs, seed, readings = (
        int(arguments[k]) if len(arguments) > k else v for k, v in enumerate((RUNS, SEED, READINGS))
    )
    sensors = arguments[3] if len(arguments) > 3 else SENSORS
    cases = [(run, seed, readings, sensors) for run in range(runs)]
    print(report(run_cases(run_cell, cases, keep, processes)).markdown())


if __name__ == "__main__":
    main()
