"""Samples beside a normal density: their use for a region, and nothing is lost where they are uninformative."""

from __future__ import annotations

import numpy as np
import pytest

from bare_scenes import box_centred_pose, no_paths, surface_points, touches_of
from tanteo.geometry import SE3
from tanteo.posterior import Priors, Problem, identify_points, part_search, prepare, weigh
from tanteo.posterior.sampling import peaks
from tanteo.posterior.sampling.control_variate import ControlVariate
from tanteo.posterior.sampling.modes import beyond_normal, covariance_of_samples, far_tail
from tanteo.posterior.sampling.sampler import Sampler
from tanteo.posterior.settings import Effort


def sample_prior(n, seed, bend=0.0, scale=1.0):
    """Return samples of a wide density with weights for a normal density of weight ``scale``, and a bent one."""
    rng = np.random.default_rng(seed)
    x = 1.5 * rng.normal(size=(n, 6))
    gaps = np.sum(x * x, axis=1)
    wide = -0.5 * gaps / 1.5**2 - 6 * np.log(1.5)
    normal = np.exp(-0.5 * gaps - wide) / n
    weights = scale * normal * np.exp(bend * np.tanh(x[:, 0]))
    factor = min(weights @ normal / (normal @ normal), 1.0)
    return ControlVariate(weights, factor * normal, factor, gaps)


def test_of_a_normal_region_the_mass_has_no_noise():
    region = sample_prior(64, 1)
    assert region.mass == pytest.approx(1.0, abs=1e-9)
    assert region.is_normal
    assert abs(region.weights.sum() - 1) > 0.02  # the samples by themselves do not know it so well


def test_mass_of_a_broad_region_is_right_and_less_noisy():
    exact = np.mean(np.exp(0.5 * np.tanh(np.random.default_rng(2).normal(size=400_000))))
    both = np.array([(r.mass, r.weights.sum()) for r in (sample_prior(200, (3, k), bend=0.5) for k in range(300))])
    off = both - exact
    sd = off.std(axis=0) / np.sqrt(len(off))
    assert abs(off[:, 0].mean()) < 4 * sd[0] + 0.005  # the factor is fitted to the same samples
    assert off[:, 0].std() < 0.8 * off[:, 1].std()


def test_a_far_tail_is_left_out_and_a_normal_density_is_not():
    rng = np.random.default_rng(6)
    x = rng.normal(size=(2000, 6))
    assert not far_tail(x, np.ones(2000)).any()
    x[:12, 2] = 1000 * rng.normal(size=12)
    tail = far_tail(x, np.ones(2000))
    assert tail[:12].sum() >= 11
    assert tail.sum() <= 50
    x[:400, 2] = 1000 * rng.normal(size=400)
    assert not far_tail(x, np.ones(2000)).any()  # a fifth of the probability is no tail


def test_a_region_of_another_mass_is_not_normal():
    assert not sample_prior(200, 4, scale=3.0).is_normal
    assert sample_prior(200, 4, scale=3.0).mass == pytest.approx(3.0, rel=0.25)


def test_effective_samples_give_the_accuracy_of_a_spread():
    """Of plain samples of a normal density as many as there are."""
    x = np.random.default_rng(5).normal(size=(4000, 6))
    plain = ControlVariate(np.full(4000, 1 / 4000), np.zeros(4000), 0.0, np.sum(x * x, axis=1))
    assert plain.ess == pytest.approx(4000, rel=0.1)


def test_few_samples_give_a_wider_and_never_flat_covariance():
    curved = np.diag([1e-6, 1e-6, 1e-6, 1e-4, 1e-4, 1e-4])
    assert np.trace(covariance_of_samples(curved, curved, 20, 0.05)) > 1.2 * np.trace(curved)
    assert np.trace(covariance_of_samples(curved, curved, 5000, 0.05)) == pytest.approx(np.trace(curved), rel=5e-3)
    assert np.linalg.eigvalsh(covariance_of_samples(np.zeros((6, 6)), curved, 1e6, 0.05)).min() > 0


def test_the_region_of_a_bent_ridge_holds_its_samples():
    rng = np.random.default_rng(6)
    x = rng.normal(size=(4000, 6))
    even = np.full(4000, 1.0)
    assert beyond_normal(x, even, np.eye(6)) == pytest.approx(1.0, abs=0.05)
    x[:, 1] = 3 * (x[:, 0] ** 2 - 1)
    C = np.cov(x.T)
    wider = beyond_normal(x, even, C)
    assert wider > 1.1
    inside = np.einsum("ni,ij,nj->n", x, np.linalg.inv(wider * C), x) < 12.592
    assert inside.mean() == pytest.approx(0.95, abs=0.005)


@pytest.mark.parametrize("shared", [0, 2])
@pytest.mark.parametrize("scale_sd", [0.0, 0.7])
def test_poses_at_which_nothing_is_touched_count_for_none(parts, shared, scale_sd):
    """They are as dense however far away: samples would find the more of them, the farther they are drawn."""
    target, rng = prepare(parts["bracket_left"]), np.random.default_rng(7)
    T = box_centred_pose(rng)
    shared_jacobian = 1e-3 * rng.normal(size=(6, 3, shared))
    touches = touches_of(SE3.apply(T, surface_points(target, 6, rng)[0]), 1e-4, shared_jacobian=shared_jacobian)
    problem = Problem(touches, no_paths(), Priors(radius=target.part.radius, noise_factor=float(np.exp(scale_sd))))
    objective = part_search.start_search(problem, target, rng).objective
    sampler = Sampler(objective, objective.maximize(T[None], fine=True), rng, 0.0)
    away = T @ SE3.exp(np.array([5.0, 0, 0, 0, 0, 0]))
    here, there = sampler.density.at(np.stack([T, away]), np.zeros((2, problem.states)))[0]
    assert there < here - 300
    assert there < -500


def test_parts_draw_the_same_numbers():
    a, b = part_search.common_random_numbers(np.random.default_rng(1), 2)
    np.testing.assert_array_equal(a.normal(size=9), b.normal(size=9))


def test_the_search_does_not_start_from_outliers():
    rng = np.random.default_rng(8)
    p = 0.05 * rng.normal(size=(1000, 3))
    p[::50] += rng.uniform(-5, 5, (20, 3))
    rows = peaks.spread_rows(touches_of(p, 1e-4), 12)
    assert len(set(rows.tolist())) == 12
    assert np.sum(rows % 50 == 0) <= 4
    few = peaks.spread_rows(touches_of(p[:9], 1e-4), 12)
    np.testing.assert_array_equal(few, np.arange(9))
    assert len(peaks.spread_rows(touches_of(p[:0], 1e-4), 12)) == 0


@pytest.mark.slow
def test_a_part_is_found_among_as_many_strays_as_are_expected(parts):
    """Up to a third of thirty touches is somewhere else, farther out than the part: they do not lead the search."""
    target, found = prepare(parts["bracket_left"]), 0
    for seed in range(8):
        rng = np.random.default_rng((81, seed))
        T, k = box_centred_pose(rng), int(rng.integers(6, 11))
        p, _ = surface_points(target, 30, rng)
        p = SE3.apply(T, p) + 1e-4 * rng.normal(size=p.shape)
        p[30 - k :] += rng.uniform(-0.05, 0.05, (k, 3))
        answer = identify_points(touches_of(p, 1e-4), no_paths(), [target], priors=Priors(outlier_rate=0.3), seed=seed)
        near = np.linalg.norm(SE3.log(SE3.inverse(answer.pose) @ T)[:3]) < 2e-3
        assert near or answer.status != "recognized"
        found += near
    assert found >= 7


def test_later_rounds_start_from_other_points(parts):
    target, rng = prepare(parts["block"]), np.random.default_rng(9)
    p, _ = surface_points(target, 40, rng)
    search = part_search.start_search(Problem(touches_of(p, 1e-4), no_paths(), Priors(radius=0.1)), target, rng)
    used = []
    for _ in range(3):
        search.restart(Effort(4, 10, 3, 4, 0, 10))
        used.append(set(search.objective.rows.tolist()))
        assert set(search.pairs.ravel().tolist()) <= used[-1]
    assert len(set.union(*used)) > 20


def test_a_density_that_samples_do_not_cover_is_no_control(parts):
    """Ends of faces cut a density far within its curvature: components are narrow, and their samples give the mass."""
    target, rng = prepare(parts["bracket_left"]), np.random.default_rng(7)
    p, normals = surface_points(target, 400, rng)
    rows = np.flatnonzero(np.abs(normals[:, 1]) < 0.3)[:14]  # nothing but the ends of faces stops a slide along y
    touches = touches_of(SE3.apply(box_centred_pose(rng), p[rows]) + 1e-4 * rng.normal(size=(14, 3)), 1e-4)
    search = part_search.start_search(
        Problem(touches, no_paths(), Priors(radius=target.part.radius)), target, np.random.default_rng(0)
    )
    search.restart()
    sampler = Sampler(search.objective, search.peaks.take(np.zeros(1, dtype=np.int64)), rng, 0.0)
    sampler.covariances *= 0.01
    sampler.sample(np.array([300]))
    top = float(sampler.log_weights.max())
    assert sampler.masses()[0][0] == pytest.approx(top + np.log(sampler.weights(top).sum()), abs=1e-6)


def test_an_improbable_part_has_few_samples(parts, monkeypatch):
    """A part of probability 5e-5 has many maxima near its best one; they are no reason to sample them all."""
    rng, counts = np.random.default_rng(12), {}
    right, improbable = (prepare(parts[name]) for name in ("bracket_left", "clamp"))
    p, _ = surface_points(right, 12, rng)
    problem = Problem(touches_of(p + 2e-3 * rng.normal(size=p.shape), 2e-3), no_paths(), Priors(radius=0.1))
    searches = [part_search.start_search(problem, part, np.random.default_rng(0)) for part in (right, improbable)]
    for search in searches:
        search.restart()
    draw = Sampler.sample

    def counted(self, n):
        counts[self.objective.prepared] = counts.get(self.objective.prepared, 0) + int(np.sum(n))
        draw(self, n)

    monkeypatch.setattr(Sampler, "sample", counted)
    first, second = (search.log_evidence for search in searches)
    weigh(problem, searches, np.array([0.0, first - second - 10]), -1e9, rng)
    assert len(searches[1].peaks) > 10
    assert counts[right] > 300
    assert 0 < counts[improbable] < 0.25 * counts[right]
