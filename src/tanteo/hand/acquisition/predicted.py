"""Derive guesses of features from a part and its uncertain pose, for the features that a hand can approach best.

The pose and its covariance, from an image or a belief, determine the pose of each feature and its uncertainty.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import Covariances, FloatArray, Transforms
from tanteo.hand.acquisition.approach_view import ApproachView
from tanteo.hand.acquisition.guesses import EdgeGuess, FaceGuess, RoundGuess, VertexGuess
from tanteo.hand.acquisition.in_sight import Finder, corners, edges, faces
from tanteo.hand.acquisition.rims_in_sight import rims, walls
from tanteo.parts import Part, Surface

Guess: TypeAlias = FaceGuess | EdgeGuess | VertexGuess | RoundGuess

KINDS: dict[str, tuple[Finder, Callable[..., Guess]]] = {
    "plane": (faces, FaceGuess), "edge": (edges, EdgeGuess), "vertex": (corners, VertexGuess),
    "circle": (rims, RoundGuess), "cylinder": (walls, RoundGuess),
}  # fmt: skip
"""How features of each kind are found on a part, and the guess that they make."""


@dataclass(frozen=True, slots=True, eq=False)
class Predicted:
    """A feature of a part where a pose puts it.

    Attributes:
        name: ``face 3``, ``edge of face 3 and face 5``, ``corner of face 3, face 5 and face 7``, ``rim of hole 2``,
            ``boss 0``.
        faces: Names of its faces, that from which it is sensed first.
        guess: In the world; its spread is that of the pose there, the largest over all directions.
        value: By which features of one kind are compared: the size of what the hand would sense, seen from it.
    """

    name: str
    faces: tuple[str, ...]
    guess: Guess
    value: float


def predicted(
    kind: str, part: Part, T_world_part: Transforms, covariance: Covariances, towards: FloatArray
) -> tuple[Predicted, ...]:
    """Features of a part that face the hand with nothing before them, those with the most to sense first.

    Args:
        kind: ``plane``, ``edge``, ``vertex``, ``circle`` (the rim of a bore or a boss) or ``cylinder`` (its wall).
        part: The part.
        T_world_part: About its pose ``(4, 4)``.
        covariance: Of the pose, in the part's frame ``(6, 6)`` [m, rad].
        towards: Direction towards the hand, in the world ``(3,)``.

    Raises:
        InputError: A kind that does not exist.
    """
    known = KINDS.get(kind)
    if known is None:
        *others, last = KINDS
        raise InputError(f"kind: expected {', '.join(others)} or {last}, got '{kind}'. Use one of these.")
    found, guess_of = known
    R = T_world_part[:3, :3]
    view, out = (
        ApproachView(part, Surface(part.vertices, part.triangles), R.T @ (towards / np.linalg.norm(towards))),
        [],
    )
    for seen in found(view):
        J = np.concatenate([np.eye(3), -SO3.hat(seen.point)], axis=1)
        place, turn = (np.linalg.eigvalsh(C)[-1] for C in (J @ covariance @ J.T, covariance[3:, 3:]))
        point, directions = SE3.apply(T_world_part, seen.point), (R @ d for d in seen.directions)
        guess = guess_of(point, *directions, **seen.more, sd=float(np.sqrt(place)), turn_sd=float(np.sqrt(turn)))
        out.append(Predicted(seen.name, tuple(part.faces[f].name for f in seen.faces), guess, seen.value))
    return tuple(sorted(out, key=lambda p: -p.value))
