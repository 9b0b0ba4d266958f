"""Lanes: every width gives the same bits, and their functions have the stated errors."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr, owens_t

from core.bodies import flat_bodies, round_bodies
from core.questions import WIDTHS, anisotropic, near_pose, oriented, per_width, random_pose, touched, with_shared
from tanteo import _core

BODIES = {**flat_bodies(), **round_bodies()}


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("kind", ["plain", "anisotropic", "oriented", "shared"])
def test_widths_give_the_same_bits(name, kind):
    rng = np.random.default_rng(7)
    T = random_pose(rng)
    q, normals = touched(BODIES[name], T, 15, 1e-3, rng)
    if kind == "anisotropic":
        q = anisotropic(q, rng)
    elif kind == "oriented":
        q = oriented(q, normals, rng)
    elif kind == "shared":
        q = with_shared(q, 2, rng)
    Ts = np.stack([near_pose(T, rng, 2e-3, 3e-2) for _ in range(20)])
    shape, core = BODIES[name].shape(), q.core()
    zs = np.zeros((len(Ts), core.size - 6))

    def answer():
        return [
            _core.log_densities(shape, core, Ts, zs),
            *_core.slopes(shape, core, Ts, zs),
            *_core.marginals(shape, core, Ts, zs),
            *_core.maximize(shape, core, Ts, zs, np.array([3e-3]), 10, 1e-3, 1e6),
        ]

    first, *others = per_width(answer)
    for other in others:
        for mine, theirs in zip(first, other, strict=True):
            np.testing.assert_array_equal(mine, theirs)


def test_narrow_lanes_are_always_there():
    assert WIDTHS[0] == 1
    assert sorted(set(WIDTHS)) == WIDTHS
    with pytest.raises(ValueError, match=r"width: expected one of lane_widths\(\), got 3\."):
        _core.set_lane_width(3)


def test_exponentials_have_the_stated_error():
    x = np.r_[np.linspace(-700, 700, 100_001), np.linspace(-1, 1, 10_001)]
    for found in per_width(lambda: _core.exponentials(x)):
        assert np.max(np.abs(found / np.exp(x) - 1)) < 1e-15
    assert _core.exponentials(np.array([-1e4]))[0] < 1e-307


def edges_of(rng, n=20_000):
    """Return edges of every kind: short and long ones, with no, one or two ends in reach."""
    h = np.abs(rng.normal(scale=2, size=n)) * (rng.random(n) < 0.95)
    length = 10 ** rng.uniform(-2, 2, n)
    t1 = np.where(rng.random(n) < 0.3, rng.uniform(-50, -5, n), rng.uniform(-6, 6, n))
    length[h == 0] += 0.1
    return np.column_stack([h, t1, t1 + length])


def test_edges_have_the_stated_error():
    edges = edges_of(np.random.default_rng(5))
    h, t1, t2 = edges.T
    positive = np.maximum(h, 1e-300)
    wedge = owens_t(h, t2 / positive) - owens_t(h, t1 / positive)
    density = np.exp(-0.5 * h**2) / np.sqrt(2 * np.pi)
    ends = density * (np.exp(-0.5 * t2**2) - np.exp(-0.5 * t1**2)) / np.sqrt(2 * np.pi)
    far = (t1 < -5) | (t2 > 5)  # such an end is at infinity
    for found in per_width(lambda: _core.edge_integrals(edges)):
        for mine, right in zip(found.T, (wedge, density * (ndtr(t2) - ndtr(t1)), ends), strict=True):
            assert np.max(np.abs(mine - right)[~far]) < 1e-10
            assert np.max(np.abs(mine - right)[far]) < 1e-6


def test_masses_of_half_planes_are_those_of_the_normal():
    h = np.linspace(0, 37, 3701)
    edges = np.column_stack([h, np.full_like(h, -60.0), np.full_like(h, 60.0)])
    for found in per_width(lambda: _core.edge_integrals(edges)):
        assert np.max(np.abs(found[:, 0] - ndtr(-h))) < 3e-16
        assert np.max(np.abs(found[h < 8, 0] / ndtr(-h[h < 8]) - 1)) < 2e-14
