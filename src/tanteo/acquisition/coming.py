"""From afar to before a face: aside first, then along its normal, so that the frontal beams see where the hand goes."""

from __future__ import annotations

import numpy as np

from tanteo.acquisition.guesses import FaceGuess
from tanteo.acquisition.session import Session
from tanteo.acquisition.ways import facing
from tanteo.motion import Motion, go_to
from tanteo.sensors import error_model

_FAR, _NEAR = 0.8, 0.5
"""Shares of the frontal sensors' range: beyond the first the hand comes nearer, to the second."""

_WORTH = 0.025
"""Within range it stays where it begins, with free space around it, if it would win no more than this [m]."""


def come_near(session: Session, guess: FaceGuess) -> Motion | None:
    """Bring the hand before a face that its frontal beams would hardly reach; None where they do.

    It keeps its distance until it stands over the place, and comes straight down then.

    Args:
        session: The acquisition.
        guess: About where the face is.

    Returns:
        The last motion; one that did not reach its pose ends the way.
    """
    hand, T = session.hand, session.robot.sensed.T_world_hand
    front = T[:3, :3] @ hand.front + T[:3, 3]
    away = float(np.linalg.norm(guess.point - front))
    reach = float(error_model(hand.rig).max_range[list(hand.frontal)].min())
    least = max(_NEAR * reach, 2 * session.standoff)
    if not np.isfinite(reach) or away < _FAR * reach or away < min(reach, least + _WORTH):
        return None
    along = T[:3, :3] @ hand.pair
    along = along - (along @ guess.normal) * guess.normal
    if np.linalg.norm(along) < 1e-6:
        along = np.cross(guess.normal, T[:3, 2])
    along = along / np.linalg.norm(along)
    for height in (away, least):
        pose = facing(hand, guess.point, guess.normal, along, height, T)
        motion = session.does(go_to(session.robot, pose, session.rules))
        if not motion.reached:
            break
    return motion
