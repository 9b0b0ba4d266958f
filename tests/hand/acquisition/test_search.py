"""Where the first attempt fails, the next one is another: scenes in which it did."""

import numpy as np
import pytest

from felt_scenes import PARTS, gripper, is_meant, make_task
from tanteo.hand.acquisition import sense_edge, sense_plane
from tanteo.hand.motion import Rules
from tanteo.hand.simulator import Cell, SimulatedHand, clearances

SENSE = {"plane": sense_plane, "edge": sense_edge}


@pytest.mark.parametrize(
    ("kind", "seed", "k"),
    [
        pytest.param("plane", 501, 47, id="a narrow face beside the one that is meant comes first"),
        pytest.param("edge", 502, 75, id="the hand does not fit at one of three places", marks=pytest.mark.slow),
    ],
)
def test_another_attempt_is_made(kind, seed, k):
    rng = np.random.default_rng((seed, list(SENSE).index(kind), k))
    task = make_task(rng, kind, PARTS[k % len(PARTS)])
    cell = Cell(latency=rng.uniform(0, 0.06))
    robot = SimulatedHand(task.scene, gripper(), task.T_world_hand, rng=rng, cell=cell)
    rules = Rules(clearance=0.6 * task.standoff, workspace=task.workspace)
    got = SENSE[kind](robot, task.guess, standoff=task.standoff, rules=rules)
    assert got.acquired, got.message
    assert is_meant(task.truth, got.feature)
    assert clearances(task.scene, gripper().body, np.array(robot.truth)).min() > 0.5 * task.standoff
