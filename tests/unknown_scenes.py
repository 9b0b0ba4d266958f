"""A part at an unknown pose on a table beside a clamp, and a hand above it: for tests and benchmarks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from felt_scenes import gripper
from tanteo.geometry import SE3, SO3
from tanteo.hand import ForbiddenBox, Workspace
from tanteo.hand.motion import Rules
from tanteo.hand.simulator import Cell, Scene, SimulatedHand, Solid, box, clearances
from tanteo.planning import Furniture, Sensing, Session, Stop, at_place, hand_probe
from tanteo.planning.execution import reachable
from tanteo.planning.policies import policy_named
from tanteo.planning.start import Start
from tanteo.planning.stopping import corner_distances

STANDOFF, CLEARANCE = 0.04, 0.012
SDS = np.array([0.015, 0.015, 0.005, np.radians(2), np.radians(2), np.radians(8)])
"""How roughly the place is known: along the axes of the place [m], about them [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class Unknown:
    """The truth, and what may be known of it."""

    scene: Scene
    T_world_part: np.ndarray
    start: Start
    rules: Rules
    furniture: Furniture
    robot: SimulatedHand

    @property
    def clear(self) -> float:
        """Least distance of the whole hand from everything so far [m]."""
        return float(clearances(self.scene, gripper().body, np.array(self.robot.truth)).min())


def unknown_scene(targets, number, rng, *, known=True, cell=None, rest=None) -> Unknown:
    """Return one of the targets, in any rotation on the table, its place drawn from the prior.

    With ``known`` false the planner has no model of the clamp. ``rest`` is the rotation of the part on the table;
    upright if not given.
    """
    part, rest = targets[number].part, np.eye(3) if rest is None else rest
    T_rough = SE3.from_parts(SO3.exp(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)])), np.zeros(3))
    T = SE3.from_parts(SO3.exp(np.array([0.0, 0.0, SDS[5] * rng.normal()])) @ T_rough[:3, :3] @ rest, np.zeros(3))
    T[2, 3] = -SE3.apply(T, part.vertices)[:, 2].min()
    centre = SE3.apply(T, part.centroid)
    # the place is drawn about the truth, with the error that the prior states
    tilt = SO3.exp(SDS[3:] * [1, 1, 0] * rng.normal(size=3))
    T_world_place = SE3.from_parts(T_rough[:3, :3] @ tilt @ rest, centre + SDS[:3] * rng.normal(size=3))
    spread = np.kron(np.eye(2), rest.T) @ np.diag(SDS**2) @ np.kron(np.eye(2), rest)
    low, high = SE3.apply(T, part.vertices).min(axis=0), SE3.apply(T, part.vertices).max(axis=0)
    x = high[0] + rng.uniform(0.05, 0.08)
    corners = np.array([x, low[1], 0.0]), np.array([x + 0.04, low[1] + 0.06, rng.uniform(0.03, 0.08)])
    table, clamp = box("table", [-0.5, -0.5, -0.05], [0.5, 0.5, 0.0]), box("clamp", *corners)
    scene = Scene.of([table, clamp, Solid.at("part", part.vertices, part.triangles, T)])
    boxes = [ForbiddenBox("clamp", *corners)] if known else []
    above = SE3.from_parts(np.diag([1.0, -1.0, -1.0]), [centre[0], centre[1], high[2] + 0.30])
    return Unknown(
        scene,
        T,
        at_place(targets, T_world_place, spread),
        Rules(clearance=CLEARANCE, workspace=Workspace.above(0.0, boxes)),
        Furniture(Scene.of([table, clamp] if known else [table]).surface),
        SimulatedHand(scene, gripper(), above, rng=rng, cell=cell or Cell()),
    )


def unknown_session(unknown, policy="information", seed=0, **stop) -> Session:
    """Return a session about the scene, with the gripper's frontal sensors."""
    probe = hand_probe(gripper(), unknown.rules, STANDOFF)
    able = reachable(gripper(), unknown.rules, probe.retreat)
    sensing = Sensing(rig=gripper().rig)
    return Session(unknown.start, probe, sensing, policy_named(policy), Stop(**stop), seed, able)


def off(session, number, T_world_part) -> float:
    """Return the largest error of a corner [m]; infinite for another part."""
    state = session.state
    if not len(state.weights) or state.part[0] != number:
        return float("inf")
    return float(corner_distances(state, 0, T_world_part[None])[0])
