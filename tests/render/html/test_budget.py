"""The budget adds up to the covariance of the best linear estimator, and to that of the answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from report_scenes import TRUTH, touches
from tanteo.geometry import SE3
from tanteo.planning import Sensing
from tanteo.posterior import PosePrior, Priors
from tanteo.posterior.answers import corner_moves
from tanteo.recognition import locate
from tanteo.render.html import find_contacts, gather, make_budget
from tanteo.sensors import Readings
from tanteo.sensors.presets import robot_preset

ROBOT = "calibrated_small"


def hands(n, rng):
    Ts = np.broadcast_to(np.eye(4), (n, 4, 4)).copy()
    Ts[:, :3, :3] = SE3.exp(np.concatenate([np.zeros((n, 3)), rng.normal(size=(n, 3))], axis=1))[:, :3, :3]
    Ts[:, :3, 3] = 0.2
    return Ts


@pytest.fixture(scope="module")
def scene(wedge):
    """Touches with a tip that is not where it should be, a robot and a rough part."""
    rng = np.random.default_rng(5)
    readings = touches(wedge, rng, Ts_world_hand=hands(5 * len(wedge.planes), rng))
    options = {"tip_sd": (5e-5, 5e-5, 1.5e-4), "robot": ROBOT, "tolerance": 5e-5}
    answer = locate(readings, wedge, **options)
    return readings, options, answer.hypotheses[0]


def budget_of(wedge, readings, hypothesis, prior=None, covariance=None, **options):
    sensed = gather(readings, Sensing(**options), prior)
    contacts = find_contacts(sensed, wedge, hypothesis)
    budget = make_budget(contacts, sensed, wedge, hypothesis.T_world_part, covariance=covariance)
    return budget, contacts, sensed


def dense(contacts, sensed):
    """Rows of the used readings and their covariance, written out."""
    used = contacts.used[contacts.reading]
    V = np.diag((contacts.noise + contacts.repeatability)[used])
    for error, gain in zip(sensed.measured.shared, contacts.shared_jacobian, strict=True):
        V += gain[used] @ error.covariance @ gain[used].T
    return contacts.rows[used], V + sensed.tolerance**2 * np.diag(contacts.is_distance[used])


def test_it_is_the_covariance_of_weighted_least_squares(wedge, scene):
    readings, options, h = scene
    budget, contacts, sensed = budget_of(wedge, readings, h, **options)
    H, V = dense(contacts, sensed)
    C = np.linalg.inv(H.T @ np.linalg.solve(V, H))
    J = corner_moves(wedge)
    worst = np.sqrt(np.linalg.eigvalsh(J @ C @ np.swapaxes(J, 1, 2)).max())
    assert budget.total == pytest.approx(worst, rel=1e-9)
    assert sum(s.share for s in budget.sources) == pytest.approx(1.0)
    assert sum(s.sd**2 for s in budget.sources) == pytest.approx(budget.total**2)


def test_sources_have_names_and_the_largest_comes_first(wedge, scene):
    readings, options, h = scene
    budget, _, _ = budget_of(wedge, readings, h, **options)
    assert {s.name for s in budget.sources} == {
        "noise of the sensor", "repeatability of the robot", "robot base (shared)", "tip offset (shared)",
        "form of the part",
    }  # fmt: skip
    assert [s.share for s in budget.sources] == sorted((s.share for s in budget.sources), reverse=True)


def test_without_a_source_is_as_if_it_was_never_there(wedge, scene):
    readings, options, h = scene
    budget, _, _ = budget_of(wedge, readings, h, **options)
    left = {s.name: s.without for s in budget.sources}
    no_tip = {k: v for k, v in options.items() if k != "tip_sd"}
    # the contacts use the shared errors to place the readings, which moves nothing of the rows
    assert left["tip offset (shared)"] == pytest.approx(budget_of(wedge, readings, h, **no_tip)[0].total, rel=1e-6)
    no_tolerance = options | {"tolerance": 0.0}
    assert left["form of the part"] == pytest.approx(budget_of(wedge, readings, h, **no_tolerance)[0].total, rel=1e-6)
    assert all(s.without <= budget.total * (1 + 1e-9) for s in budget.sources if np.isfinite(s.without))


def test_repeatability_is_that_of_the_preset(wedge, scene):
    readings, options, h = scene
    _, contacts, _ = budget_of(wedge, readings, h, **options)
    assert (contacts.repeatability >= robot_preset(ROBOT).pos_repeat_std ** 2 * (1 - 1e-9)).all()


@pytest.mark.parametrize("tolerance", [0.0, 1e-4])
def test_it_agrees_with_the_answer_on_labelled_planes(wedge, tolerance):
    readings = touches(wedge, np.random.default_rng(6))
    h = locate(readings, wedge, tolerance=tolerance, priors=Priors(noise_factor=1.0)).hypotheses[0]
    budget, _, _ = budget_of(wedge, readings, h, tolerance=tolerance, covariance=h.covariance)
    assert budget.total == pytest.approx(h.corner_sd, rel=0.06)  # near edges readings count in part


@pytest.mark.parametrize("tolerance", [0.0, 1e-4])
def test_it_agrees_with_the_answer_on_bare_points(wedge, tolerance):
    labelled = touches(wedge, np.random.default_rng(6))
    readings = Readings.from_columns(points=labelled.points, directions=labelled.directions, sds=labelled.sds)
    h = locate(readings, wedge, tolerance=tolerance, priors=Priors(noise_factor=1.0)).hypotheses[0]
    budget, _, _ = budget_of(wedge, readings, h, tolerance=tolerance, covariance=h.covariance)
    # the answer has the spread of the whole posterior, the budget that of a normal about its peak
    assert budget.total == pytest.approx(h.corner_sd, rel=0.1)


def test_what_no_reading_resists_is_not_in_it(wedge):
    """Three faces of which two are parallel leave a slide free; the rest is known."""
    up = np.abs(wedge.planes.normals[:, 2]) > 0.9
    readings = touches(wedge, np.random.default_rng(7), planes=[*np.flatnonzero(up), int(np.flatnonzero(~up)[0])])
    h = locate(readings, wedge).hypotheses[0]
    budget, _, _ = budget_of(wedge, readings, h)
    assert h.unobserved
    assert h.corner_sd > 1e-2
    assert budget.total < 1e-3


def test_nothing_observed_is_no_budget(wedge):
    h = locate(touches(wedge, np.random.default_rng(6)), wedge).hypotheses[0]
    readings = touches(wedge, np.random.default_rng(8))
    sensed = gather(readings)
    contacts = find_contacts(sensed, wedge, h)
    none = contacts.used & False
    assert make_budget(replace(contacts, used=none), sensed, wedge, h.T_world_part) is None


def test_what_was_known_beforehand_has_its_share(wedge):
    readings = touches(wedge, np.random.default_rng(9), n=2)
    prior = PosePrior(TRUTH, np.diag([1e-5, 1e-5, 1e-5, 1e-4, 1e-4, 1e-4]) ** 2)
    h = locate(readings, wedge, priors=Priors(pose=prior)).hypotheses[0]
    budget, _, _ = budget_of(wedge, readings, h, prior=prior, covariance=h.covariance)
    share = {s.name: s.share for s in budget.sources}["prior"]
    assert 0.3 < share < 1
    assert budget.total == pytest.approx(h.corner_sd, rel=0.2)
