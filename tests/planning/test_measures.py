"""Measures of a reading: laws, bounds, and simulation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import integrate

from tanteo import planning
from tanteo.errors import DegenerateError, InputError
from tanteo.geometry import SE3, SO3


def hypotheses(rng, n):
    w = rng.uniform(0.1, 1, n)
    return w / w.sum(), rng.normal(size=n) * 2, rng.uniform(0.2, 2, n)


def spd(rng, m):
    A = rng.normal(size=(m, m + 1))
    return A @ A.T


@pytest.mark.parametrize("n", [2, 5])
def test_information_lies_between_bounds_and_below_entropy(n):
    rng = np.random.default_rng(n)
    for _ in range(20):
        w, mu, var = hypotheses(rng, n)
        found = planning.measures.gate_discrimination(w, mu, var, 0.05)
        assert found.mi_lower <= found.mutual_information + 1e-12
        assert found.mutual_information <= min(found.mi_upper, -w @ np.log(w)) + 1e-12
        assert found.mi_lower >= 0


def test_mutual_information_agrees_with_adaptive_quadrature():
    w, mu, var = hypotheses(np.random.default_rng(3), 4)

    def integrand(y):
        p = np.exp(-0.5 * (y - mu) ** 2 / var) / np.sqrt(2 * np.pi * var)
        mix = w @ p
        return float(w @ (p * np.log(np.maximum(p, 1e-300) / np.maximum(mix, 1e-300))))

    wanted = integrate.quad(integrand, -30, 30, limit=400, epsabs=1e-12)[0]
    assert planning.measures.mutual_information(w, mu, var) == pytest.approx(wanted, rel=1e-9)


def test_panels_agree_with_the_trapezoid_rule():
    w, mu = np.array([0.6, 0.4]), np.array([0.0, 0.3])
    below, above = (
        planning.measures.mutual_information(w, mu, np.array([1.0, s**2])) for s in (1 / 64 - 1e-9, 1 / 64 + 1e-9)
    )
    assert above == pytest.approx(below, abs=1e-7)  # the slope by the sharpness is about 20
    sharp = planning.measures.mutual_information(w, mu, np.array([1.0, 1e-16]))
    entropy = -w @ np.log(w)
    assert sharp == pytest.approx(entropy, rel=1e-6)


def test_information_is_invariant_to_units():
    w, mu, var = hypotheses(np.random.default_rng(4), 5)
    one, other = (
        planning.measures.gate_discrimination(w, mu, var, 0.01),
        planning.measures.gate_discrimination(w, 1e-3 * mu + 7, 1e-6 * var, 0.01),
    )
    np.testing.assert_allclose(other.accept, one.accept, rtol=1e-9)
    for name in ("mutual_information", "mi_lower", "mi_upper", "expected_remaining", "error_bound"):
        assert getattr(other, name) == pytest.approx(getattr(one, name), rel=1e-9)
    same = planning.measures.gate_discrimination(w, 0 * mu, 0 * var + 1, 0.05)
    np.testing.assert_allclose([same.mutual_information, same.mi_lower, same.mi_upper], 0, atol=1e-14)
    assert same.expected_remaining == pytest.approx(5 * 0.95)


def test_far_hypotheses_have_full_information():
    w = np.array([0.5, 0.3, 0.2])
    found = planning.measures.gate_discrimination(w, np.array([0, 100.0, 1e4]), np.array([1.0, 1e-6, 1e-2]), 0.05)
    entropy = -w @ np.log(w)
    np.testing.assert_allclose([found.mutual_information, found.mi_lower, found.mi_upper], entropy, rtol=1e-12)
    assert found.expected_remaining == pytest.approx(0.95)
    assert found.error_bound < 1e-12


def test_accept_matrix_against_simulation():
    rng = np.random.default_rng(5)
    w, mu, var = hypotheses(rng, 4)
    found = planning.measures.gate_discrimination(w, mu, var, 0.05)
    n = 200_000
    truth = rng.choice(4, size=n, p=w)
    y = mu[truth] + np.sqrt(var[truth]) * rng.normal(size=n)
    kept = (y[:, None] - mu) ** 2 <= 3.841458820694124 * var
    np.testing.assert_allclose(kept.sum(axis=1).mean(), found.expected_remaining, rtol=5e-3)
    np.testing.assert_allclose([kept[truth == i].mean(axis=0) for i in range(4)], found.accept, atol=6e-3)
    np.testing.assert_allclose(np.diag(found.accept), 0.95)
    log_p = np.log(w) - 0.5 * (y[:, None] - mu) ** 2 / var - 0.5 * np.log(var)
    assert np.mean(log_p.argmax(axis=1) != truth) <= found.error_bound


def test_far_tails_of_the_accept_matrix_keep_their_digits():
    A = planning.measures.accept_matrix(np.array([0.0, 14.0]), np.ones(2), 0.05)
    assert A[0, 1] == pytest.approx(A[1, 0], rel=1e-12)
    assert 0 < A[0, 1] < 1e-30


@pytest.mark.parametrize("m", [1, 2, 4])
def test_divergences(m):
    rng = np.random.default_rng(m)
    m1, m2, S1, S2 = rng.normal(size=m), rng.normal(size=m), spd(rng, m), spd(rng, m)
    assert planning.measures.kl_divergence(m1, S1, m1, S1) == pytest.approx(0, abs=1e-12)
    assert planning.measures.bhattacharyya(m1, S1, m1, S1) == pytest.approx(0, abs=1e-12)
    B = planning.measures.bhattacharyya(m1, S1, m2, S2)
    assert pytest.approx(planning.measures.bhattacharyya(m2, S2, m1, S1)) == B
    assert 0 < 2 * B <= planning.measures.kl_divergence(m1, S1, m2, S2)
    x = m1 + rng.normal(size=(200_000, m)) @ np.linalg.cholesky(S1).T

    def log_p(x, mean, S):
        d = x - mean
        return -0.5 * np.einsum("ni,ij,nj->n", d, np.linalg.inv(S), d) - 0.5 * np.linalg.slogdet(S)[1]

    gap = log_p(x, m1, S1) - log_p(x, m2, S2)
    assert np.mean(gap) == pytest.approx(planning.measures.kl_divergence(m1, S1, m2, S2), abs=5 * gap.std() / 447)
    half = np.exp(-0.5 * gap)
    assert np.mean(half) == pytest.approx(np.exp(-B), abs=5 * half.std() / 447)
    batch = planning.measures.kl_divergence(
        np.stack([m1, m2]), np.stack([S1, S2]), np.stack([m2, m1]), np.stack([S2, S1])
    )
    assert batch[0] == pytest.approx(planning.measures.kl_divergence(m1, S1, m2, S2))


def test_accept_probability_against_simulation():
    rng = np.random.default_rng(6)
    S, delta = spd(rng, 3), np.array([1.0, -0.5, 0.7])
    found = planning.measures.accept_probability(delta, S, 0.05)
    y = rng.normal(size=(100_000, 3)) @ np.linalg.cholesky(S).T + delta
    D2 = np.einsum("ni,ij,nj->n", y, np.linalg.inv(S), y)
    assert np.mean(D2 <= 7.814727903251179) == pytest.approx(found.p, abs=6e-3)
    assert planning.measures.accept_probability(0 * delta, S, 0.05).p == pytest.approx(0.95)


def test_predicted_range_and_its_gradient():
    rng = np.random.default_rng(7)
    T, P = SE3.exp(rng.normal(size=6)), 1e-6 * spd(rng, 6)
    T_plane = SE3.exp(0.3 * rng.normal(size=6))
    origin = SE3.apply(T @ T_plane, np.array([0.01, 0.02, 0.3]))
    aim = SE3.apply(T @ T_plane, np.array([-0.02, 0.01, 0.0])) - origin
    beam = aim / np.linalg.norm(aim)
    found = planning.predictions.predict_range(T, P, T_plane, origin, beam, 1e-6)
    assert found.mean == pytest.approx(np.linalg.norm(aim))
    h = 1e-6
    for k, e in enumerate(np.eye(6)):
        ahead, back = (
            planning.predictions.predict_range(T @ SE3.exp(s * h * e), P, T_plane, origin, beam, 0).mean
            for s in (1, -1)
        )
        assert found.gradient[k] == pytest.approx((ahead - back) / (2 * h), abs=1e-6)
    draws = T @ SE3.exp(rng.multivariate_normal(np.zeros(6), P, size=20_000))
    ranges = planning.predictions.predict_range(draws, P, T_plane, origin, beam, 1e-6).mean
    assert ranges.var() + 1e-6 == pytest.approx(found.variance, rel=0.04)


def test_beams_along_the_plane_and_improper_inputs_are_refused():
    with pytest.raises(DegenerateError, match="parallel"):
        planning.predictions.predict_range(
            np.eye(4), np.eye(6), np.eye(4), np.array([0, 0, 1.0]), np.array([1.0, 0, 0]), 1.0
        )
    turned = SE3.from_parts(SO3.axis_rotation(1, np.pi), np.zeros(3))
    back = planning.predictions.predict_range(
        np.eye(4), np.eye(6), turned, np.array([0, 0, 1.0]), np.array([0, 0, 1.0]), 1.0
    )
    assert back.mean == -1
    with pytest.raises(InputError, match="sums to 1"):
        planning.measures.gate_discrimination(np.ones(2), np.zeros(2), np.ones(2), 0.05)
    with pytest.raises(InputError, match="positive"):
        planning.measures.gate_discrimination(np.ones(2) / 2, np.zeros(2), np.zeros(2), 0.05)
    with pytest.raises(InputError, match="significance"):
        planning.measures.gate_discrimination(np.ones(2) / 2, np.zeros(2), np.ones(2), 0.0)


def test_a_hypothesis_without_weight_does_not_count():
    w, mu, var = hypotheses(np.random.default_rng(8), 3)
    more = planning.measures.gate_discrimination(np.r_[w, 0], np.r_[mu, 50], np.r_[var, 1e-3], 0.05)
    less = planning.measures.gate_discrimination(w, mu, var, 0.05)
    for name in ("mutual_information", "mi_lower", "mi_upper", "error_bound"):
        assert getattr(more, name) == pytest.approx(getattr(less, name), rel=1e-12)
