"""Which reading a policy takes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sensing_scenes import LASER, drawn_truth, new_session, rough, sense
from tanteo.errors import InputError
from tanteo.parts import read_part
from tanteo.planning import POLICIES, Action, Done, begin
from tanteo.planning.candidates import propose
from tanteo.planning.context import DecisionContext
from tanteo.planning.policies import Greedy, most_information, register_utility
from tanteo.planning.predictions import predict
from tanteo.planning.samples import draw
from tanteo.planning.utility import UTILITIES, about_mode, expected_information
from tanteo.posterior import prepare
from tanteo.words.findings import NotWorthCost

PARTS = Path(__file__).parents[2] / "examples" / "parts"


@pytest.fixture(scope="module")
def start():
    names = "bracket_left", "bracket_right", "wedge"
    return rough([prepare(read_part(PARTS / f"{name}.step")) for name in names])


def test_where_only_the_part_is_wanted_its_entropy_counts(start):
    state = begin(start)
    candidates = propose(state, LASER, 300)
    samples = draw(state, 128)
    predicted = predict(samples, candidates.origins, candidates.directions)
    of_part, of_both = (
        about_mode(samples, predicted, LASER, samples.part),
        expected_information(samples, predicted, LASER),
    )
    both, only = (
        POLICIES["information"].choose(DecisionContext(state, candidates, LASER, None, None, 0, 0, part_only))
        for part_only in (False, True)
    )
    assert both.index == np.argmax(of_both)
    assert of_part[only.index] > of_part[both.index]
    assert only.gain == of_both[only.index]  # its total gain, by which a session ends


def test_information_counts_by_time_where_time_counts(start):
    state = begin(start)
    candidates = propose(state, LASER, 300)
    context = DecisionContext(state, candidates, LASER, candidates.origins[0], None, 0, 0)
    information = expected_information(*_predicted(state, candidates), LASER)
    best, quick = (POLICIES[name].choose(context) for name in ("information", "information-per-second"))
    assert best.index == np.argmax(information)
    assert quick.index == np.argmax(information / context.seconds())
    assert quick.index != best.index


def test_a_part_that_is_known_leaves_its_pose_to_choose_by(start):
    state = begin(rough(start.targets[2:]))
    candidates = propose(state, LASER, 300)
    information = expected_information(*_predicted(state, candidates), LASER)
    choice = POLICIES["information"].choose(DecisionContext(state, candidates, LASER, None, None, 0, 0, part_only=True))
    assert choice.index == np.argmax(information) != 0


def _predicted(state, candidates):
    samples = draw(state, 128)
    return samples, predict(samples, candidates.origins, candidates.directions)


@pytest.mark.parametrize(
    ("stop", "part_only"), [({}, True), ({"tolerance": 1e-3}, False), ({"probability": None}, False)]
)
def test_a_session_states_its_plan(start, stop, part_only):
    seen = []

    class Watched:
        name = "watched"

        def choose(self, context):
            seen.append(context.part_only)
            return POLICIES["random"].choose(context)

    session = new_session(start, **stop)
    session.policy = Watched()
    session.ask()
    assert seen == [part_only]


def test_the_part_counts_above_all_until_it_is_known(start):
    state = begin(start)
    candidates = propose(state, LASER, 300)
    place, policy = (state, candidates, LASER, None, 1e-3, 0, 0), POLICIES["information"]
    samples = draw(state, 128, 1e-3)
    predicted = predict(samples, candidates.origins, candidates.directions, LASER)
    information, of_part = (
        expected_information(samples, predicted, LASER),
        about_mode(samples, predicted, LASER, samples.part),
    )
    chosen = [policy.choose(DecisionContext(*place, **what)) for what in ({"part_only": True}, {"part_open": True}, {})]
    assert [c.index for c in chosen] == [np.argmax(w * information + of_part) for w in (0.01, 0.3)] + [
        np.argmax(information)
    ]
    assert chosen[0].index != chosen[2].index
    assert [c.gain for c in chosen] == [information[c.index] for c in chosen]  # a session ends by the total gain


@pytest.mark.parametrize(
    ("weights", "probability", "part_open"),
    [
        ((0.7, 0.2, 0.1), 0.99, True),
        ((0.7, 0.2, 0.1), 0.6, False),
        ((0.4, 0.3, 0.3), 0.2, True),
        ((1, 1, 1), None, False),
    ],
)
def test_a_session_states_whether_the_part_is_open(start, weights, probability, part_open):
    """Before the first reading, a part that is less probable than all others together is open, for every goal."""
    session = new_session(replace(start, weights=np.array(weights)), probability=probability, tolerance=1e-3)
    seen = []

    class Watched:
        name = "watched"

        def choose(self, context):
            seen.append(context.part_open)
            return POLICIES["random"].choose(context)

    session.policy = Watched()
    session.ask()
    assert seen == [part_open]


@pytest.mark.slow
def test_one_part_alone_is_distinguished_from_the_unknown(start):
    """There is no other part to exclude, and yet readings are worth their cost."""
    alone = rough(start.targets[2:])
    rng = np.random.default_rng(3)
    _, T = drawn_truth(alone, rng)
    assert sense(new_session(alone), alone.targets[0], T, rng).reached


@pytest.mark.parametrize("policy", ["random", "nearest", "largest-face", "3-2-1"])
def test_any_policy_ends_where_nothing_is_worth_its_cost(start, policy):
    """Known to hundredths of a millimetre; the gain of a reading of 0.3 mm is computed for all policies."""
    located = rough(start.targets[2:], (1e-5, 1e-4))
    session = new_session(located, policy=policy, probability=None, tolerance=1e-6)
    end = session.ask()
    assert isinstance(end, Done)
    (worth,) = end.findings
    assert isinstance(worth, NotWorthCost)
    assert worth.gain < 0.01
    assert isinstance(new_session(located, policy=policy, probability=None, tolerance=1e-6, least_gain=0).ask(), Action)
    assert np.isnan(new_session(start, policy=policy).ask().gain)  # it was not chosen by that


def test_the_best_gain_is_that_of_the_best_candidate(start):
    state = begin(start)
    candidates = propose(state, LASER, 300)
    information = expected_information(*_predicted(state, candidates), LASER)
    assert most_information(DecisionContext(state, candidates, LASER, None, None, 0, 0)) == information.max()


def test_utilities_have_names_of_their_own():
    with pytest.raises(InputError, match="expected one of information, got 'comfort'"):
        Greedy("comfort")
    with pytest.raises(InputError, match="'random', which is taken"):
        register_utility("random", UTILITIES["information"])
