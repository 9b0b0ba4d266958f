"""The body of the tool stays within the workspace along every path, also while it rotates."""

from __future__ import annotations

import numpy as np
import pytest

from machines.cells import DOWN, START, at, robot, world
from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.hand import ForbiddenBox, Workspace
from tanteo.machines import DirectMachine, MachineLimits, SafeMachine, tool_body
from tanteo.machines.protocol import MachineStatus, RefusedError

LOW, HIGH = np.array([-0.2, -0.2, 0.0]), np.array([0.3, 0.3, 0.4])
TOOL = tool_body(0.05, 1e-3, 0.02, 0.1)


def pose(degrees: float, place, axis: int = 1) -> np.ndarray:
    """Tool that points down, turned about an axis."""
    turn = np.zeros(3)
    turn[axis] = np.radians(degrees)
    return SE3.from_parts(SO3.exp(turn) @ np.diag([1.0, -1.0, -1.0]), np.asarray(place, dtype=float))


def limits(*boxes, body=TOOL) -> MachineLimits:
    return MachineLimits(Workspace(LOW, HIGH, boxes), 1e-3, travel=0.2, body=body)


def test_the_spheres_enclose_the_cylinders():
    rng = np.random.default_rng(3)
    for radius, first, last in ((1e-3, 0.0, 0.05), (0.02, 0.07, 0.13)):
        depth, angle = rng.uniform(first, last, 500), rng.uniform(0, 2 * np.pi, 500)
        points = np.stack([radius * np.cos(angle), radius * np.sin(angle), -depth], axis=1)
        inside = np.linalg.norm(points[:, None] - TOOL.centres, axis=2) <= TOOL.radii + 1e-9
        assert inside.any(axis=1).all()


def test_a_tool_that_turns_into_a_box_is_refused():
    """The tip stays free, and so do the bodies at both ends; between them the tool sweeps the box."""
    vise = ForbiddenBox("vise", np.array([0.1, -0.05, 0.26]), np.array([0.15, 0.05, 0.3]))
    tip = [0.0, 0.0, 0.2]
    ends = [pose(0, tip), pose(90, tip)]
    axes = [T[:3, :3] for T in ends]
    here = ends[0][:3, 3]
    assert not limits(vise, body=None).violation(here, here, axes)
    free = limits(vise)
    assert not free.violation(here, here, [axes[0]] * 2)
    assert not free.violation(here, here, [axes[1]] * 2)
    assert "vise" in free.violation(here, here, axes)
    assert "vise" in free.violation(here, here, axes[::-1])


@pytest.mark.parametrize("degrees", [100, -100, 170])
def test_a_tool_outside_the_workspace_is_refused(degrees):
    with robot(np.array([0.0, 0.0, 0.06])) as (machine, fake):
        safe = SafeMachine(machine, limits())
        with pytest.raises(RefusedError, match="with the body of the tool"):
            safe.move(pose(degrees, [0.0, 0.0, 0.02]))
        assert not fake.tip.travelled


def test_a_path_whose_ends_are_free_may_be_refused():
    """A forbidden box above the tip's path, lower than the tool: the tip passes under it, the tool does not."""
    beam = ForbiddenBox("beam", np.array([0.04, -0.1, 0.12]), np.array([0.06, 0.1, 0.2]))
    safe = SafeMachine(DirectMachine(world(), np.array([-0.05, 0.08, 0.05])), limits(beam))
    with pytest.raises(RefusedError, match="beam' with the body"):
        safe.move(SE3.from_parts(np.diag([1.0, -1.0, -1.0]), np.array([0.15, 0.08, 0.05])))
    assert not safe.machine.tip.travelled


def test_a_touch_is_limited_with_the_body():
    ceiling = ForbiddenBox("ceiling", np.array([-0.2, -0.2, 0.35]), np.array([0.3, 0.3, 0.39]))
    with robot(np.array([0.0, 0.0, 0.17])) as (machine, fake):
        safe = SafeMachine(machine, limits(ceiling))
        with pytest.raises(RefusedError, match="ceiling"):
            safe.sense(-DOWN, 0.05)
        assert not fake.tip.travelled


def test_random_paths_are_judged_as_by_fine_sampling():
    rng = np.random.default_rng(8)
    boxes = [ForbiddenBox("a", np.array([0.05, 0.0, 0.1]), np.array([0.15, 0.1, 0.25]))]
    one, refused = limits(*boxes), 0
    for _ in range(20):
        here, goal = rng.uniform(LOW + 0.05, HIGH - 0.05, (2, 3))
        R0 = SO3.exp(rng.normal(0, 0.7, 3)) @ np.diag([1.0, -1.0, -1.0])
        turn = rng.normal(0, 0.7, 3)
        s = np.linspace(0, 1, 1500)[:, None]
        poses = SE3.from_parts(R0 @ SO3.exp(s * turn), here + s * (goal - here))
        smallest = one.workspace.of_body(TOOL, poses).min()
        reason = one.violation(here, goal, [R0, R0 @ SO3.exp(turn)])
        refused += bool(reason)
        assert reason or smallest >= 0
        if reason.endswith("of the tool"):
            assert smallest < 1e-3  # refused within one step of the limit at most
    assert 3 < refused < 20


def test_unknown_axes_are_no_orientation():
    class Blind(DirectMachine):
        def status(self):
            return MachineStatus("idle", self.tip.place, False, 0.0, "", np.full((3, 3), np.nan))

    with pytest.raises(Exception, match="axes of the tool"):
        SafeMachine(Blind(world(), START, turns=True), limits()).move(at(0, 0, 200))


@pytest.mark.parametrize("values", [(0, 1e-3, 0.02, 0.1), (0.05, 1e-3, np.nan, 0.1), (0.05, 1e-3, 0.02, np.inf)])
def test_a_tool_without_a_size_is_refused(values):
    with pytest.raises(InputError, match="positive length"):
        tool_body(*values)
