"""One feature of a scene, acquired by the simulated hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tanteo.acquisition import SENSE, Acquired, Predicted, predicted
from tanteo.answers import Hypothesis
from tanteo.errors import InputError
from tanteo.hand import ForbiddenBox
from tanteo.io import SceneFile
from tanteo.motion import Rules
from tanteo.parts import Part
from tanteo.simulator import SimulatedHand, clearances


def change_scene(
    scene: SceneFile,
    *,
    seed: int | None = None,
    standoff: float | None = None,
    forbidden: Sequence[ForbiddenBox] = (),
    scaled: bool = False,
) -> SceneFile:
    """The scene with something else than its file says.

    Args:
        scene: The scene.
        seed: Of all errors.
        standoff: Of the hand's front [m].
        forbidden: Boxes to stay out of as well.
        scaled: Whether the clearance changes with the stand-off.
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
    """The feature of a part that an image has placed to which the hand goes.

    Args:
        kind: ``plane``, ``edge``, ``vertex``, ``circle`` or ``cylinder``.
        scene: Says where the hand is.
        part: The part.
        best: What the image says of its pose.
        face: Name of the face to go to, or from which to sense an edge or a corner; the best if not given.

    Raises:
        InputError: The part has no such feature that faces the hand.
    """
    found = predicted(kind, part, best.T_world_part, best.covariance, -scene.T_world_hand[:3, 2])
    chosen = [p for p in found if face in (None, p.faces[0])]
    if not chosen:
        names = ", ".join(dict.fromkeys(p.faces[0] for p in found))
        asked = f"face '{face}'" if face is not None else f"a {kind}"
        got = f"faces: {names}. Name one of these with --face, or let" if found else f"no {kind} there. Let"
        raise InputError(
            f"{part.name}: expected {asked} that faces the hand, got {got} the hand start on another side."
        )
    return chosen[0]


def acquire(kind: str, scene: SceneFile) -> tuple[Acquired, SimulatedHand]:
    """Acquire a feature from the scene's guess of it.

    Args:
        kind: ``plane``, ``edge``, ``vertex``, ``circle`` or ``cylinder``.
        scene: The scene; its seed is that of all errors.

    Returns:
        What came of it, and the hand that did it.

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
    """The least distance that the whole hand truly had from everything in the scene [m]."""
    return float(clearances(scene.scene, scene.hand.body, np.array(robot.truth)).min())
