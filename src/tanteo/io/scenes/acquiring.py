"""Acquisition of a feature of a scene by the simulated hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tanteo.errors import InputError
from tanteo.hand import ForbiddenBox, Predicted, predicted
from tanteo.hand.acquisition import SENSE, Acquired
from tanteo.hand.motion import Rules
from tanteo.hand.simulator import SimulatedHand, clearances
from tanteo.io.documents.scene_file import SceneFile
from tanteo.parts import Part
from tanteo.posterior import Hypothesis


def change_scene(
    scene: SceneFile,
    *,
    seed: int | None = None,
    standoff: float | None = None,
    forbidden: Sequence[ForbiddenBox] = (),
    scaled: bool = False,
) -> SceneFile:
    """Return a copy of a scene with changed settings.

    Args:
        scene: scene to change.
        seed: seed of all errors; unchanged if None.
        standoff: stand-off of the hand's front [m]; unchanged if None.
        forbidden: additional forbidden boxes.
        scaled: whether the clearance is scaled with the stand-off.
    """
    w = scene.workspace
    far = scene.standoff if standoff is None else standoff
    return replace(
        scene,
        seed=scene.seed if seed is None else seed,
        standoff=far,
        clearance=scene.clearance * far / scene.standoff if scaled and standoff is not None else scene.clearance,
        workspace=replace(w, forbidden=(*w.forbidden, *forbidden)) if forbidden else w,
    )


def expected_feature(kind: str, scene: SceneFile, part: Part, best: Hypothesis, face: str | None = None) -> Predicted:
    """Return the feature for the hand to acquire, on a part whose pose comes from an image.

    Args:
        kind: ``plane``, ``edge``, ``vertex``, ``circle`` or ``cylinder``.
        scene: scene with the pose of the hand.
        part: part in the image.
        best: hypothesis of the image with the pose of the part.
        face: name of the face, or of the face of an edge or corner; the best one if None.

    Raises:
        InputError: The part has no such feature that faces the hand.
    """
    found = predicted(kind, part, best.T_world_part, best.covariance, -scene.T_world_hand[:3, 2])
    chosen = [p for p in found if face in (None, p.faces[0])]
    if not chosen:
        names = ", ".join(dict.fromkeys(p.faces[0] for p in found))
        wanted = f"face '{face}'" if face is not None else f"a {kind}"
        got = f"faces: {names}. Name one of these with --face, or let" if found else f"no {kind} there. Let"
        raise InputError(
            f"{part.name}: expected {wanted} that faces the hand, got {got} the hand start on another side."
        )
    return chosen[0]


def acquire(kind: str, scene: SceneFile) -> tuple[Acquired, SimulatedHand]:
    """Acquire a feature, from the initial guess in the scene file.

    Args:
        kind: ``plane``, ``edge``, ``vertex``, ``circle`` or ``cylinder``.
        scene: scene; its seed determines all errors.

    Returns:
        Result of the acquisition, and simulated hand with its true poses.

    Raises:
        InputError: The scene has no guess of such a feature.
    """
    guess = scene.guesses.get(kind)
    if guess is None:
        raise InputError(f"{scene.source}: expected a table [sense.{kind}] with a rough idea of it, got none. Add it.")
    robot = SimulatedHand(
        scene.scene, scene.hand, scene.T_world_hand, rng=np.random.default_rng(scene.seed), cell=scene.cell
    )
    rules = Rules(clearance=scene.clearance, workspace=scene.workspace)
    return SENSE[kind](robot, guess, standoff=scene.standoff, rules=rules, errors=scene.cell.robot), robot


def least_clearance(scene: SceneFile, robot: SimulatedHand) -> float:
    """Return the smallest true distance of the whole hand from the solids of the scene during a run [m].

    Args:
        scene: scene with its solids.
        robot: simulated hand after the run.
    """
    return float(clearances(scene.scene, scene.hand.body, np.array(robot.truth)).min())
