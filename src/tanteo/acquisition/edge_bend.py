"""An edge at which the surface only bends: the face beyond is sensed too, and the edge is where the two planes meet."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tanteo.acquisition.acquired import Attempt, failed
from tanteo.acquisition.edge_places import rise
from tanteo.acquisition.events import place_of
from tanteo.acquisition.guesses import FaceGuess
from tanteo.acquisition.plane import HOVER, acquire_plane
from tanteo.acquisition.session import Session
from tanteo.acquisition.ways import facing, fits, path
from tanteo.errors import DegenerateError
from tanteo.features import Feature
from tanteo.fitting import edge_from_planes
from tanteo.motion import Bend, Motion, go_to, how_far
from tanteo.typing import FloatArray

_BEYOND = 0.02
"""The other face is looked for so far beyond the bend [m]."""

_BESIDE = 0.006
"""The planes meet no farther from where the surface was seen to bend [m]; a bend is seen less sharply than a drop."""


def acquire_bend(session: Session, face: Feature, outwards: FloatArray, bends: Sequence[Bend], label: str) -> Attempt:
    """The edge of a face at which the surface bends away, as the line in which two sensed planes meet.

    Of an edge that is rounded it is where its faces would meet.

    Args:
        session: The acquisition, over the face.
        face: As sensed.
        outwards: Of the crossings that met the bend ``(3,)``, unit.
        bends: What the sensors met there.
        label: Of the edge; the other face's is ``<label> other face``.
    """
    normal = face.T_world_feature[:3, 2]
    place = np.median([place_of(session.hand, b) for b in bends], axis=0)
    angle = float(np.median([b.angle for b in bends]))
    ahead, beyond = _turned(outwards, normal, angle)
    above = _between(session, face, place, _turned(outwards, normal, 0.5 * angle)[1], np.cross(normal, outwards))
    if not above.reached:
        return failed(above)
    status, message, other = acquire_plane(
        session, FaceGuess(place + _BEYOND * ahead, beyond), f"{label} other face", beside=face
    )
    if other is None:
        return status, f"the surface bends away {how_far(bends)}, and of the face beyond it: {message}", None
    session.others.append(other)
    try:
        edge = edge_from_planes(face, other, place, label)
    except DegenerateError as error:
        return "unclear", f"the surface bends away {how_far(bends)}, but {error}", None
    away = place - edge.T_world_feature[:3, 3]
    direction = edge.T_world_feature[:3, 0]
    off = float(np.linalg.norm(away - (away @ direction) * direction))
    if off > _BESIDE:
        return "unclear", f"the planes of both faces meet {1e3 * off:.2g} mm beside where the surface bends", None
    return "acquired", "the surface bends: the edge is where the planes of both faces meet", edge


def _turned(outwards: FloatArray, normal: FloatArray, angle: float) -> tuple[FloatArray, FloatArray]:
    """The way out of a face and its normal, turned by a bend [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    return c * outwards - s * normal, c * normal + s * outwards


def _between(session: Session, face: Feature, place: FloatArray, normal: FloatArray, along: FloatArray) -> Motion:
    """The hand over the bend, turned half towards the other face, as far as there is room; it has to be seen."""
    back = rise(session, face)
    if not back.reached:
        return back
    hand, T = session.hand, session.robot.sensed.T_world_hand
    target = facing(hand, place, normal, along, session.standoff + HOVER, T)
    if not fits(session, session.seen(), path(T, target, hand.front, 12)):
        return back
    return session.does(go_to(session.robot, target, session.rules))
