"""A likelihood of a user in Python: the numbers are those of the formula, and the answer is Bayes' one."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import Sensing, box_centred_pose, scene
from tanteo import PythonFactor, _core
from tanteo.errors import InputError
from tanteo.factors import FreeRays
from tanteo.geometry import SE3
from tanteo.posterior import Priors, Problem, identify_points, prepare

ROOT = Path(__file__).parents[2]
SD = 1e-4


@pytest.fixture(scope="module")
def block():
    return prepare(tanteo.read_part(ROOT / "examples" / "parts" / "block.step"))


def gauge(T, point, sd=SD, **more):
    """Return a measurement of the world position of a point of the part; outliers fill 1 m^3."""
    where = SE3.apply(T, point)

    def log_density(Ts, part):
        off = (SE3.apply(Ts, point) - where) / sd
        return -0.5 * np.sum(off**2, axis=-1) - 3 * np.log(np.sqrt(2 * np.pi) * sd)

    def gradient(Ts, part):
        pull = np.einsum("sij,si->sj", Ts[:, :3, :3], -(SE3.apply(Ts, point) - where) / sd**2)  # R' d log / d point
        return np.concatenate([pull, np.cross(point, pull)], axis=1)

    return PythonFactor(name="gauge", log_density=log_density, **more), gradient


def compiled(target, factor):
    touches = scene(target, np.eye(4), TOUCH, 0, np.random.default_rng(0))[0]
    return Problem(touches, FreeRays.none(), Priors(radius=0.1, noise_factor=1.0), pose_factors=(factor,)).compiled(
        target
    )


TOUCH = Sensing("touch", 2e-4, False, ())


@pytest.mark.parametrize("rate", [0.0, 0.2])
@pytest.mark.parametrize("analytic", [False, True])
def test_density_and_slopes_are_those_of_the_formula(block, rate, analytic):
    rng = np.random.default_rng(2)
    T, point, sd = box_centred_pose(rng), np.array([0.03, -0.01, 0.02]), 1e-3
    factor, gradient = gauge(T, point, sd, outlier_rate=rate)
    if analytic:
        factor = PythonFactor(name="gauge", log_density=factor.log_density, gradient=gradient, outlier_rate=rate)
    Ts = T @ SE3.exp(np.concatenate([3e-4 * rng.normal(size=(5, 3)), 0.01 * rng.normal(size=(5, 3))], axis=1))
    core, z = compiled(block, factor), np.zeros((5, 0))
    logs, slopes, information = _core.slopes(block.shape, core, Ts, z)
    plain = factor.log_density(Ts, block.part)
    expected = plain if rate == 0 else np.logaddexp(np.log1p(-rate) + plain, np.log(rate))
    np.testing.assert_allclose(logs, expected, rtol=1e-9)
    inlier = np.exp((np.log1p(-rate) if rate else 0.0) + plain - expected)
    own = gradient(Ts, block.part)
    about = own[:, 3:] - np.cross(block.centre, own[:, :3])  # of turns about the centre of the part
    np.testing.assert_allclose(slopes[:, :3], inlier[:, None] * own[:, :3], rtol=1e-4, atol=1e-3)
    np.testing.assert_allclose(slopes[:, 3:], inlier[:, None] * about, rtol=1e-4, atol=1e-3)
    arm = point - block.centre
    cross = np.array([[0, arm[2], -arm[1]], [-arm[2], 0, arm[0]], [arm[1], -arm[0], 0]])
    J = np.concatenate([np.eye(3), cross], axis=1)  # of the point, in the part's axes
    units = np.r_[np.ones(3), np.full(3, 30.0)]  # a turn moves the point by some centimetres
    at_truth = _core.slopes(block.shape, core, T[None], z[:1])[2][0]  # where J'J is the whole second derivative
    share = 1.0 if rate == 0 else 1 / (1 + rate / (1 - rate) * np.exp(-factor.log_density(T[None], block.part)[0]))
    error = (at_truth - share * (J.T @ J) / sd**2) * np.outer(units, units)
    assert np.all(np.abs(error) < 0.02 / sd**2)
    assert np.all(np.linalg.eigvalsh(information) > -1e-6 * np.abs(information).max())


def test_a_gauge_decides_what_three_touches_leave_open(block):
    """Two readings of points of the part beside points of one face: the pose has the covariance of Bayes' rule."""
    rng = np.random.default_rng(4)
    T = box_centred_pose(rng)
    touches = scene(block, T, TOUCH, 12, rng)[0]
    alone = identify_points(touches, FreeRays.none(), [block])
    far = [gauge(T, np.array(p))[0] for p in ([0.0, 0, 0], [0.08, 0.0, 0.0], [0.0, 0.05, 0.0])]
    both = identify_points(touches, FreeRays.none(), [block], factors=far)
    assert both.status == "recognized"
    best = both.hypotheses[0]
    assert best.corner_sd < 0.7 * alone.hypotheses[0].corner_sd
    xi = SE3.log(SE3.inverse(best.T_world_part) @ T)
    assert xi @ np.linalg.solve(best.covariance, xi) < 22  # 99.9 % of chi-square with 6 degrees of freedom


def test_a_factor_that_is_an_outlier_does_not_move_the_answer(block):
    rng = np.random.default_rng(5)
    T = box_centred_pose(rng)
    touches = scene(block, T, TOUCH, 25, rng)[0]
    alone = identify_points(touches, FreeRays.none(), [block]).hypotheses[0]
    wrong, _ = gauge(T @ SE3.exp(np.r_[0.02, 0, 0, 0, 0, 0]), np.array([0.01, 0.01, 0.01]))
    both = identify_points(touches, FreeRays.none(), [block], factors=[wrong]).hypotheses[0]
    np.testing.assert_allclose(both.T_world_part, alone.T_world_part, atol=2e-5)


def test_poses_that_a_factor_proposes_are_tried(block):
    """Three points fix no pose by themselves; a factor that has the pose proposes it."""
    rng = np.random.default_rng(6)
    T = box_centred_pose(rng)
    calls = []

    def propose(part):
        calls.append(part.name)
        return T[None]

    factor, _ = gauge(T, np.array([0.01, 0.02, 0.0]), propose=propose)
    identify_points(scene(block, T, TOUCH, 8, rng)[0], FreeRays.none(), [block], factors=[factor])
    assert set(calls) == {block.part.name}


@pytest.mark.parametrize(
    ("log_density", "message"),
    [
        (lambda Ts, part: np.zeros(len(Ts) + 1), "one number for each"),
        (lambda Ts, part: np.full(len(Ts), np.nan), "nan or inf"),
        (lambda Ts, part: np.full(len(Ts), np.inf), "nan or inf"),
        (lambda Ts, part: np.zeros((len(Ts), 1)), "one number for each"),
        (lambda Ts, part: "abc", "an array .* of numbers, got str"),
        (lambda Ts, part: None, "one number for each|an array"),
    ],
)
def test_functions_that_return_something_else_are_refused(block, log_density, message):
    core = compiled(block, PythonFactor(name="my gauge", log_density=log_density))
    with pytest.raises(InputError, match=f"my gauge: .*(?:{message})"):
        _core.log_densities(block.shape, core, np.eye(4)[None], np.zeros((1, 0)))


def test_an_exception_of_the_function_reaches_the_caller(block):
    def fails(Ts, part):
        raise KeyError("no calibration")

    core = compiled(block, PythonFactor(name="my gauge", log_density=fails))
    with pytest.raises(KeyError, match="no calibration") as raised:
        _core.log_densities(block.shape, core, np.tile(np.eye(4), (64, 1, 1)), np.zeros((64, 0)))
    assert raised.value.__notes__ == ["This happened in log_density of the factor 'my gauge', for 64 poses of block."]


def test_a_gradient_that_is_none_is_refused(block):
    flat = lambda Ts, part: np.zeros(len(Ts))  # noqa: E731
    for gradient, message in (
        (lambda Ts, part: np.zeros(len(Ts)), "six numbers for each"),
        (lambda Ts, part: np.full((len(Ts), 6), np.nan), "finite numbers"),
    ):
        core = compiled(block, PythonFactor(name="my gauge", log_density=flat, gradient=gradient))
        with pytest.raises(InputError, match=f"my gauge: .*gradient.*{message}"):
            _core.slopes(block.shape, core, np.eye(4)[None], np.zeros((1, 0)))


@pytest.mark.skipif(os.name != "posix", reason="SIGALRM")
def test_a_factor_that_hangs_can_be_interrupted_and_is_named(block):
    """As by Ctrl-C: the exception arises in the user's function, and its note names the factor."""

    def hangs(Ts, part):
        while True:
            time.sleep(0.01)

    def interrupt(number, frame):
        raise KeyboardInterrupt

    touches = scene(block, np.eye(4), TOUCH, 8, np.random.default_rng(0))[0]
    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 5.0)
    try:
        with pytest.raises(KeyboardInterrupt) as raised:
            identify_points(
                touches, FreeRays.none(), [block], factors=[PythonFactor(name="my gauge", log_density=hangs)]
            )
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert "factor 'my gauge'" in raised.value.__notes__[0]


def test_arguments_that_make_no_sense_are_refused():
    with pytest.raises(InputError, match=r"x: expected log_density to be a function"):
        PythonFactor(name="x", log_density=3)
    with pytest.raises(InputError, match=r"x: expected an outlier_rate"):
        PythonFactor(name="x", log_density=lambda Ts, part: 0, outlier_rate=1.0)
    with pytest.raises(InputError, match=r"x: expected propose"):
        PythonFactor(name="x", log_density=lambda Ts, part: 0, propose=lambda part: np.eye(4)).poses(None)


def test_impossible_poses_have_the_outlier_rate_or_nothing(block):
    never = lambda Ts, part: np.full(len(Ts), -np.inf)  # noqa: E731
    for rate, expected in ((0.1, np.log(0.1)), (0.0, -1e300)):
        core = compiled(block, PythonFactor(name="x", log_density=never, outlier_rate=rate))
        assert _core.log_densities(block.shape, core, np.eye(4)[None], np.zeros((1, 0)))[0] == pytest.approx(expected)
