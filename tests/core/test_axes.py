"""Centres of circles and spheres, apexes of cones: the core against the oracle, gradients against differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.bodies import flat_bodies
from core.questions import anisotropic, near_pose, point_question, random_pose, with_shared
from core.test_oracle import agree
from core.test_slopes import off

SD = 5e-4


def _body(rng):
    """Return a body with random axes of holes, spheres and cones: ends, sizes, weight, side, number, kind."""
    n = 12
    ends = rng.uniform(-0.02, 0.02, size=(n, 6))
    radii = np.sort(rng.uniform(2e-3, 6e-3, size=(n, 2)), axis=1)
    radii[::2, 1] = radii[::2, 0]
    sides, kinds = np.tile([1.0, -1.0], n // 2), np.repeat([3, 5, 6], n // 3)
    body = flat_bodies()["bracket"]
    return replace(body, axes=np.column_stack([ends, radii, np.full(n, 3 / n), sides, np.arange(n) // 2, kinds]))


def _centres(body, rng, n=12):
    """Return centres near the axes, with their axes, radii and sides, some of each not stated."""
    T, rows = random_pose(rng), rng.integers(len(body.axes), size=n)
    a, b = body.axes[rows, :3], body.axes[rows, 3:6]
    lines = body.axes[rows, 11:] == 3
    beside = (body.axes[rows, 11] == 6) * rng.uniform(0, 3e-3, size=n)
    p = a + lines * rng.uniform(-0.05, 1.05, size=(n, 1)) * (b - a) + SD * rng.normal(size=(n, 3))
    p += beside[:, None] * (b - a) / np.linalg.norm(b - a, axis=1)[:, None]
    ways = np.where(lines, rng.choice([-1, 1], size=(n, 1)), 1)
    m = (b - a) / np.linalg.norm(b - a, axis=1)[:, None] * ways + 0.1 * rng.normal(size=(n, 3))
    m = m / np.linalg.norm(m, axis=1)[:, None] * rng.choice([0, 1], size=(n, 1))
    radii = rng.choice([0, 1], size=n) * (body.axes[rows, 6:8].mean(axis=1) + 3e-4 * rng.normal(size=n))
    circles = np.column_stack([radii, np.full(n, 4e-4), rng.choice([0, 1], size=n) * body.axes[rows, 9]])
    q = replace(
        point_question(p @ T[:3, :3].T + T[:3, 3], SD), kinds=body.axes[rows, 11].astype(np.int32), circles=circles,
        normals=m @ T[:3, :3].T, normal_sds=np.full(n, 0.1), radii=beside,
    )  # fmt: skip
    return q, np.stack([near_pose(T, rng, 2e-4, 5e-3) for _ in range(3)])


MAKES = {
    "plain": lambda q, rng: q,
    "uneven": anisotropic,
    "shared": lambda q, rng: with_shared(q, 2, rng),
    "scale": lambda q, rng: replace(q, scale_sd=0.3),
}


@pytest.mark.parametrize("make", MAKES)
@pytest.mark.parametrize("seed", range(3))
def test_centres_agree_with_the_oracle(make, seed):
    rng = np.random.default_rng(seed)
    body = _body(rng)
    q, Ts = _centres(body, rng)
    q = MAKES[make](q, rng)
    agree(body, q, Ts, 0.3 * rng.normal(size=(len(Ts), q.states)))


@pytest.mark.parametrize("make", ["plain", "shared", "scale"])
def test_the_gradient_is_exact_for_centres(make):
    rng = np.random.default_rng(4)
    body = _body(rng)
    q, Ts = _centres(body, rng)
    q = MAKES[make](q, rng)
    assert off(body, q, Ts, 0.3 * rng.normal(size=(len(Ts), q.states))).max() < 1e-4
