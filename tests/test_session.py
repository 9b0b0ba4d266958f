"""Plans and updates: goals are reached, any reading may be given, and invalid readings are refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bare_scenes import SENSORS, beams, nees, no_paths, scene
from sensing_scenes import (
    EXACT_MACHINE,
    LASER,
    drawn_truth,
    give_any_readings,
    new_session,
    off,
    rough,
    sense,
    true_range,
    valid,
    where_a_ball_stops,
)
from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.parts import read_part
from tanteo.planning import Action, Done, Sensing, Session, Stop, at_place, begin, probe_of, update
from tanteo.planning.candidates import Candidates
from tanteo.planning.session import answered, moved
from tanteo.planning.start import at_pose
from tanteo.posterior import PosePrior, Priors, prepare
from tanteo.recognition import identify
from tanteo.render.html import headline
from tanteo.sensors import Readings, concatenate
from tanteo.sensors.presets import NoiseLaw
from tanteo.words import percent
from tanteo.words.findings import ChosenByUser, ReadingLimit, RepeatMisfit

PARTS = Path(__file__).parents[1] / "examples" / "parts"


@pytest.fixture(scope="module")
def targets():
    return [prepare(read_part(PARTS / f"{name}.step")) for name in ("bracket_left", "bracket_right", "wedge")]


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_session_names_and_places_the_part(targets, seed):
    start, rng = rough(targets), np.random.default_rng((2, seed))
    k, T = drawn_truth(start, rng)
    session = new_session(start, seed=seed, tolerance=2e-3)
    end = sense(session, targets[k], T, rng, each=valid)
    assert end.reached
    assert targets[k].part.name in end.message
    answer = session.answer()
    assert off(session, k, T) < 4 * answer.hypotheses[0].corner_sd
    assert answer.status == "recognized"
    assert answer.hypotheses[0].part == targets[k].part.name
    assert session.count <= 15


def test_a_part_like_others_is_confirmed_face_by_face(targets):
    """Located at the start, so that no reading has much information; a similar part still gets less probable with
    each."""
    target, rng = targets[0], np.random.default_rng(4)
    start = rough([target], (1e-5, 1e-4))
    session, faces = new_session(start, probability=0.995), []
    end = sense(session, target, start.Ts[0], rng, each=lambda s: faces.append(s.steps[-1].action.face))
    assert end.reached
    assert session.state.of_parts()[0] > 0.995
    assert len(set(faces)) >= 4
    assert session.steps[-1].action.reason.confirms


@pytest.mark.parametrize(("probability", "max_measurements"), [(0.9999, 100), (0.995, 2)])
def test_an_unconfirmable_goal_is_not_pursued(targets, probability, max_measurements):
    target, rng = targets[0], np.random.default_rng(4)
    start = rough([target], (1e-5, 1e-4))
    session = new_session(start, probability=probability, max_measurements=max_measurements)
    end = sense(session, target, start.Ts[0], rng)
    assert not end.reached
    assert session.count <= 2


@pytest.mark.slow
def test_the_same_seed_gives_the_same_questions_and_answers(targets):
    start, runs = rough(targets), []
    for _ in range(2):
        rng = np.random.default_rng(5)
        k, T = drawn_truth(start, rng)
        session = new_session(start, max_measurements=2)
        sense(session, targets[k], T, rng)
        runs.append(session)
    first, second = runs
    np.testing.assert_array_equal(first.readings.points, second.readings.points)
    np.testing.assert_array_equal(first.state.poses, second.state.poses)
    assert runs[0].answer().message == runs[1].answer().message


def test_asking_twice_without_telling_gives_the_same_question(targets):
    session = new_session(rough(targets[:1]))
    assert session.ask() is session.ask()


def test_a_question_of_somebody_else_takes_the_place_of_its_own(targets):
    session = new_session(rough(targets[:1]))
    own = session.ask()
    theirs = replace(own, origin=own.origin + np.array([0.0, 0.0, 0.01]))
    session.put(theirs)
    assert session.ask() is theirs
    assert session.tell(theirs.read(0.1)).action is theirs
    assert session.ask().number == own.number + 1
    session.put(None)
    assert session.pending is None
    assert session.ask().number == own.number + 2
    session.put(replace(theirs, number=own.number + 6))  # of another session: no number comes twice
    session.put(None)
    assert session.ask().number == own.number + 7


def free_beam(name, origin=(0.5, 0.5, 0.5)):
    """Return a reading that the session did not plan."""
    return Readings.from_columns(
        np.array([origin]), ids=[name], directions=np.array([[0.0, 0.0, 1.0]]), is_free=np.array([True]),
        max_ranges=np.array([0.1]),
    )  # fmt: skip


def test_only_its_answer_ends_the_wait_of_a_question(targets):
    """Late, repeated and unplanned readings are given while a robot is on its way."""
    session = new_session(rough(targets[:1]))
    first = session.ask()
    reading = first.read(true_range(targets[0], np.eye(4), first))
    assert session.tell(reading).action is first
    second = session.ask()
    for other in (free_beam("theirs"), reading):
        assert session.tell(other).action is None
        assert session.ask() is second
    late = first.read(0.9 * first.expected, name="late")
    assert session.tell(late, first).action is first
    assert session.ask() is second
    assert session.tell(late, second).ids == ()  # nothing new answers nothing
    assert session.ask() is second
    assert session.tell(second.read(second.expected)).action is second
    assert session.pending is None
    assert session.ask().number == 3


def known_by(how, action):
    """Return the answer to a question from one of two mirror-image hands."""
    whole = action.read(action.expected, name="mine")
    return {
        "beam": whole,
        "free": action.read(np.inf, name="mine"),
        "touch": Readings.from_columns(whole.points, ids=["mine"], directions=whole.directions),
        "name": Readings.from_columns(whole.points[:] + 1e-3, ids=[action.name]),
        "one of several": concatenate([free_beam("beside"), whole]),
        "rounded": replace(
            whole, points=whole.points.map(lambda p: p.round(7)), directions=whole.directions.map(lambda d: d + 1e-7)
        ),
    }[how]


@pytest.mark.slow
@pytest.mark.parametrize("how", ["beam", "free", "touch", "name", "one of several", "rounded"])
def test_an_answer_is_known_by_its_beam_or_its_name(targets, how):
    session = new_session(rough(targets[:1]))
    action = session.ask()
    assert session.tell(known_by(how, action)).action is action
    assert session.pending is None


@pytest.mark.slow
def test_a_reading_of_another_beam_answers_only_by_word(targets):
    session = new_session(rough(targets[:1]))
    action = session.ask()
    one, n = action.read(action.expected, name="mine"), action.direction
    across = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    back, askew = action.origin - 0.01 * n, n + 0.3 * across
    others = [
        replace(one, points=one.points.map(lambda p: p + 0.3 * action.expected * across), ids=("beside",)),
        replace(one, directions=(askew / np.linalg.norm(askew))[None], ids=("askew",)),
        Readings.from_columns(back[None], ids=["behind"], directions=n[None]),
        replace(one, ids=("a7",)),
    ]
    for other in others:
        assert session.tell(other).action is None
        assert session.pending is action
    far = replace(one, points=one.points.map(lambda p: p + 0.3 * action.expected * across), ids=("said",))
    assert session.tell(far, action).action is action
    assert session.pending is None


def test_a_hand_that_is_not_quite_where_it_was_sent_has_answered(targets):
    """A touch without a direction also answers: with the same plan for ever, no loop would end."""
    session = new_session(rough(targets[:1]))
    for shift in (None, 0.02):
        action = session.ask()
        one = action.read(action.expected)
        turned = None if shift is None else one.directions[:] + np.array([[0.0, shift, 0.0]])
        given = Readings.from_columns(one.points[:] + 2e-3, ids=[f"probe {action.number}"], directions=turned)
        assert session.tell(given).action is action
        assert session.ask() is not action


@pytest.mark.slow
@pytest.mark.parametrize("expected", [np.nan, np.inf, 0.0])
def test_a_question_that_expects_nothing_is_answered_by_its_beam(targets, expected):
    """The caller gave no direction: the session would plan it for ever."""
    session = new_session(rough(targets[:1]))
    action = replace(session.ask(), expected=expected)
    session.put(action)
    given = Readings.from_columns((action.origin + 0.1 * action.direction)[None], ids=["mine"])
    assert session.tell(given).action is action
    assert session.pending is None


def test_only_question_that_waits_is_dropped_when_it_is_refused(targets):
    session = new_session(rough(targets[:1]))
    first = session.ask()
    session.put(None)
    second = session.ask()
    session.refuse(first)
    assert session.ask() is second
    session.refuse(replace(second))  # as a record restores it
    assert session.pending is None
    assert session.refused[0] is first


def test_extra_readings_are_taken_and_repeated_ones_excluded(targets):
    start, rng = rough(targets[:1]), np.random.default_rng(1)
    k, T = drawn_truth(start, rng)
    session = new_session(start)
    action = session.ask()
    reading = action.read(true_range(targets[k], T, action))
    before = session.tell(reading)
    again = session.tell(reading)
    assert session.count == 1
    assert "known already" in again.note
    assert not again.ids
    np.testing.assert_array_equal(before.probabilities, again.probabilities)
    other = action.read(true_range(targets[k], T, action) + 1e-3)
    assert session.tell(other).ids == ("a1 (2)",)
    assert session.count == 2


def test_new_names_differ_from_those_given_with_them(targets):
    session = new_session(rough(targets[:1]))
    session.tell(Readings.from_columns(np.array([[0.0, 0.0, 0.1]]), ids=["a"]))
    step = session.tell(Readings.from_columns(np.array([[0.0, 0.0, 0.2], [0.0, 0.1, 0.1]]), ids=["a", "a (2)"]))
    assert step.ids == ("a (3)", "a (2)")


def test_a_run_repeated_under_new_names_is_not_counted_again(targets):
    """Two runs of one robot program have the same names and other values."""
    session = new_session(rough(targets[:1]))
    runs = [Readings.from_columns(np.array([[0.0, 0.0, z]]), ids=["a"], sds=np.array([1e-3])) for z in (0.1, 0.2, 0.3)]
    for run in runs:
        session.tell(run)
    for run in (*runs, session.readings):
        step = session.tell(run)
        assert step.ids == ()
        assert "known already" in step.note
    assert session.readings.ids == ("a", "a (2)", "a (3)")


def test_a_correction_of_a_reading_is_not_taken_silently(targets):
    session = new_session(rough(targets[:1]))
    reading = Readings.from_columns(np.array([[0.0, 0.0, 0.1]]), ids=["a"], sds=np.array([1e-4]))
    session.tell(reading)
    step = session.tell(replace(reading, sds=np.array([5e-3])))
    assert session.count == 1
    assert step.note == "Reading a is known with other errors, radius or normal, which stay."


def test_no_session_succeeds_before_a_reading_hits_a_part(targets):
    """Beams that pass beside the only expected part do not decide which part it is."""
    start = replace(rough(targets[:1]), priors=replace(rough(targets[:1]).priors, unknown=0.005))
    session = new_session(start, probability=0.99)
    away = np.array([[1.0, 1.0, 1.0]])
    free = {"directions": np.array([[0, 0, 1.0]]), "is_free": np.array([True]), "max_ranges": np.array([0.1])}
    session.tell(Readings.from_columns(away, ids=["f"], **free))
    assert session.state.of_parts().max() > 0.99
    assert not isinstance(session.ask(), Done)
    assert session.answer().status == "insufficient"


def two_steps(weights, priors=None, **stop):
    """Return readings on the faces that both steps have, so that only the prior distinguishes them."""
    first, second = (prepare(read_part(PARTS / f"step_{n}mm.step")) for n in (12, 15))
    start = at_place([first, second], np.eye(4), np.diag(np.repeat([1e-3, 0.01], 3)) ** 2, priors)
    start = replace(start, Ts=np.stack([np.eye(4)] * 2), weights=np.array(weights))  # the files have one frame
    both = np.flatnonzero(second.surface.closest(first.samples).distances < 1e-6)[:6]
    session = new_session(start, **stop)
    points, n = first.samples[both], first.normals[both]
    session.tell(Readings.from_columns(points, directions=-n, sds=np.full(len(both), 3e-4)))
    return session


def test_two_parts_are_ambiguous_for_any_required_probability():
    """Half a probability is not known, so that the session does not say that it is enough either."""
    priors = Priors(unknown=0.6)  # less than a half for each part, by more than the noise of the samples
    session = two_steps((0.5, 0.5), priors, probability=0.3, tolerance=0.05, confidence=0.3)
    assert session.state.of_parts().min() > 0.3
    assert not session.stop.reached(session.state)
    answer = session.answer(top=1)
    assert answer.status == "ambiguous"
    assert "step_12mm" in answer.message
    assert "step_15mm" in answer.message


@pytest.mark.parametrize("tolerance", [None, 0.05])
def test_a_reached_goal_is_an_answer_with_its_probability(tolerance):
    session = two_steps((0.8, 0.2), probability=0.6, tolerance=tolerance, confidence=0.6)
    P = session.state.of_parts()
    assert 0.6 < P[0] < 0.95
    assert session.ask().reached
    answer = session.answer(top=1)
    assert answer.status == "recognized"
    assert answer.message.startswith(f"step_12mm ({percent(P[0])})")
    assert f"It may also be step_15mm ({percent(P[1])})" in answer.message
    assert f"step_12mm ({percent(P[0])})" in headline(answer)
    session.stop = replace(session.stop, probability=0.99)
    assert session.answer().status == "ambiguous"


def test_what_a_session_cannot_mean_is_refused(targets):
    session = new_session(rough(targets))
    with pytest.raises(InputError, match="top: expected 1 or more"):
        session.answer(top=0)
    with pytest.raises(InputError, match="seed: expected 0 or more"):
        new_session(rough(targets), seed=-1)
    for tolerance in (-1e-3, np.nan, np.inf):
        with pytest.raises(InputError, match="tolerance: expected a length from 0"):
            Sensing(tolerance=tolerance)
    for law in (NoiseLaw.of(np.nan), NoiseLaw.of(1e-300), NoiseLaw.of(np.inf)):
        with pytest.raises(InputError, match="law: expected a standard deviation"):
            replace(LASER, law=law)
    with pytest.raises(InputError, match="an origin and a unit direction"):
        replace(session.ask(), origin=np.zeros(2))


def test_what_cannot_be_a_reading_changes_nothing(targets):
    session = new_session(rough(targets))
    action = session.ask()
    for distance in (np.nan, -0.1, 0.0):
        with pytest.raises(InputError, match="distance"):
            action.read(distance)
    with pytest.raises(InputError):
        session.tell(Readings.from_columns(np.array([[np.nan, 0.0, 0.0]])))
    assert session.count == 0
    assert session.readings is None
    assert session.ask() is action


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_any_sequence_of_readings_leaves_a_valid_belief(targets, seed):
    """Contradictory, repeated, late, from nowhere near the part, and on the way free of everything."""
    rng = np.random.default_rng((3, seed))
    start = rough(targets)
    k, T = drawn_truth(start, rng)
    session = new_session(start, seed=seed, tolerance=1e-6, max_measurements=1000, least_gain=0.0)
    give_any_readings(session, targets[k], T, rng, 6)


def test_millimetres_are_no_free_beam(targets):
    action = new_session(rough(targets)).ask()
    with pytest.raises(InputError, match=r"Did you mean 0\.0987 m, with the number in millimetres"):
        action.read(98.7)
    for distance in (np.inf, 1.5 * action.max_range):
        assert action.read(distance).is_free.all()


@pytest.mark.slow
def test_a_contradicted_prior_ends_the_session(targets):
    """All six errors are over twice the stated ones; the readings agree, and a wider prior pose explains them."""
    start, rng = rough(targets, (0.010, 0.07)), np.random.default_rng(4)
    T = start.Ts[2] @ SE3.exp(np.linalg.cholesky(start.covariances[2]) @ np.full(6, 2.3))
    session = new_session(start, tolerance=1e-3, max_measurements=40)
    end, answer = sense(session, targets[2], T, rng), session.answer()
    assert not end.reached
    assert session.state.of_parts()[2] > 0.95
    assert end.message == answer.message
    assert answer.status == "unknown"
    assert answer.message.startswith("The closest part is wedge, but it is not at the prior pose")
    assert "Start a new session with a wider prior pose" in end.message
    wide = new_session(rough(targets, (0.025, 0.175)), tolerance=1e-3)
    wide.tell(session.readings)
    assert sense(wide, targets[2], T, rng).reached
    assert wide.answer().status == "recognized"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("contact", "half_angle", "sd", "across"),
    [(True, 0.0, 3e-4, 3e-4), (False, 0.0, 3e-4, 9e-5), (False, 0.02, 3e-4, 1e-3), (False, 0.0, 3e-3, 9e-4)],
)
def test_a_beam_is_as_wide_across_as_its_cone_and_touch_as_along(targets, contact, half_angle, sd, across):
    """Readings with a stated spread along only; a beam taken for a touch puts an edge at the wrong place."""
    session = Session(rough(targets), replace(LASER, contact=contact, beam_half_angle=half_angle), Sensing(sd=sd))
    action = session.ask()
    d = action.direction
    expected = sd**2 * np.outer(d, d) + across**2 * (np.eye(3) - np.outer(d, d))
    for given in (session, Session(session.start, session.probe, Sensing())):  # of the sensor, or of the reading itself
        given.tell(action.read(0.1, sd=None if given is session else sd))
        np.testing.assert_allclose(given.state.touches.covs[-1], expected, atol=1e-12)


def test_the_error_of_a_tip_counts_where_hand_poses_are_given(targets):
    session = Session(rough(targets), LASER, Sensing(sd=3e-4, tip_sd=(1e-3, 1e-3, 0.0)))
    action = session.ask()
    distance, turn = true_range(targets[0], session.start.Ts[0], action), SE3.exp(np.array([0, 0, 0, 0, 0.7, 0]))
    with pytest.raises(InputError, match=r"action\.read\(distance, T_world_hand"):
        session.tell(action.read(distance))
    assert session.count == 0
    session.tell(action.read(distance, T_world_hand=turn))
    np.testing.assert_allclose(session.state.touches.shared_jacobian[0][:, :2], 1e-3 * turn[:3, :2], atol=1e-9)


TIP = np.array([0.4e-3, -0.5e-3, 0.1e-3])
"""A tip that is off in the hand, about as ``(0.5, 0.5, 0.2)`` mm say."""

TOUCH = probe_of(2e-5, contact=True)


def touched(session, target, T, tip, *, turned):
    """Sense touches until the session ends, with a displaced tip and a hand that rotates with the approach or not."""
    rng, ways = np.random.default_rng(3), []
    while isinstance(action := session.ask(), Action):
        R = action.T_world_probe[:3, :3] if turned else np.eye(3)
        distance = true_range(target, T, replace(action, origin=action.origin + R @ tip)) + 2e-5 * rng.normal()
        session.tell(action.read(distance, T_world_hand=SE3.from_parts(R, action.origin)), action)
        place = action.origin + action.expected * action.direction
        ways.append((*np.round(place / 5e-4).astype(int), *np.round(10 * action.direction).astype(int)))
    return action, ways


@pytest.mark.slow
def test_places_that_the_tip_hides_are_not_planned_repeatedly(targets):
    """The hand keeps its rotation: the tip's offset remains, and no further touch separates it from the part's
    place."""
    start = at_pose(targets[0], np.eye(4), np.diag([3e-3] * 3 + [0.03] * 3) ** 2)
    sensing = Sensing(sd=2e-5, tip_sd=(5e-4, 5e-4, 2e-4))
    session = Session(start, TOUCH, sensing, stop=Stop(tolerance=1e-4, max_measurements=40))
    T = SE3.exp(np.array([2e-3, -1e-3, 1e-3, 0.01, 0.02, -0.01]))
    end, ways = touched(session, targets[0], T, TIP, turned=False)
    assert not end.reached
    assert "No reading is worth its cost" in end.message
    assert "offset of the tip in the hand's frame, which all readings share" in end.message
    assert "Calibrate it" in end.message
    assert "turn the hand more between readings" in end.message
    assert max(ways.count(way) for way in ways) <= 3
    assert len(ways) < 30
    assert 4e-4 < session.steps[-1].corner_sd < 8e-4


@pytest.mark.slow
def test_a_hand_that_turns_with_the_approach_finds_its_tip(targets):
    start = at_pose(targets[0], np.eye(4), np.diag([3e-3] * 3 + [0.03] * 3) ** 2)
    sensing = Sensing(sd=2e-5, tip_sd=(5e-4, 5e-4, 2e-4))
    session = Session(start, TOUCH, sensing, stop=Stop(tolerance=1e-4, max_measurements=40))
    T = SE3.exp(np.array([2e-3, -1e-3, 1e-3, 0.01, 0.02, -0.01]))
    end, ways = touched(session, targets[0], T, TIP, turned=True)
    assert end.reached
    assert max(ways.count(way) for way in ways) <= 3
    assert off(session, 0, T) < 1e-4


def test_the_error_of_a_robot_is_reported_as_the_limit(targets):
    start = at_pose(targets[0], np.eye(4), np.diag([3e-3] * 3 + [0.03] * 3) ** 2)
    session = Session(start, TOUCH, Sensing(sd=2e-5, robot="calibrated_small"), stop=Stop(tolerance=1e-4))
    end, ways = touched(session, targets[0], np.eye(4), np.zeros(3), turned=True)
    assert not end.reached
    assert "absolute error of the robot (calibrated_small)" in end.message
    assert max(ways.count(way) for way in ways) <= 3


def test_a_bias_along_the_approach_is_found_from_opposite_sides(targets):
    start = at_pose(targets[0], np.eye(4), np.diag([3e-3] * 3 + [0.03] * 3) ** 2)
    session = Session(start, TOUCH, Sensing(sd=2e-5, bias_sd=3e-4), stop=Stop(tolerance=1e-4, max_measurements=40))
    T = SE3.exp(np.array([2e-3, -1e-3, 1e-3, 0.01, 0.02, -0.01]))
    end, ways = touched(session, targets[0], T, np.array([0.0, 0.0, 3e-4]), turned=True)
    assert end.reached
    assert max(ways.count(way) for way in ways) <= 3
    assert off(session, 0, T) < 1e-4


@pytest.mark.parametrize("bias_sd", [None, 1e-4])
def test_centres_of_a_ball_are_given_as_to_identify(targets, bias_sd):
    rng, radius = np.random.default_rng(0), 2e-3
    T = SE3.exp(np.array([2e-3, -1e-3, 1e-3, 0.01, 0.02, -0.01]))
    rows = rng.permutation(len(targets[0].samples))[:14]
    p, n = SE3.apply(T, targets[0].samples[rows]), targets[0].normals[rows] @ T[:3, :3].T
    centres = p + radius * n + 2e-5 * rng.normal(size=p.shape)
    readings = Readings.from_columns(centres, directions=-n, radii=np.full(14, radius))
    C = np.diag([3e-3] * 3 + [0.03] * 3) ** 2
    session = Session(
        at_pose(targets[0], np.eye(4), C, Priors(noise_factor=1.0)), TOUCH, Sensing(sd=2e-5, bias_sd=bias_sd)
    )
    session.tell(readings)
    priors = Priors(pose=PosePrior(np.eye(4), C), noise_factor=1.0)
    expected = identify(readings, [targets[0].part], sd=2e-5, bias_sd=bias_sd, priors=priors).best
    given = session.answer().best
    apart = SE3.log(SE3.inverse(expected.T_world_part) @ given.T_world_part)
    np.testing.assert_array_less(
        np.abs(apart), 0.02 * np.sqrt(np.diag(expected.covariance))
    )  # both are means of samples
    np.testing.assert_allclose(np.sqrt(np.diag(given.covariance)), np.sqrt(np.diag(expected.covariance)), rtol=0.1)


@pytest.mark.slow
def test_the_ball_is_part_of_the_probe(targets):
    """Its centre stops one radius short of a face, and the reading is this centre."""
    radius, T = 3e-3, SE3.exp(np.array([1e-3, -1e-3, 1e-3, 0.01, 0.01, -0.01]))
    start = at_pose(targets[0], np.eye(4), np.diag([2e-3] * 3 + [0.02] * 3) ** 2)
    probe = replace(TOUCH, radius=radius)
    session = Session(start, probe, Sensing(sd=2e-5), stop=Stop(tolerance=1e-4, max_measurements=30))
    first = session.ask()
    assert first.expected == pytest.approx(where_a_ball_stops(targets[0], np.eye(4), first, radius), abs=1e-7)
    assert first.expected == pytest.approx(probe.standoff - radius, abs=1e-7)
    assert first.read(0.04).radii.tolist() == [radius]
    while isinstance(action := session.ask(), Action):
        session.tell(action.read(where_a_ball_stops(targets[0], T, action, radius)))
    assert action.reached
    assert off(session, 0, T) < 1e-4


def test_no_session_succeeds_with_an_unaccepted_answer(targets):
    """Readings that are all two standard deviations off, each twice, to either side: no reading is an outlier."""
    session = new_session(rough(targets), tolerance=8e-4)
    while isinstance(action := session.ask(), Action):
        distance = true_range(targets[0], session.start.Ts[0], action)
        session.tell(
            concatenate([action.read(distance + 6e-4), action.read(distance - 6e-4, name=f"{action.name} again")])
        )
    answer = session.answer()
    assert answer.status == "unknown"
    assert "the readings contradict it" in answer.message
    assert not action.reached
    assert action.message == answer.message


def test_a_higher_step_is_an_unknown_object_in_its_place():
    """Thirty exact readings of it leave the known part no probability at all: it is what the object is like."""
    known, own = (prepare(read_part(PARTS / f"step_{x}mm.step")) for x in (12, 15))
    start, rng = rough([known]), np.random.default_rng(2)
    session, (p, d) = new_session(start), beams(own, 30, rng)
    points = SE3.apply(start.Ts[0], p + 1e-4 * rng.normal(size=p.shape))
    session.tell(Readings.from_columns(points, directions=d @ start.Ts[0][:3, :3].T, sds=np.full(30, 1e-4)))
    answer = session.answer()
    assert answer.status == "unknown"
    assert answer.unknown_probability == pytest.approx(1.0)
    assert answer.hypotheses[0].part == "step_12mm"
    assert "readings agree that face 8 of step_12mm is 3" in answer.message
    valid(session)
    assert nees(known.part, answer.hypotheses[0].T_world_part, answer.hypotheses[0].covariance, start.Ts[0])[0] < 22.5


def test_of_several_prior_poses_the_nearest_counts(targets):
    """An image was wrong by far more than it stated, but the other prior allows it."""
    start, rng = rough(targets[2:], (0.015, 0.1)), np.random.default_rng(4)
    both = replace(
        start, part=np.zeros(2, dtype=int), Ts=np.stack([start.Ts[0]] * 2), weights=np.array([0.02, 0.98]),
        covariances=np.stack([start.covariances[0], start.covariances[0] / 100]),
    )  # fmt: skip
    session = new_session(both, tolerance=2e-3)
    assert sense(session, targets[2], start.Ts[0] @ SE3.exp(np.array([0.01, 0, 0, 0, 0.05, 0])), rng).reached
    assert session.answer().status == "recognized"


@pytest.mark.parametrize(
    ("shift", "words"),
    [
        ("xxxx..........", "Readings a1 to a4 do not fit, all after a4 do. Did the part or the sensor move?"),
        (".xx...........", ""),  # one in fifteen by chance
        (".xx.................", "Readings a2 to a3 do not fit, all after a3 do. Did the part or the sensor move?"),
        (
            "..........x.xx",
            "3 of the readings a11 to a14 do not fit, all before a11 do. Did the part or the sensor move?",
        ),
        ("x.............", ""),
        ("x......x....x.", ""),
        ("xxxxxx", ""),
    ],
)
def test_readings_that_misfit_before_or_after_a_time_are_named(shift, words):
    mask = np.array([c == "x" for c in shift])
    found = moved([f"a{k + 1}" for k in range(len(mask))], mask)
    assert (found.message if found is not None else "") == words


@pytest.mark.slow
def test_a_moved_part_is_reported(targets):
    start, rng = rough(targets[2:]), np.random.default_rng(6)
    session, T = new_session(start, tolerance=1e-3, max_measurements=20), start.Ts[0]
    while isinstance(action := session.ask(), Action):
        if session.count == 6:
            T = start.Ts[0] @ SE3.exp(np.array([0.003, 0.003, 0.003, 0, 0, 0]))
        session.tell(action.read(max(true_range(targets[2], T, action) + 3e-4 * rng.normal(), 1e-6)))
    assert "Did the part or the sensor move?" in session.answer().message


@pytest.mark.slow
@pytest.mark.parametrize("of_the_object", [False, True])
def test_a_reading_that_does_not_fit_is_made_once_more(targets, of_the_object):
    """Two readings are off: outliers of the sensor the first time only; a part that is only like it is off again."""
    start, rng, wrong = rough(targets), np.random.default_rng(12), []
    session, again = new_session(start, errors=EXACT_MACHINE, tolerance=1e-3, max_measurements=21), 0
    while isinstance(action := session.ask(), Action):
        distance = true_range(targets[0], start.Ts[0], action) + 3e-4 * rng.normal()
        repeated = any(np.array_equal(action.origin, s.action.origin) for s in session.steps)
        again += repeated
        assert repeated == isinstance(action.reason, RepeatMisfit)
        wrong += [action.origin] * (session.count in (3, 7))
        off = any(np.array_equal(action.origin, o) for o in wrong) and (of_the_object or not repeated)
        session.tell(action.read(distance - 0.02 if off else max(distance, 1e-6)))
    assert again == 2 or (again == 1 and not of_the_object)  # one is enough where the first shows that the sensor erred
    assert action.reached == (not of_the_object)
    assert session.count <= 20 or of_the_object
    assert session.state.unknown > 0.01 or not of_the_object  # how much depends on the planned faces


def test_beams_that_are_made_twice_are_of_one_place(targets):
    action = new_session(rough(targets)).ask()
    beside = replace(action, origin=action.origin + 2e-3 * np.eye(3)[np.argmin(np.abs(action.direction))])
    readings = [action.read(0.08, name="x"), beside.read(0.1, name="y"), action.read(0.1, name="z")]
    assert Sensing(sd=3e-4).touches(concatenate(readings))[0].places.tolist() == [0, 1, 0]


def test_the_largest_number_of_readings_is_reported_unchanged(targets):
    session = new_session(rough(targets), max_measurements=2)
    session.tell(concatenate([free_beam(f"f{k}", (0.5, 0.5, 0.1 * k)) for k in range(3)]))
    assert session.ask().findings == (ReadingLimit(2, 3),)


def test_a_part_out_of_reach_is_reported(targets):
    from dataclasses import replace

    from tanteo.hand import Workspace

    far = Workspace(np.full(3, 5.0), np.full(3, 6.0))
    session = new_session(rough(targets), replace(LASER, workspace=far))
    end = session.ask()
    assert isinstance(end, Done)
    assert not end.reached
    assert "reaches no place" in end.message


def supposing(state, probabilities, unknown):
    """Return the session as if the best mode were several, with given probabilities."""
    modes = tuple(replace(state.modes[0], probability=p) for p in probabilities)
    return replace(state, posterior=replace(state.posterior, modes=modes), unknown=unknown, draws=None)


def test_poses_that_differ_by_less_than_tolerance_are_one_answer(targets):
    start, rng = rough(targets[2:], (1e-3, 1e-2)), np.random.default_rng(2)
    touches = scene(targets[2], start.Ts[0], SENSORS[1], 12, rng)[0]
    state = update(begin(start), touches, no_paths())
    two = supposing(state, (0.6, 0.39), 0.01)
    assert answered(two, Stop(0.98), 0, 5, 0.01).status == "ambiguous"
    one = answered(two, Stop(0.98, tolerance=0.02), 0, 5, 0.01)
    assert one.status == "recognized"
    assert one.message == "It is wedge. Its possible poses differ by less than the tolerance of 20 mm."
    three = supposing(state, (0.22, 0.22, 0.22), 0.34)
    for probability in (0.6, None):
        enough = Stop(probability, tolerance=0.02, confidence=0.6)
        assert enough.reached(three)
        little = answered(three, enough, 0, 5, 0.01)
        assert little.status == "recognized"
        assert little.message == (
            "It is wedge (66.0 %). Its possible poses differ by less than the tolerance of 20 mm. It may also be an "
            "unknown part (34.0 %)."
        )
    assert answered(three, Stop(0.98, tolerance=0.02), 0, 5, 0.01).status == "unknown"
    in_some = answered(three, Stop(0.6), 0, 5, 0.01)
    assert in_some.status == "ambiguous"  # of its poses; the session decided the part
    assert in_some.message.startswith(
        "It is wedge (66.0 %), in one of several poses. It may also be an unknown part (34.0 %)."
    )
    assert in_some.message.endswith("Sense a face that is at different places in these poses.")
    two = supposing(state, (0.79, 0.06), 0.15)
    pose = answered(two, Stop(0.8), 0, 5, 0.01)
    assert pose.status == "recognized"
    assert pose.message.startswith("wedge (79.0 %), located to")
    assert pose.message.endswith("It may also be an unknown part (15.0 %) or wedge in another pose (6.0 %).")
    two = supposing(state, (0.6, 0.39), 0.01)
    face = answered(two, Stop(0.98, tolerance=0.02, feature="face 2"), 0, 5, 0.01)
    assert "The possible places of face 2 differ by less than" in face.message


def test_a_reading_against_all_leaves_the_unknown_object(targets):
    start = rough(targets)
    session = new_session(start)
    for k, point in enumerate(np.eye(3)):
        session.tell(Readings.from_columns(10 * point[None], ids=[f"far {k}"]))
        valid(session)
    assert session.state.unknown > 0.99
    assert session.answer().status == "unknown"


def test_a_refused_reading_is_not_planned_again(targets):
    session = new_session(rough(targets))
    seen = []
    for _ in range(5):
        action = session.ask()
        assert all(
            np.linalg.norm(action.origin - a.origin) > 0.1 * a.expected
            or np.linalg.norm(action.direction - a.direction) > 0.1
            for a in seen
        )
        seen.append(action)
        session.refuse(action)
    assert session.count == 0
    assert [a.number for a in seen] == [1, 2, 3, 4, 5]


def test_a_face_that_is_always_refused_is_soon_given_up(targets):
    """Of one face and direction at most six readings, far fewer than places that are a little apart."""
    session = new_session(rough(targets))
    tried = []
    for _ in range(18):
        action = session.ask()
        if isinstance(action, Done):
            break
        tried.append((action.part, action.face, tuple(np.round(action.direction, 1))))
        session.refuse(action)
    assert len(tried) > 6
    assert max(map(tried.count, tried)) <= 6


def test_places_and_directions_like_a_refused_one_are_left_out(targets):
    session = new_session(rough(targets))
    action = session.ask()
    session.refuse(action)
    a, b = np.cos(0.05), np.sin(0.05)
    across = np.cross(action.direction, np.eye(3)[np.argmin(np.abs(action.direction))])
    tilted = a * action.direction + b * across / np.linalg.norm(across)
    near, far = action.origin + 1e-3, action.origin + 0.5 * action.expected
    some = Candidates(
        np.stack([action.origin, near, far, action.origin]),
        np.stack([action.direction, tilted, action.direction, -action.direction]),
        np.zeros(4, dtype=int), np.zeros(4, dtype=int), np.full(4, action.expected),
    )  # fmt: skip
    np.testing.assert_array_equal(session._open(some).origins, some.origins[2:])


def test_only_possible_readings_are_planned(targets):
    session = new_session(rough(targets))
    session.able = lambda state, candidates: candidates.directions[:, 2] < -0.9
    assert session.ask().direction[2] < -0.9
    none = new_session(rough(targets))
    none.able = lambda state, candidates: np.zeros(len(candidates), dtype=bool)
    assert "reaches no place" in none.ask().message


@pytest.mark.parametrize(("tilt", "contact", "speaks"), [(70, False, False), (70, True, True), (40, False, True)])
def test_no_echo_from_an_oblique_face_has_no_information(tilt, contact, speaks):
    """Beams at the middle of the top, from beyond and within the incidence to which the probe answers."""
    target, angle = prepare(read_part(PARTS / "block.step")), np.radians(tilt)
    low, high = target.part.box
    along = np.array([np.sin(angle), 0.0, -np.cos(angle)])
    origin = np.array([*0.5 * (low + high)[:2], high[2]]) - 0.05 * along
    session = Session(at_pose(target, np.eye(4), 1e-10 * np.eye(6)), replace(LASER, contact=contact), Sensing(sd=3e-4))
    action, before = Action(1, origin, along, 0.2, 0.05, "block", "top", 0.0, ChosenByUser()), session.state.unknown
    assert true_range(target, np.eye(4), action) == pytest.approx(0.05)
    session.tell(action.read(np.inf))
    assert (session.state.unknown > 2 * before) == speaks
    assert speaks or session.state.unknown < 1.2 * before
