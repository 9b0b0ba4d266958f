"""Moments of posteriors that are not normal, against what is known of them."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.lie import SE3
from tanteo.surface_search.moments import posterior_moments

SCALE = np.array([1e-3, 2e-3, 5e-4, 0.01, 0.02, 0.005])
NO_SHARED = np.zeros(0)


def as_density(f):
    """A log density of standardised coordinates as one of poses."""
    return lambda Ts, z: f(np.concatenate([SE3.log(Ts) / SCALE, z], axis=1))


def moments(f, d=6):
    information = np.diag(np.r_[1 / SCALE**2, np.ones(d - 6)])
    return posterior_moments(as_density(f), np.eye(4), np.zeros(d - 6), information)


def test_a_normal_posterior_needs_no_draws():
    assert moments(lambda x: -0.5 * np.sum(x * x, axis=1)) is None


def test_half_of_a_normal_posterior():
    found = moments(lambda x: np.where(x[:, 1] >= 0, -0.5 * np.sum(x * x, axis=1), -np.inf))
    assert found.mean[1] / SCALE[1] == pytest.approx(np.sqrt(2 / np.pi), abs=0.1)
    assert found.covariance[1, 1] / SCALE[1] ** 2 == pytest.approx(1.0, rel=0.2)
    assert (found.covariance[1, 1] - found.mean[1] ** 2) / SCALE[1] ** 2 == pytest.approx(1 - 2 / np.pi, rel=0.2)
    assert found.log_mass == pytest.approx(np.log(0.5), abs=0.1)
    others = [0, 2, 3, 4, 5]
    np.testing.assert_allclose(np.diag(found.covariance)[others] / SCALE[others] ** 2, 1.0, rtol=0.2)


def test_a_flat_direction_is_wider_than_its_peak_says():
    """A plateau with the curvature of a normal density at its middle only."""
    flat = lambda x: -0.5 * np.sum(x[:, 1:] ** 2, axis=1) - np.log1p(0.5 * x[:, 0] ** 2) - (np.abs(x[:, 0]) > 8) * 1e3  # noqa: E731
    found = moments(flat)
    grid = np.linspace(-8, 8, 20001)
    w = 1 / (1 + 0.5 * grid**2)
    assert found.covariance[0, 0] / SCALE[0] ** 2 == pytest.approx(np.sum(w * grid**2) / w.sum(), rel=0.2)
    mass = w.sum() * (grid[1] - grid[0]) / np.sqrt(2 * np.pi)
    assert found.log_mass == pytest.approx(np.log(mass), abs=0.15)


def test_shared_errors_that_are_known_leave_less():
    """The pose's first coordinate is the shared error and something of its own, cut at zero."""

    def f(x):
        own = x[:, 0] - 3 * x[:, 6]
        return np.where(x[:, 2] >= 0, -0.5 * (own**2 + np.sum(x[:, 1:] ** 2, axis=1)), -np.inf)

    information = np.diag(np.r_[1 / SCALE**2, 1.0])
    information[6, 6] += 9.0
    information[0, 6] = information[6, 0] = -3 / SCALE[0]
    found = posterior_moments(as_density(f), np.eye(4), np.zeros(1), information)
    assert found.covariance[0, 0] / SCALE[0] ** 2 == pytest.approx(10.0, rel=0.2)
    assert found.covariance_given_shared[0, 0] / SCALE[0] ** 2 == pytest.approx(1.0, rel=0.2)


def test_the_same_answer_every_time():
    f = lambda x: np.where(x[:, 1] >= 0, -0.5 * np.sum(x * x, axis=1), -np.inf)  # noqa: E731
    np.testing.assert_array_equal(moments(f).covariance, moments(f).covariance)


def test_directions_without_information_are_left_alone():
    information = np.diag(np.r_[1 / SCALE[:5] ** 2, 0.0])
    f = lambda x: np.where(x[:, 1] >= 0, -0.5 * np.sum(x[:, :5] ** 2, axis=1), -np.inf)  # noqa: E731
    found = posterior_moments(as_density(f), np.eye(4), NO_SHARED, information)
    assert found.covariance[5, 5] < 1e-12
    assert found.covariance[1, 1] / SCALE[1] ** 2 == pytest.approx(1.0, rel=0.2)
