"""Stated distance from the truth, against sampling by another method."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.special import entr
from scipy.stats import binom

from bare_scenes import SENSORS, no_paths, scene
from sensing_scenes import EXACT_MACHINE, displaced_faces, log_densities, made_session, off, rough, sense_made
from tanteo.geometry import SE3
from tanteo.parts import read_part
from tanteo.planning import Stop, at_place, begin, update
from tanteo.planning.start import Start, at_pose
from tanteo.planning.stopping import chance_within, corner_distances, largest_corner_sd
from tanteo.posterior import Priors, prepare
from tanteo.posterior.answers import corner_sd

PARTS = Path(__file__).parents[2] / "examples" / "parts"


@pytest.mark.parametrize("n", [2, 4])
def test_chance_to_be_within_is_that_of_importance_sampling(n):
    """Samples of the prior pose, weighed by the readings' likelihood; a coarse sensor, a broad posterior."""
    target, coarse, rng = (
        prepare(read_part(PARTS / "wedge.step")),
        replace(SENSORS[1], sd=4e-3),
        np.random.default_rng(n),
    )
    start = rough([target], (0.01, 0.08))
    touches = scene(target, start.Ts[0], coarse, n, rng)[0]
    state = update(begin(start), touches, no_paths())
    Ts = start.Ts[0] @ SE3.exp((np.linalg.cholesky(start.covariances[0]) @ rng.normal(size=(40000, 6, 1)))[..., 0])
    log = log_densities(touches, target, start.priors, Ts)
    w = np.exp(log - log.max())
    off = corner_distances(state, 0, Ts)
    for tolerance in (0.008, 0.015, 0.025):
        expected = w @ (off <= tolerance) / w.sum()
        known = state.of_parts().sum()
        assert chance_within(state, tolerance) / known == pytest.approx(expected, abs=0.06)


def test_poses_that_symmetry_makes_equal_are_no_way_apart():
    target = prepare(read_part(PARTS / "square_post.step"))
    start = at_pose(target, SE3.exp(np.array([0.1, 0.2, 0, 0.3, 0.2, 0.1])), 1e-6 * np.eye(6))
    images = start.Ts[0] @ target.part.symmetry.Ts
    assert len(images) > 1
    np.testing.assert_allclose(corner_distances(begin(start), 0, images), 0.0, atol=1e-9)
    moved = images @ SE3.exp(np.array([2e-3, 0, 0, 0, 0, 0]))
    np.testing.assert_allclose(corner_distances(begin(start), 0, moved), 2e-3, atol=1e-9)


def test_the_worst_corner_is_that_of_poses_that_part_may_have():
    """Two poses 20 mm and 10 degrees apart, at 0.7 and 0.3, against samples of both; one alone has its own."""
    target, rng = prepare(read_part(PARTS / "wedge.step")), np.random.default_rng(5)
    Ts = np.stack([np.eye(4), SE3.exp(np.array([0.02, 0, 0, 0, 0, np.radians(10)]))])
    C = np.diag([1e-3, 2e-3, 1e-3, 0.02, 0.03, 0.01]) ** 2
    start = Start(
        (target,), np.zeros(2, dtype=int), Ts, np.stack([C, 2 * C]), np.array([0.7, 0.3]), Priors(noise_factor=1.0)
    )
    mode = rng.choice(2, 200_000, p=[0.7, 0.3])
    xi = rng.normal(size=(len(mode), 6)) * np.sqrt(np.diag(C)) * np.sqrt(1.0 + mode)[:, None]
    corners = np.stack(np.meshgrid(*target.part.box.T), axis=-1).reshape(8, 3)
    at = SE3.apply((Ts[mode] @ SE3.exp(xi))[:, None], corners)
    drawn = max(np.linalg.eigvalsh(np.cov(at[:, k].T)).max() for k in range(8)) ** 0.5
    assert largest_corner_sd(begin(start)) == pytest.approx(drawn, rel=0.01)
    alone = at_pose(target, Ts[0], C)
    assert largest_corner_sd(begin(alone)) == pytest.approx(corner_sd(target.part, C))


def test_symmetric_poses_are_one_for_the_largest_corner_sd():
    target = prepare(read_part(PARTS / "square_post.step"))
    Ts, C = target.part.symmetry.Ts, 1e-6 * np.eye(6)
    n = len(Ts)
    start = Start((target,), np.zeros(n, dtype=int), Ts, np.tile(C, (n, 1, 1)), np.ones(n), Priors(noise_factor=1.0))
    assert largest_corner_sd(begin(start)) == pytest.approx(corner_sd(target.part, C), rel=1e-6)


def test_only_what_is_known_but_for_none_of_these_is_confirmed():
    """Before the first reading nothing but the start is known: a part at a pose, each axis to about a millimetre."""
    target = prepare(read_part(PARTS / "wedge.step"))
    known = begin(at_pose(target, np.eye(4), np.diag(np.repeat([1e-3, 1e-3], 3)) ** 2))
    state, most_likely_none = replace(known, unknown=0.4), replace(known, unknown=0.51)
    assert Stop(0.9).confirms(state)
    assert not Stop(0.9).confirms(most_likely_none)
    assert not Stop(probability=None, tolerance=0.02).confirms(state)
    assert Stop(0.9, tolerance=0.02).confirms(state)
    assert not Stop(0.9, tolerance=5e-4).confirms(state)  # which part is known, where is not
    assert Stop(0.9, max_measurements=5).confirms(state)
    assert not Stop(0.9, max_measurements=3).confirms(
        state
    )  # a third of the unknown object would be left, and a quarter may be
    twins = replace(begin(at_place([target, target], np.eye(4), np.eye(6))), unknown=0.4)
    assert not Stop(0.9).confirms(twins)


def test_what_little_is_left_is_worth_as_many_readings():
    """Two parts at 0.98 and 0.02: ten readings of 0.01 nats give the missing 0.098 nats and nine do not."""
    target = prepare(read_part(PARTS / "wedge.step"))
    start = at_place([target, target], np.eye(4), np.diag(np.repeat([1e-3, 1e-3], 3)) ** 2)
    state = replace(begin(replace(start, weights=np.array([0.98, 0.02]))), unknown=0.0)
    assert entr([0.98, 0.02]).sum() == pytest.approx(0.098, abs=1e-4)
    assert Stop(0.99).many_small_gains_suffice(state, 0.01, 10)
    assert not Stop(0.99).many_small_gains_suffice(state, 0.01, 9)
    assert not Stop(0.99).many_small_gains_suffice(state, 0.0019, 10**6)  # no longer an expectation but its noise
    assert Stop(0.99, tolerance=0.02).many_small_gains_suffice(state, 0.01, 10)
    assert not Stop(0.99, tolerance=5e-4).many_small_gains_suffice(state, 0.01, 10)  # the place is missing, of either
    assert not Stop(0.99).many_small_gains_suffice(replace(state, unknown=0.5), 0.01, 10)


def test_a_part_is_not_near_the_stated_pose_of_another():
    target = prepare(read_part(PARTS / "wedge.step"))
    twins = replace(begin(at_place([target, target], np.eye(4), 1e-6 * np.eye(6))), unknown=0.1)
    assert chance_within(twins, 0.1) == pytest.approx(0.45)


def test_where_the_posterior_is_not_normal_draws_decide():
    """All samples are put on the best pose: what is not normal is there then, however wide its covariance."""
    target, rng = prepare(read_part(PARTS / "wedge.step")), np.random.default_rng(2)
    start = rough([target], (0.01, 0.08))
    touches = scene(target, start.Ts[0], replace(SENSORS[1], sd=4e-3), 2, rng)[0]
    state = update(begin(start), touches, no_paths())
    bent = np.array([not mode.normal for mode in state.modes])
    drawn = np.unique(state.draws.mode)
    here = replace(state, draws=replace(state.draws, Ts=np.tile(state.poses[0], (len(state.draws.Ts), 1, 1))))
    assert bent[0]
    assert chance_within(state, 1e-6) == 0.0
    assert chance_within(here, 1e-6) == pytest.approx(state.weights[drawn][bent[drawn]].sum())


@pytest.mark.slow
def test_the_pose_of_a_casting_divides_its_planes():
    """The tops beside the slot are one plane of readings, and two faces; this session touches both."""
    target, rng = prepare(read_part(PARTS / "t_slot.step")), np.random.default_rng(6)
    session, T = made_session(target, 2e-4, rng, tolerance=5e-4, max_measurements=12)
    sense_made(session, target, T, displaced_faces(target, 2e-4, rng), rng)
    alone, divided = (
        session.sensing.touches(session.readings, session.probe, state)[0].shared_jacobian.shape[2]
        for state in (None, session.state)
    )
    assert divided > alone
    assert session.state.touches.shared_jacobian.shape[2] >= divided - 1


@pytest.mark.slow
def test_assumed_errors_take_from_the_goal():
    """Without a stated scale error, drift and warp the same readings give less, by the covariance of the answer."""
    target, goal = prepare(read_part(PARTS / "wedge.step")), 3e-4
    rng, place = np.random.default_rng(5), {"at": (0.4, 0.3, 0.0), "tolerance": goal, "max_measurements": 30}
    exact, T = made_session(target, 0.0, rng, errors=EXACT_MACHINE, **place)
    assert sense_made(exact, target, T, displaced_faces(target, 0.0, rng), rng).reached
    usual, _ = made_session(target, 0.0, np.random.default_rng(5), errors=(), **place)
    step = usual.tell(exact.readings)
    np.testing.assert_allclose(step.covariance, usual.answer().best.covariance, rtol=1e-3, atol=1e-12)
    assert step.within < exact.steps[-1].within - 0.02
    assert usual.stop.left_for_noise(usual.state) < 0.95 * goal
    assert exact.stop.left_for_noise(exact.state) == pytest.approx(goal, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("form_sd", "sd", "goal"), [(2e-4, 5e-5, 5e-4), (0.0, 1.5e-4, 3e-4)])
def test_sessions_keep_what_they_promise(form_sd, sd, goal):
    """Sessions with a stylus, on castings whose faces are off as a whole, and on exact parts."""
    target, stated, within = prepare(read_part(PARTS / "housing.step")), [], 0
    for seed in range(30):
        rng = np.random.default_rng((53, seed))
        session, T = made_session(target, form_sd, rng, seed, sd, tolerance=goal, max_measurements=40)
        if sense_made(session, target, T, displaced_faces(target, form_sd, rng, form_sd / 3), rng).reached:
            stated.append(session.steps[-1].within)
            within += off(session, 0, T) <= goal
    assert len(stated) > 25
    assert binom.cdf(within, len(stated), np.mean(stated)) > 0.005


@pytest.mark.slow
def test_a_session_ends_by_many_samples_of_its_posterior():
    """The probability at the end is that of the confirmed posterior, which is also the one of the answer."""
    target, goal = prepare(read_part(PARTS / "wedge.step")), 3e-4
    rng = np.random.default_rng(57)
    session, T = made_session(target, 0.0, rng, sd=1.5e-4, tolerance=goal, max_measurements=40)
    assert sense_made(session, target, T, displaced_faces(target, 0.0, rng), rng).reached
    usual = update(session.state, session.state.touches, session.state.free, session.state.unstated)
    assert session.steps[-1].within == chance_within(session.state, goal) >= 0.95
    assert len(session.state.draws.Ts) > 8 * len(usual.draws.Ts)


@pytest.mark.slow
def test_few_samples_decide_what_is_far_from_the_limit():
    target = prepare(read_part(PARTS / "wedge.step"))
    rng = np.random.default_rng(56)
    session, T = made_session(target, 0.0, rng, sd=1.5e-4, tolerance=4e-3, max_measurements=40)
    assert sense_made(session, target, T, displaced_faces(target, 0.0, rng), rng).reached
    state, stop = session.state, session.stop
    usual = update(state, state.touches, state.free, state.unstated)
    assert len(state.draws.Ts) < 2 * len(usual.draws.Ts)
    assert stop.is_clear(state)
    close = replace(stop, tolerance=6e-4)
    chance = close.chance(state)
    assert 0.1 < chance < 0.999
    sd = np.sqrt(chance * (1 - chance) / state.effective_samples(0))
    for away, clear in ((-3.1, True), (-2.9, False), (0.0, False), (2.9, False), (3.1, True)):
        if 0.5 < (limit := chance + away * sd) < 1:
            assert replace(close, confidence=limit).is_clear(state) == clear
