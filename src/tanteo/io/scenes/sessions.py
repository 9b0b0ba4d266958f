"""Session in a scene: prior poses of the parts, and simulated hand that carries out the session."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, FloatArray, Vectors
from tanteo.hand import ForbiddenBox, Workspace
from tanteo.hand.motion import Rules
from tanteo.hand.simulator import Scene, SimulatedHand
from tanteo.hand.simulator.arm import ArmMotion, read_arm
from tanteo.io.documents.scene_file import SceneFile
from tanteo.io.documents.scene_tables import ArmPlace
from tanteo.parts import Part
from tanteo.planning import Furniture, Sensing, Session, Stop, at_place, hand_probe
from tanteo.planning.execution import acquirable, reachable, seen_start
from tanteo.planning.policies import policy_named
from tanteo.planning.start import Start
from tanteo.posterior import PosePrior, PreparedPart, Priors, prepare_all
from tanteo.sensors.error_states import ErrorState

if TYPE_CHECKING:
    from tanteo.io.scenes.view import SceneView
    from tanteo.vision import Sighting


def prior_start(scene: SceneFile, targets: Sequence[PreparedPart], known: PosePrior | None = None) -> Start | None:
    """Return the prior poses of all parts, or None if neither the scene nor the user states any.

    Args:
        scene: scene, whose prior of the part's centre is used if ``known`` has no pose.
        targets: candidate parts.
        known: prior pose of the part frame.
    """
    if known is not None and known.T_world_part is not None and known.covariance is not None:
        n = len(targets)
        Ts, covariances = (np.repeat(a[None], n, axis=0) for a in (known.T_world_part, known.covariance))
        return Start(tuple(targets), np.arange(n), Ts, covariances, np.ones(n), Priors())
    return None if scene.prior is None else at_place(targets, scene.prior.T, scene.prior.C)


def start_of(
    scene: SceneFile,
    parts: Sequence[PreparedPart] | Sequence[Part],
    known: PosePrior | None = None,
    view: SceneView | None = None,
    *,
    outlier_rate: float | None = None,
    unknown: float | None = None,
) -> tuple[Start | None, Sighting | None]:
    """Return the start of a session from an image or from prior poses; with both, the prior covers a wrong image.

    Args:
        scene: scene, whose prior of the part's centre is used if ``known`` has no pose.
        parts: candidate parts.
        known: prior pose of the part frame.
        view: camera image of the scene.
        outlier_rate: expected outlier fraction; the default of the priors if None.
        unknown: prior probability of an unknown object; the default of the priors if None.

    Returns:
        Start of the session, None without image and prior; and object in the image, None without an image.
    """
    targets = prepare_all("parts", parts)
    start = prior_start(scene, targets, known)
    seen = None if view is None else view.recognize([target.part for target in targets], start)
    if seen is not None:
        start = seen_start(seen, targets, start)
    if start is not None:
        usual = start.priors
        priors = replace(usual, outlier_rate=outlier_rate or usual.outlier_rate, unknown=unknown or usual.unknown)
        start = replace(start, priors=priors)
    return start, seen


def session_of(
    scene: SceneFile,
    start: Start,
    stop: Stop,
    policy: str = "information",
    form_sd: float = 0.0,
    shared_errors: Sequence[ErrorState] = (),
) -> tuple[Session, SimulatedHand, Rules]:
    """Create a session, the simulated hand that carries it out, and the limits of its motions.

    The session has no access to the true scene.

    Args:
        scene: scene; its seed determines the session and all errors.
        start: initial poses of the parts.
        stop: stopping rule.
        policy: name of the policy that chooses actions.
        form_sd: standard deviation of the part's surface from its CAD [m].
        shared_errors: further errors that the readings share, which replace the assumed ones.
    """
    robot, rules = robot_of(scene)
    reach = robot.carrier if isinstance(robot.carrier, ArmMotion) else None
    errors = scene.cell.robot
    probe = replace(hand_probe(scene.hand, rules, scene.standoff, errors), form_sd=form_sd)
    sensing = Sensing(rig=scene.hand.rig, robot=errors, tolerance=form_sd, shared_errors=tuple(shared_errors))
    session = Session(
        start, probe, sensing, policy_named(policy), stop,
        scene.seed, reachable(scene.hand, rules, probe.retreat, reach),
        acquirable(scene.hand, rules, probe.retreat, reach),
    )  # fmt: skip
    return session, robot, rules


_AWAY = 0.48
"""Distance of the base of an arm from the start of the hand [m]: a bit more than half of the reach of a UR5e."""


def on_arm(scene: SceneFile, model: str) -> SceneFile:
    """Return a scene whose hand is on an arm: at the base of the scene's arm, else beside the start pose of the hand.

    Args:
        scene: scene.
        model: name of the arm, see :func:`tanteo.hand.simulator.arm.read_arm`.
    """
    if scene.arm is not None:
        return replace(scene, arm=ArmPlace(model, scene.arm.T_world_base))
    x, y, _ = scene.T_world_hand[:3, 3]
    top = scene.workspace.low[2] if np.isfinite(scene.workspace.low[2]) else 0.0
    return replace(scene, arm=ArmPlace(model, SE3.from_parts(np.eye(3), np.array([x - _AWAY, y, top]))))


def robot_of(scene: SceneFile) -> tuple[SimulatedHand, Rules]:
    """Return the simulated hand of a scene, on an arm if the scene has one, and the limits of its motions.

    Args:
        scene: scene; its seed determines all errors.

    Raises:
        InputError: the arm does not reach the start pose of the hand.
        MissingExtraError: MuJoCo is not installed, and the scene has an arm.
    """
    occluders = [ForbiddenBox(f"occluder {b.name}", b.low, b.high, b.T_world_box) for b in scene.occluders]
    w = scene.workspace
    rules = Rules(clearance=scene.clearance, workspace=Workspace(w.low, w.high, [*w.forbidden, *occluders]))
    carrier = None
    if scene.arm is not None:

        def free(centres: Vectors, radii: FloatArray) -> BoolArray:
            gaps = rules.workspace.clearances(centres)[0].min(axis=-1, initial=np.inf) - radii
            return np.asarray(gaps.min(axis=-1) >= rules.clearance)

        arm = read_arm(scene.arm.model, scene.hand, scene.arm.T_world_base)
        carrier = ArmMotion(arm, scene.T_world_hand, free=free, solids=scene.scene.solids)
    rng = np.random.default_rng(scene.seed)
    robot = SimulatedHand(scene.scene, scene.hand, scene.T_world_hand, rng=rng, cell=scene.cell, carrier=carrier)
    return robot, rules


def furniture_of(scene: SceneFile) -> Furniture | None:
    """Return the known furniture of the scene for the evaluation of readings, or None without any.

    Args:
        scene: scene with its solids.
    """
    return Furniture(Scene.of(scene.furniture).surface) if scene.furniture else None
