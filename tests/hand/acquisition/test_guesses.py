"""Rough ideas, and how rough they are."""

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.features import Feature
from tanteo.features.kinds import PLANE
from tanteo.geometry import SE3
from tanteo.hand.acquisition import EdgeGuess, FaceGuess, VertexGuess, as_guessed
from tanteo.hand.acquisition.patch import find_patches
from tanteo.hand.acquisition.seen import Cloud
from tanteo.words.findings import OtherFace, ReadingsTaken

UP = np.array([0.0, 0.0, 1.0])
X, Y = np.eye(3)[:2]


@pytest.mark.parametrize("make", [FaceGuess, EdgeGuess, VertexGuess])
@pytest.mark.parametrize(("name", "value"), [("sd", 0.0), ("sd", np.nan), ("turn_sd", -0.1), ("turn_sd", np.inf)])
def test_a_spread_is_positive(make, name, value):
    directions = {FaceGuess: (UP,), EdgeGuess: (X, UP), VertexGuess: (X, Y, UP)}[make]
    with pytest.raises(InputError, match=f"{name}: expected a positive standard deviation"):
        make(np.zeros(3), *directions, **{name: value})


def test_the_spread_goes_with_the_features_of_an_idea():
    corner = VertexGuess(np.zeros(3), X, Y, UP, sd=1e-3, turn_sd=0.02)
    for edge in corner.edges(0.02):
        assert (edge.sd, edge.turn_sd) == (1e-3, 0.02)
        face = edge.face(0.01)
        assert (face.sd, face.turn_sd) == (1e-3, 0.02)


def two_levels():
    """Frontal beams from above on a small face and, 18 mm lower, a large one."""
    rng = np.random.default_rng(2)
    low, high = rng.uniform(-0.05, 0.05, (300, 2)), rng.uniform(-0.012, 0.012, (60, 2))
    points = np.concatenate([np.c_[low, np.zeros(300)], np.c_[high, np.full(60, 0.018)]])
    n = len(points)
    starts, yes = points + 0.1 * UP, np.ones(n, dtype=bool)
    ranges = 0.1 + 3e-4 * rng.normal(size=n)
    return Cloud(starts, np.tile(-UP, (n, 1)), ranges, yes, np.full(n, 3e-4), np.full(n, 0.01), yes)


def test_what_is_known_well_not_taken_for_larger_face_beside_it():
    vague, sharp = (find_patches(two_levels(), FaceGuess(0.018 * UP, UP, sd=sd)) for sd in (0.015, 1e-3))
    assert any(abs(patch.point[2]) < 1e-3 for patch in vague)
    assert len(sharp) == 1
    assert abs(sharp[0].point[2] - 0.018) < 3e-4


@pytest.mark.parametrize(("height", "tilt", "taken"), [(1e-3, 0.01, True), (8e-3, 0.0, False), (0.0, 0.2, False)])
def test_a_face_far_off_a_sharp_idea_is_another_one(height, tilt, taken):
    """A millimetre and 0.02 rad are known; the guess of a person takes all three."""
    face = Feature(PLANE, SE3.exp(np.array([0, 0, height, tilt, 0, 0])), 1e-8 * np.eye(3))
    status, message, feature = as_guessed(FaceGuess(np.zeros(3), UP, 1e-3, 0.02), ("acquired", ReadingsTaken(1), face))
    assert (status, feature is face) == (("acquired", True) if taken else ("unclear", False))
    assert taken or isinstance(message, OtherFace)
    assert as_guessed(FaceGuess(np.zeros(3), UP), ("acquired", ReadingsTaken(1), face))[2] is face
