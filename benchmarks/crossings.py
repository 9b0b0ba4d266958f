"""Edges of a plate from crossings alone: ``python benchmarks/crossings.py [units] [standoff_mm]``.

The hand stands askew by about a degree over the face, crosses its edge at three places, there and back, and the fit of
the events is compared with the true edge. Every unit has its own bias, scale and mounting of all sensors.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from common import Table

from felt_scenes import gripper, nees
from tanteo.geometry import SE3, SO3
from tanteo.hand.acquisition import fitted_feature, labelled_readings
from tanteo.hand.motion import Rules, cross_edge, go_to
from tanteo.hand.simulator import Cell, Scene, SimulatedHand, box

PLATE = Scene.of([box("plate", [-0.1, -0.1, -0.02], [0.1, 0.1, 0.0])])
ASKEW = 0.02


def over(x, y, height, tilt):
    """Return the pose of the hand that points down, its front above a place, rotated about its front."""
    R = np.diag([1.0, -1.0, -1.0]) @ SO3.exp(np.array([*tilt, 0.0]))
    return SE3.from_parts(R, np.array([x, y, height]) - R @ gripper().front)


def edge_of_unit(seed, standoff):
    """Squared error of the edge in its covariance, or None if the events contradict each other."""
    rng, inset, rules = np.random.default_rng(seed), 0.3 * standoff + 0.006, Rules(clearance=0.6 * standoff)
    middle = rng.uniform(-0.03, 0.03)

    def place(shift):
        y = 0.1 - inset + rng.uniform(-2e-4, 2e-4)
        return over(middle + shift, y, standoff, ASKEW * rng.normal(size=2))

    cell = Cell(latency=rng.uniform(0, 0.06))
    robot = SimulatedHand(PLATE, gripper(), place(0.0), rng=np.random.default_rng((seed, 1)), cell=cell)
    events = []
    for shift in (0.0, 0.012, -0.012):
        go_to(robot, place(shift), rules)
        events += cross_edge(robot, [0, -1, 0], inset + 0.012, standoff, rules, spread=0.01).events
    feature, why = fitted_feature(labelled_readings(gripper(), events, "edge", "edge"), "edge", gripper().rig, None)
    return None if feature is None or why else nees(PLATE, feature)[0]


def main(units=240, standoff_mm=20):
    values = [edge_of_unit(seed, 1e-3 * standoff_mm) for seed in range(units)]
    good = np.array([v for v in values if v is not None])
    row = (
        f"{standoff_mm} mm", str(units), str(units - len(good)), f"{good.mean() / 4:.3f}",
        f"{np.sqrt(0.5 / len(good)):.3f}",
    )  # fmt: skip
    columns = ("stand-off", "units", "refused", "NEES / dof", "standard error")
    print(
        Table(
            "Edges from crossings", f"`python benchmarks/crossings.py {units} {standoff_mm}`", columns, [row]
        ).markdown()
    )


if __name__ == "__main__":
    main(*(int(x) for x in sys.argv[1:]))
