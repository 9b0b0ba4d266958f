"""Plans keep what they promise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cli.conftest import prism, stl
from sensing_scenes import FLIGHT, LASER, new_session, sense
from tanteo.active import Probe, Start, at_pose, distinguish, plan
from tanteo.active.distinguish import laid_on, located
from tanteo.active.plans import _design
from tanteo.errors import InputError
from tanteo.lie import SE3
from tanteo.matching import Priors
from tanteo.parts import read_part
from tanteo.sensors.law import NoiseLaw
from tanteo.surface_search import prepare_target

PARTS = Path(__file__).parents[2] / "examples" / "parts"
TOUCH = Probe("touch", NoiseLaw.of(3e-4), contact=True, standoff=0.03)
C = np.diag(np.repeat([5e-3, 0.05], 3) ** 2)


@pytest.fixture(scope="module")
def block(tmp_path_factory):
    path = tmp_path_factory.mktemp("block") / "block.stl"
    path.write_text(stl(prism([(0, 0), (200, 0), (200, 150), (0, 150)], 80)))
    return prepare_target(read_part(path, unit="mm"))


@pytest.fixture(scope="module")
def bracket():
    return prepare_target(read_part(PARTS / "bracket_left.step"))


def test_six_planned_touches_of_a_block(block):
    found = plan(at_pose(block, np.eye(4), C), TOUCH, 1e-5, most=6)
    assert not found.reached
    assert len(found.readings) == 6
    assert found.readings[-1].worst_corner_sd <= 0.65e-3


def test_what_is_promised_after_a_plan_is_what_linear_least_squares_gives(bracket):
    """Simulated readings of the plan, estimated about the expected pose: corner errors against the promised chance."""
    tolerance = 0.8e-3
    start = at_pose(bracket, np.eye(4), C)
    found = plan(start, TOUCH, tolerance, 0.9)
    assert found.reached
    assert 0.9 <= found.readings[-1].within < 0.99
    within = [r.within for r in found.readings]
    assert within == sorted(within)
    design = _design(start, TOUCH, 0)
    rows = [int(np.argmin(np.linalg.norm(design.points - r.point, axis=1))) for r in found.readings]
    G, R, rng = design.rows[rows], design.variances[rows], np.random.default_rng(1)
    xi = rng.normal(size=(4000, 6)) @ np.linalg.cholesky(C).T
    y = xi @ G.T + np.sqrt(R) * rng.normal(size=(4000, len(rows)))
    gain = C @ G.T @ np.linalg.inv(G @ C @ G.T + np.diag(R))
    off = np.linalg.norm(np.einsum("cij,sj->sci", design.corners, xi - y @ gain.T), axis=-1).max(axis=1)
    assert np.mean(off <= tolerance) == pytest.approx(found.readings[-1].within, abs=0.02)


def test_no_fewer_readings_would_do_when_chosen_one_by_one_or_by_hand(block):
    """Every plan of one reading less, found by more starts than the plan itself, misses the confidence."""
    start = at_pose(block, np.eye(4), C)
    found = plan(start, TOUCH, 1.4e-3, 0.95)
    n = len(found.readings)
    fewer = [plan(start, TOUCH, 1.4e-3, 0.95, most=n - 1, seed=seed) for seed in range(4)]
    assert found.reached
    assert not any(other.reached for other in fewer)


def test_a_bias_does_not_average_out(bracket):
    """Straight from above, more touches never place the part's height better than the bias that they share."""
    biased = replace(TOUCH, law=NoiseLaw.of(1e-5), shared_sd=5e-4, approach=np.array([0, 0, -1.0]), cone=1e-6)
    start = at_pose(bracket, np.eye(4), C)
    few, many = (plan(start, biased, 1e-5, most=n) for n in (8, 20))
    z = [r.covariance[2, 2] ** 0.5 for p in (few, many) for r in p.readings[-1:]]
    assert min(z) > 0.9 * 5e-4


def test_a_robot_that_is_off_is_what_limits_the_plan(bracket):
    off = replace(TOUCH, base_sds=(1e-3, 1e-3))
    found = plan(at_pose(bracket, np.eye(4), C), off, 0.5e-3)
    assert not found.reached
    assert "robot's own error" in found.message


@pytest.fixture(scope="module")
def disc(tmp_path_factory):
    """A disc of 360 facets, which is round as far as anybody can feel."""
    path = tmp_path_factory.mktemp("disc") / "disc.stl"
    angles = np.arange(360) * np.pi / 180
    path.write_text(stl(prism([(40 * np.cos(a), 40 * np.sin(a)) for a in angles], 25)))
    target = prepare_target(read_part(path, unit="mm"))
    assert target.part.symmetry.continuous
    return target


def test_the_spin_of_a_round_part_needs_no_reading(disc):
    found = plan(at_pose(disc, np.eye(4), C), TOUCH, 1.5e-3)
    assert found.reached
    assert len(found.readings) <= 8
    session = new_session(at_pose(disc, np.eye(4), C), tolerance=1.5e-3, most=12)
    end = sense(session, disc, SE3.exp(np.array([2e-3, -1e-3, 1e-3, 0.02, 0.01, 0.03])), np.random.default_rng(1))
    assert end.reached
    assert session.steps[-1].worst_corner_sd < 1e-3


def test_out_of_reach_is_said(bracket):
    from tanteo.hand import Workspace

    away = replace(TOUCH, workspace=Workspace.above(3.0))
    found = plan(at_pose(bracket, np.eye(4), C), away, 1e-3)
    assert found.readings == ()
    assert "reaches no place" in found.message


@pytest.mark.parametrize(
    ("tolerance", "confidence", "most"), [(0.0, 0.9, 5), (np.nan, 0.9, 5), (1e-3, 1.0, 5), (1e-3, 0.9, 0)]
)
def test_a_plan_that_cannot_be_meant_is_refused(bracket, tolerance, confidence, most):
    with pytest.raises(InputError, match="plan"):
        plan(at_pose(bracket, np.eye(4), C), TOUCH, tolerance, confidence, most)


@pytest.mark.parametrize("names", [("bracket_left", "bracket_right"), ("step_12mm", "step_15mm")])
def test_one_reading_tells_twins_apart(names):
    pair = [prepare_target(read_part(PARTS / f"{name}.step")) for name in names]
    found = distinguish(*pair, LASER)
    assert found.parts == names
    assert found.information > 0.6
    assert abs(found.ranges[0] - found.ranges[1]) > 5 * found.sds.max()
    assert "tells" in found.message
    right = 0
    for seed in range(6):
        rng = np.random.default_rng(seed)
        k = seed % 2
        poses = laid_on(pair[k], pair[1 - k])
        start = Start(
            tuple(pair), np.array([k] + [1 - k] * len(poses)), np.concatenate([np.eye(4)[None], poses]),
            np.stack([located(pair[k], 2e-4)] + [located(pair[1 - k], 2e-4)] * len(poses)),
            np.r_[0.5, np.full(len(poses), 0.5 / len(poses))], Priors(),
        )  # fmt: skip
        session = new_session(start, most=1, probability=0.999)
        sense(session, pair[k], SE3.exp(np.linalg.cholesky(start.covariances[0]) @ rng.normal(size=6)), rng)
        right += session.belief.of_parts()[k] > 0.95
    assert right == 6


def test_what_no_reading_tells_apart_is_said():
    same = prepare_target(read_part(PARTS / "wedge.step"))
    found = distinguish(same, same, FLIGHT)
    assert found.information < 0.05
    assert "No single reading" in found.message
