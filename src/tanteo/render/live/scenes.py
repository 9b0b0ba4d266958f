"""Show of a scene file, with its hand or with a laser that needs no motion."""

from __future__ import annotations

from dataclasses import replace

from tanteo.hand.simulator import Scene
from tanteo.hand.simulator.arm import ArmMotion
from tanteo.io.documents import SceneFile
from tanteo.io.scenes import furniture_of, session_of
from tanteo.planning import Session, Stop
from tanteo.planning.policies import policy_named
from tanteo.planning.start import Start
from tanteo.render.live.shows import Show, hand_show, laser, probe_show, simulated
from tanteo.sensors.error_states import ErrorState


def scene_show(
    scene: SceneFile,
    start: Start,
    stop: Stop,
    policy: str = "information",
    form_sd: float = 0.0,
    shared_errors: tuple[ErrorState, ...] = (),
    *,
    bare: bool = False,
) -> Show:
    """Return the show of a scene.

    Args:
        scene: scene; its seed determines the session and all errors.
        start: prior poses of the parts.
        stop: goal of the session.
        policy: name of the policy.
        form_sd: standard deviation of the part's surface from its CAD [m].
        shared_errors: further errors that the readings share, which replace the assumed ones.
        bare: whether a laser without motion replaces the hand.
    """
    truth = tuple(s for s in scene.scene.solids if s not in scene.furniture)
    if bare:
        probe, sensing = laser(scene.workspace)
        probe, sensing = (
            replace(probe, form_sd=form_sd),
            replace(sensing, tolerance=form_sd, shared_errors=shared_errors),
        )
        session = Session(start, probe, sensing, policy_named(policy), stop, scene.seed)
        furniture = Scene.of(scene.furniture).surface if scene.furniture else None
        read = simulated(Scene.of(truth).surface, furniture, scene.seed)
        return probe_show(session, read, truth, scene.furniture)
    session, robot, rules = session_of(scene, start, stop, policy, form_sd, shared_errors)
    arm = robot.carrier if isinstance(robot.carrier, ArmMotion) else None
    return hand_show(session, robot, rules, truth, scene.furniture, furniture_of(scene), scene.cell.robot, arm)
