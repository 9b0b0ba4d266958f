"""What the crossings met beside an edge: the face up to it, and nothing of it right beyond."""

from types import SimpleNamespace

import numpy as np
import pytest

from felt_scenes import gripper
from tanteo.features import Feature
from tanteo.features.kinds import EDGE, PLANE
from tanteo.geometry import SE3, SO3
from tanteo.hand import FREE, HIT, LOST, HandReading
from tanteo.hand.acquisition.edge_events import against
from tanteo.hand.motion import Motion
from tanteo.words.findings import AtPose, FaceEndsElsewhere

STANDOFF, OUT = 0.02, np.array([0.0, 1.0, 0.0])
SPOT = STANDOFF * np.tan(np.radians(5))
FACE = Feature(PLANE, np.eye(4), np.diag([1e-5, 1e-3, 1e-3]) ** 2, "face")
EDGE_ = Feature(EDGE, np.eye(4), np.diag([1e-4, 1e-4, 1e-3, 1e-3]) ** 2, "edge")  # the x axis
PLACES = np.array([[-0.03, 0.0, 0.0], [0.0, 0.0, 0.0], [0.03, 0.0, 0.0]])


def crossing(x, border, name="cross edge", below=None):
    """Return poses of a hand that moves along y with its first sensor at ``x``; the face ends at ``border``."""
    hand, R, log = gripper(), np.diag([1.0, -1.0, -1.0]), []
    first = hand.frontal[0]
    for k, y in enumerate(np.arange(-0.012, 0.012, 2e-4)):
        ranges, states = np.full(len(hand.origins), np.nan), np.full(len(hand.origins), LOST)
        on, states[first] = y < border, FREE
        if on or below is not None:
            ranges[first], states[first] = STANDOFF + (0.0 if on else below), HIT
        foot = np.array([x, y, STANDOFF]) - R @ hand.origins[first]
        log.append(HandReading(0.01 * k, SE3.from_parts(R, foot), ranges, states))
    return Motion(name, "reached", AtPose(), tuple(log))


def sides_of(*motions, places=PLACES):
    session = SimpleNamespace(hand=gripper(), standoff=STANDOFF, motions=motions)
    return against(session, FACE, EDGE_, places, OUT)


def test_nothing_is_against_an_edge_where_the_face_ends():
    assert sides_of(crossing(-0.03, 0.0), crossing(0.01, 0.0), crossing(0.03, 0.0)) is None
    assert sides_of(crossing(0.01, 0.0, below=0.01)) is None


@pytest.mark.parametrize("below", [None, 0.01])
def test_a_face_that_ends_before_or_goes_on_beyond_is_against_it(below):
    far = 1.2 * SPOT + 1.8e-3
    assert sides_of(crossing(0.01, 0.0), crossing(-0.01, -far, below=below)) == FaceEndsElsewhere(beyond=False)
    assert sides_of(crossing(0.01, 0.0), crossing(-0.01, far, below=below)) == FaceEndsElsewhere(beyond=True)


def test_what_a_spot_may_meet_is_not_against_it():
    for border in (-1.1 * SPOT, 1.1 * SPOT):
        assert sides_of(crossing(0.01, border)) is None


def test_far_or_past_places_may_be_of_another_edge():
    """A groove in the face, the face going on beyond a gap, the next edge past a corner."""
    groove = crossing(0.01, 0.0)
    cut = [s if not -0.012 < s.T_world_hand[1, 3] < -0.009 else missed(s) for s in groove.log]
    assert sides_of(Motion("cross edge", "reached", AtPose(), tuple(cut))) is None
    assert sides_of(crossing(0.035, 0.008)) is None
    assert sides_of(crossing(0.01, 0.008), places=PLACES[:1]) is None


def test_only_crossings_count():
    """Crossings are slow: in other motions a range may belong to an earlier pose."""
    assert sides_of(crossing(0.01, 0.0), crossing(0.01, 0.008, name="follow")) is None


def missed(s):
    nothing = np.full(s.ranges.shape, np.nan)
    return HandReading(s.time, s.T_world_hand, nothing, np.where(s.states == HIT, FREE, s.states))


def test_the_pose_of_the_hand_may_be_any():
    T = SE3.from_parts(SO3.exp(np.array([0.4, -0.3, 1.0])), np.array([0.3, -0.2, 0.5]))
    motion = crossing(-0.01, 0.008)
    log = tuple(HandReading(s.time, T @ s.T_world_hand, s.ranges, s.states) for s in motion.log)
    session = SimpleNamespace(
        hand=gripper(), standoff=STANDOFF, motions=[Motion("cross edge", "reached", AtPose(), log)]
    )
    face, edge = (Feature(f.kind, T, f.P, f.label) for f in (FACE, EDGE_))
    assert against(session, face, edge, SE3.apply(T, PLACES), T[:3, :3] @ OUT) == FaceEndsElsewhere(beyond=True)
