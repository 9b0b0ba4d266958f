"""A peak on a plain: what readings near edges alone hold is as uncertain as the posterior says beyond the peak."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from bare_scenes import box_centred_pose, no_paths, surface_points, touches_of
from tanteo.lie import SE3, SO3
from tanteo.matching import Priors
from tanteo.parts import read_part
from tanteo.surface_search import identify_touches, prepare_target
from tanteo.surface_search.likelihood import log_posterior
from tanteo.surface_search.moments import posterior_moments

SD = 1e-4
EXAMPLES = Path(__file__).parents[2] / "examples" / "parts"


@pytest.fixture(scope="module")
def bar(tmp_path_factory):
    path = tmp_path_factory.mktemp("bar") / "bar.stl"
    trimesh.creation.cylinder(radius=10, height=60, sections=64).export(path)
    return prepare_target(read_part(path, unit="mm"))


def around_its_side(bar, seed):
    """25 touches of the side of a bar, none of its ends."""
    rng = np.random.default_rng((77, seed))
    T = box_centred_pose(rng)
    p, n = surface_points(bar, 750, rng)
    p = p[np.abs(n[:, 2]) < 0.1][:25]
    return touches_of(SE3.apply(T, p) + SD * rng.normal(size=p.shape), SD)


def spread_along(bar, touches, T):
    """Root mean square of the slide along the axis from a pose, by the posterior itself on a fine line [m]."""
    s = np.linspace(-0.02, 0.02, 2001)
    Ts = np.tile(np.eye(4), (len(s), 1, 1))
    Ts[:, 2, 3] = s
    log = log_posterior(touches, no_paths(), T @ Ts, np.zeros((len(s), 0)), bar, Priors(radius=bar.part.radius))
    w = np.exp(log - log.max())
    return float(np.sqrt(w @ s**2 / w.sum()))


@pytest.mark.parametrize("seed", [2, 8, 10, 13, 14, 19])
def test_a_bar_that_was_touched_around_its_side_is_not_said_to_be_located_along_it(bar, seed):
    """The curvature of the peak says 0.07 to 0.13 mm; the plain a nat or two below is millimetres wide."""
    touches = around_its_side(bar, seed)
    answer = identify_touches(touches, no_paths(), [bar])
    best = answer.hypotheses[0]
    assert answer.status == "recognized"
    stated, true = np.sqrt(best.covariance[2, 2]), spread_along(bar, touches, best.T_world_part)
    assert true > 2.5 * SD
    assert 0.7 < stated / true < 1.6
    assert best.worst_corner_sd > 0.7 * true


def test_the_same_in_another_frame(bar):
    """The plain leads along no axis of the coordinates."""
    touches, turn = around_its_side(bar, 14), SO3.exp(np.array([0.4, -0.8, 0.5]))
    first = identify_touches(touches, no_paths(), [bar]).hypotheses[0]
    other = touches_of(touches.points @ turn.T + 0.3, SD)
    second = identify_touches(other, no_paths(), [bar]).hypotheses[0]
    assert second.worst_corner_sd == pytest.approx(first.worst_corner_sd, rel=0.2)


@pytest.mark.parametrize("way", [np.array([1.0, 0, 0, 0, 0, 0]), np.array([0.6, 0, -0.8, 0, 0, 0])])
def test_moments_of_a_peak_on_a_plain_are_those_of_integration(way):
    """A density of known form: normal across, along one motion a peak of one on a plain 200 wide, three nats below."""
    across = np.eye(6) - np.outer(way, way)

    def log_density(Ts, z):
        x = SE3.log(Ts) * np.repeat([1e4, 1e4], 3)  # in standard deviations of the peak
        t, rest = x @ way, x @ across
        plain = np.where((t > -20) & (t < 180), np.exp(-3.0), 0.0)
        return np.log(np.exp(-0.5 * t * t) + plain + 1e-300) - 0.5 * np.sum(rest * rest, axis=1)

    t = np.linspace(-60, 220, 280_001)
    w = np.exp(-0.5 * t * t) + np.where((t > -20) & (t < 180), np.exp(-3.0), 0.0)
    information = 1e8 * np.eye(6)
    found = posterior_moments(log_density, np.eye(4), np.zeros(0), information, 1e8 * np.outer(way, way))
    assert found is not None
    assert 1e4 * np.sqrt(way @ found.covariance @ way) == pytest.approx(np.sqrt(w @ t**2 / w.sum()), rel=0.15)
    assert found.log_mass == pytest.approx(np.log(w.sum() * (t[1] - t[0]) / np.sqrt(2 * np.pi)), abs=0.2)
    u = across[np.argmax(np.diag(across))] / np.linalg.norm(across[np.argmax(np.diag(across))])
    assert 1e4 * np.sqrt(u @ found.covariance @ u) == pytest.approx(1.0, rel=0.15)


def test_a_full_turn_is_no_plain():
    """A motion that leads all around comes back to the peak: that is no second place, and no part of its spread."""
    sd = np.r_[1e-3 * np.ones(3), 2 * np.pi / 64 * np.ones(3)]

    def log_density(Ts, z):
        x = SE3.log(Ts)
        turn = np.linalg.norm(x[:, 3:], axis=1)
        log = -0.5 * np.sum((x[:, :3] / sd[:3]) ** 2, axis=1) - (1 - np.cos(turn)) / sd[3] ** 2
        return np.where(x[:, 0] >= 0, log, -np.inf)

    brittle = np.diag(np.r_[np.zeros(5), 1 / sd[5] ** 2])
    found = posterior_moments(log_density, np.eye(4), np.zeros(0), np.diag(1 / sd**2), brittle)
    assert found.log_mass == pytest.approx(np.log(0.5), abs=0.1)
    np.testing.assert_allclose(np.diag(found.covariance) / sd**2, 1.0, rtol=0.2)


@pytest.mark.parametrize("seed", range(3))
def test_the_order_of_rough_touches_does_not_change_what_a_part_is_worth(seed):
    """With noise of a tenth of the part faces swap readings; the draws have to find the same mass each time."""
    parts = [prepare_target(read_part(EXAMPLES / f"{name}.step")) for name in ("step_12mm", "step_15mm")]
    rng = np.random.default_rng((5, seed))
    p, _ = surface_points(parts[0], 21, rng)
    points = SE3.apply(box_centred_pose(rng), p) + 3e-3 * rng.normal(size=p.shape)
    said = []
    for _ in range(4):
        answer = identify_touches(touches_of(points[rng.permutation(21)], 3e-3), no_paths(), parts)
        said.append([sum(h.probability for h in answer.hypotheses if h.part == t.part.name) for t in parts])
    np.testing.assert_allclose(said, said[:1] * 4, atol=0.05)
