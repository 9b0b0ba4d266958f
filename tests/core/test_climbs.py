"""Maximizations, marginals, small motions and mixtures of the core, against what they have to be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import multivariate_t

from core.bodies import flat_bodies
from core.questions import near_pose, oriented, point_question, random_pose, touched, with_shared
from core.test_slopes import differences, scene
from tanteo import _core

FLAT = flat_bodies()
NO_BLUR = np.zeros(0)


def maximized(body, q, Ts, zs, steps=60, enough=1e-9):
    return _core.maximize(body.shape(), q.core(), Ts, zs, NO_BLUR, steps, enough, 1e6)


@pytest.mark.parametrize("kind", ["points", "normals", "shared"])
@pytest.mark.parametrize("name", FLAT)
def test_a_climb_never_ends_lower(name, kind):
    make = {
        "points": lambda q, normals, rng: q,
        "normals": lambda q, normals, rng: oriented(q, normals, rng),
        "shared": lambda q, normals, rng: with_shared(q, 3, rng),
    }[kind]
    body = FLAT[name]
    q, Ts, zs = scene(body, 7, make)
    before = _core.log_densities(body.shape(), q.core(), Ts, zs)
    last = before
    for steps in (1, 2, 5, 20):
        _, _, logs, *_, rows = maximized(body, q, Ts, zs, steps)
        assert np.array_equal(rows, np.arange(len(Ts)))
        assert np.all(logs >= last - 1e-9)
        last = logs
    assert np.all(last > before)


@pytest.mark.parametrize("n", [7, 12, 40])
def test_the_noise_scale_at_a_maximum_is_not_too_small(n):
    """Six of the residuals' degrees of freedom are the pose's: the joint maximum would have it too small."""
    body, sd, found = FLAT["bracket"], 3e-4, []
    for seed in range(60):
        rng = np.random.default_rng((11, n, seed))
        T = random_pose(rng)
        p, _ = body.surface_points(n, rng)
        q = replace(point_question((p + sd * rng.normal(size=p.shape)) @ T[:3, :3].T + T[:3, 3], sd), scale_sd=1.0)
        _, zs, *_ = maximized(body, q, T[None], np.zeros((1, 1)))
        found.append(zs[0, 0])
    assert abs(np.mean(found)) < 4 * np.std(found) / np.sqrt(60) + 0.1


@pytest.mark.parametrize("name", FLAT)
def test_a_climb_ends_where_the_density_is_flat(name):
    body, rng = FLAT[name], np.random.default_rng(2)
    T = random_pose(rng)
    q, _ = touched(body, T, 30, 3e-4, rng, outliers=0.0)
    Ts = np.stack([near_pose(T, rng, 2e-4, 4e-3) for _ in range(8)])
    Ts, zs, logs, information, *_ = maximized(body, q, Ts, np.zeros((8, 0)))
    gradient = differences(body.shape(), q.core(), Ts, zs)
    gain = np.einsum("si,sij,sj->s", gradient, np.linalg.inv(information), gradient)
    assert np.median(gain) < 1e-6
    assert logs == pytest.approx(_core.log_densities(body.shape(), q.core(), Ts, zs), abs=1e-12)


def test_climbs_far_below_the_best_are_stopped():
    body, rng = FLAT["block"], np.random.default_rng(3)
    T = random_pose(rng)
    q, _ = touched(body, T, 20, 3e-4, rng)
    far = near_pose(T, rng, 0.5, 1.0)
    *_, rows = _core.maximize(body.shape(), q.core(), np.stack([far, T]), np.zeros((2, 0)), NO_BLUR, 20, 1e-3, 30.0)
    assert list(rows) == [1]


def test_starts_that_lead_to_one_maximum_are_climbed_once():
    body, rng = FLAT["block"], np.random.default_rng(3)
    T = random_pose(rng)
    q, _ = touched(body, T, 20, 2e-3, rng, outliers=0.0)
    Ts = np.stack([near_pose(T, rng, 1e-3, 0.01) for _ in range(8)])
    every = maximized(body, q, Ts, np.zeros((8, 0)))[2]
    _, _, logs, _, who, rows = _core.maximize(
        body.shape(), q.core(), Ts, np.zeros((8, 0)), NO_BLUR, 60, 1e-9, 1e6, near=1.0
    )
    assert len(every) == 8
    assert len(logs) == len(rows) < 8
    assert logs.max() == pytest.approx(every.max(), abs=1e-6)
    np.testing.assert_array_equal(who[rows], np.arange(len(rows)))
    assert (who >= 0).all()


@pytest.mark.parametrize("D", [1, 2])
def test_marginals_are_the_integral_over_shared_errors(D):
    """Laplace's method against a grid: exact but for outliers and ends of faces."""
    body, rng = FLAT["block"], np.random.default_rng(D)
    T = random_pose(rng)
    q, _ = touched(body, T, 20, 2e-4, rng, edgy=0.0, outliers=0.0)
    q = with_shared(q, D, rng, size=4e-4)
    shape, core = body.shape(), q.core()
    log, best = _core.marginals(shape, core, T[None], np.zeros((1, D)))
    axis = np.linspace(-3, 3, 241)
    grid = np.stack(np.meshgrid(*[axis] * D, indexing="ij"), axis=-1).reshape(-1, D) + best
    values = _core.log_densities(shape, core, np.tile(T, (len(grid), 1, 1)), np.ascontiguousarray(grid))
    cell = (axis[1] - axis[0]) ** D / (2 * np.pi) ** (D / 2)
    assert log[0] == pytest.approx(np.logaddexp.reduce(values) + np.log(cell), abs=0.05)
    assert values.max() == pytest.approx(_core.log_densities(shape, core, T[None], best)[0], abs=2e-3)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-7, 1e-5, 0.3, 2.0, np.pi - 1e-3, np.pi - 1e-5, np.pi - 1e-8])
def test_place_and_offsets_are_inverse(angle):
    rng = np.random.default_rng(0)
    axes = np.concatenate([np.eye(3), -np.eye(3), rng.normal(size=(20, 3))])
    w = angle * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    x, T, centre = np.hstack([rng.normal(size=w.shape), w]), random_pose(rng), rng.normal(size=3)
    Ts = _core.place(np.tile(T, (len(x), 1, 1)), x, centre)
    assert _core.offsets(T, Ts, centre) == pytest.approx(x, abs=1e-7 if angle > 3.14 else 1e-13)
    assert _core.place(np.tile(T, (len(x), 1, 1)), _core.offsets(T, Ts, centre), centre) == pytest.approx(Ts, abs=1e-12)
    assert Ts[:, :3, :3] == pytest.approx(T[:3, :3] @ Rotation.from_rotvec(w).as_matrix(), abs=1e-12)
    moved = np.einsum("nij,j->ni", Ts[:, :3, :3], centre) + Ts[:, :3, 3]
    assert moved == pytest.approx((centre + x[:, :3]) @ T[:3, :3].T + T[:3, 3], abs=1e-12)


def test_a_half_turn_is_one_of_its_two_vectors():
    for axis in np.eye(3):
        T = np.eye(4)
        T[:3, :3] = Rotation.from_rotvec(np.pi * axis).as_matrix()
        x = _core.offsets(np.eye(4), T[None], np.zeros(3))[0, 3:]
        assert np.abs(x) == pytest.approx(np.pi * axis, abs=1e-7)


def components(rng, spread):
    """Two bases, three components of one and one of the other, whose narrow directions bend along two others."""
    bases = np.stack([np.eye(4), near_pose(np.eye(4), rng, 0.5 * spread, 0.3)])
    owners = np.array([0, 0, 0, 1], np.int32)
    bends = np.zeros((2, 6, 6, 6))
    bends[np.ix_([1], [0, 1, 3, 4], [2, 5], [2, 5])] = rng.normal(size=(1, 4, 2, 2))
    means = spread * rng.normal(size=(4, 6)) * 0.3
    A = spread * rng.normal(size=(4, 6, 6)) * 0.3
    covs = A @ np.swapaxes(A, 1, 2) + (0.3 * spread) ** 2 * np.eye(6)
    return bases, bends, owners, means, covs, np.log(rng.dirichlet(np.ones(4)))


def mixed(Ts, bases, bends, owners, means, covs, log_weights, freedom, centre):
    L = np.linalg.cholesky(covs)
    log = log_weights - np.log(np.diagonal(L, axis1=1, axis2=2)).sum(axis=1)
    poses, inverse = np.ascontiguousarray(Ts), np.linalg.inv(L)
    return _core.mixture(poses, bases[owners], bends[owners], owners, 2, means, inverse, log, freedom, centre)


def test_the_mixture_is_one_of_student_densities():
    rng, centre = np.random.default_rng(1), np.array([0.02, -0.01, 0.03])
    bases, bends, owners, means, covs, log_w = components(rng, 0.4)
    Ts = np.stack([near_pose(np.eye(4), rng, 0.3, 0.4) for _ in range(50)])
    logs, shares = mixed(Ts, bases, bends, owners, means, covs, log_w, 4.0, centre)
    expected = np.zeros((50, 2))
    for k, owner in enumerate(owners):
        x = _core.offsets(bases[owner], Ts, centre)
        angle = np.linalg.norm(x[:, 3:], axis=1)
        tangent = angle**2 / (2 * (1 - np.cos(angle)))
        x -= np.einsum("ijk,nj,nk->ni", bends[owner], x, x)
        expected[:, owner] += np.exp(log_w[k]) * multivariate_t(means[k], covs[k], df=4).pdf(x) * tangent
    assert logs == pytest.approx(np.log(expected.sum(axis=1)), abs=1e-9)
    assert shares == pytest.approx(expected / expected.sum(axis=1, keepdims=True), abs=1e-9)


def test_the_mixture_integrates_to_one():
    """Over shifts and turns, by samples from a wider density."""
    rng, centre = np.random.default_rng(2), np.zeros(3)
    parts, n, wide = components(rng, 0.15), 40000, 0.35
    x = wide * rng.standard_t(4, size=(n, 6))
    x = x[np.linalg.norm(x[:, 3:], axis=1) < np.pi]
    logs, _ = mixed(_core.place(np.tile(np.eye(4), (len(x), 1, 1)), x, centre), *parts, 4.0, centre)
    from scipy.stats import t

    angle = np.linalg.norm(x[:, 3:], axis=1)
    log_q = t.logpdf(x, 4, scale=wide).sum(axis=1) + np.log(angle**2 / (2 * (1 - np.cos(angle))))
    weights = np.exp(logs - log_q)
    assert weights.sum() / n == pytest.approx(1, abs=4 * weights.std() / np.sqrt(n) + 0.01)


def test_distinct_keeps_the_first_of_what_is_near():
    rng = np.random.default_rng(3)
    Ts = np.stack([near_pose(np.eye(4), rng, 0.02, 0.05) for _ in range(60)])
    information = np.tile(np.diag([1e4] * 3 + [1e3] * 3), (60, 1, 1))
    kept, who = _core.distinct(Ts, information, 4.0, 1000, np.zeros(3))
    gaps = np.stack([_core.offsets(T, Ts, np.zeros(3)) for T in Ts])
    q = np.einsum("kni,kij,knj->kn", gaps, information, gaps)
    expected = []
    for k in range(60):
        if not any(q[other, k] < 4 for other in expected):
            expected.append(k)
    assert list(kept) == expected
    assert np.all(q[kept[who], np.arange(60)] < 4)
    few, who = _core.distinct(Ts, information, 4.0, 3, np.zeros(3))
    assert list(few) == expected[:3]
    assert set(who) == {-1, 0, 1, 2}


def test_distinct_counts_symmetric_images_as_one():
    rng, centre = np.random.default_rng(5), np.array([0.01, 0.02, 0.0])
    turns = np.stack([np.eye(4), np.diag([-1.0, -1.0, 1.0, 1.0]), np.diag([1.0, -1.0, -1.0, 1.0])])
    turns[1:, :3, 3] = rng.normal(size=(2, 3))
    Ts = np.stack([near_pose(np.eye(4), rng, 0.5, 0.05) for _ in range(3)])
    both = np.concatenate([Ts, Ts @ np.linalg.inv(turns[1]), Ts @ np.linalg.inv(turns[2])])
    information = np.tile(np.diag([1e4] * 3 + [1e3] * 3), (9, 1, 1))
    kept, who = _core.distinct(both, information, 4.0, 1000, centre, turns)
    assert (list(kept), list(who)) == ([0, 1, 2], [0, 1, 2] * 3)
    assert len(_core.distinct(both, information, 4.0, 1000, centre)[0]) == 9


def test_a_question_without_readings_is_the_prior():
    q = replace(
        point_question(np.zeros((0, 3)), 1.0),
        prior_means=np.eye(4)[None],
        prior_roots=np.eye(6)[None],
        prior_log_weights=np.zeros(1),
    )
    T = _core.place(np.eye(4)[None], np.array([[1.0, 0, 0, 0, 0, 0]]), np.zeros(3))
    assert _core.log_densities(FLAT["block"].shape(), q.core(), T, np.zeros((1, 0)))[0] == pytest.approx(-0.5)
