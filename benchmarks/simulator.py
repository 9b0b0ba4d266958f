"""How fast the simulated hand is: ``python benchmarks/simulator.py``.

Steps of the six-sensor gripper at 100 Hz over a bracket on a table, one ray a reading and filled cones, and rays of a
batch. Times are the processor's, of one core, and the best of several rounds counts: what else the machine does is left
out as far as can be.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from common import Table

import tanteo
from tanteo.hand import Hand, gripper_body
from tanteo.hand.simulator import Cell, Scene, SimulatedHand, Solid, box
from tanteo.io import read_rig

PART = Path(__file__).parents[1] / "examples" / "parts" / "bracket_left.step"
STEPS = 500


def scene_of_bracket():
    part = tanteo.read_part(PART)
    table = box("table", [-0.5, -0.5, -0.05], [0.5, 0.5, 0.0])
    return Scene.of([table, Solid.at("part", part.vertices, part.triangles, np.eye(4))])


def best(work, calls=STEPS, rounds=20):
    """Processor time of one call."""
    work()
    times = []
    for _ in range(rounds):
        start = time.process_time()
        for _ in range(calls):
            work()
        times.append(time.process_time() - start)
    return min(times) / calls


def steps(scene, cone):
    """Time of one step of a hand that circles over the part."""
    rig = read_rig("paper-gripper")
    hand = Hand(rig, gripper_body(rig))
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    T[:3, 3] = 0.06, 0.04, 0.2
    twist = np.array([0.02, 0.0, 0.0, 0.0, 0.0, 0.5])

    robot = SimulatedHand(scene, hand, T, rng=np.random.default_rng(0), cell=Cell(cone=cone))
    return best(lambda: robot.step(twist))


def rays(scene, n):
    rng = np.random.default_rng(0)
    starts = rng.uniform([-0.1, -0.1, 0.2], [0.2, 0.2, 0.5], (n, 3))
    aims = rng.uniform(-0.1, 0.15, (n, 3)) - starts
    return n / best(lambda: scene.surface.cast(starts, aims), calls=max(1, 50_000 // n))


def main():
    scene = scene_of_bracket()
    rows = []
    for cone, name in ((0, "one ray a reading"), (64, "64 rays a cone")):
        t = steps(scene, cone)
        rows.append((f"six sensors at 100 Hz, {name}", f"{1e6 * t:.0f} µs a step", f"{0.01 / t:.0f} x real time"))
    sizes = (1_000, 100_000)
    rows += [(f"batches of {n} rays", "", f"{rays(scene, n) / 1e6:.1f} million rays a second") for n in sizes]
    print(Table("The simulated hand", "`python benchmarks/simulator.py`", ("what", "time", "speed"), rows).markdown())


if __name__ == "__main__":
    main()
