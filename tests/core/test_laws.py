"""What the log density does not depend on: frames, orders, names, and how a face is cut into triangles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.bodies import flat_bodies, round_bodies
from core.questions import (
    anisotropic,
    directed,
    near_pose,
    oriented,
    random_pose,
    touched,
    with_prior,
    with_rays,
    with_shared,
)
from tanteo import _core

FLAT = flat_bodies()
BODIES = {**FLAT, **round_bodies()}


def mixed_question(body, seed, *, n=20):
    """Everything at once, and poses."""
    rng = np.random.default_rng(seed)
    T = random_pose(rng)
    q, normals = touched(body, T, n, 1e-3, rng)
    q = oriented(directed(anisotropic(q, rng), normals, rng, free_reach=0.2), normals, rng)
    q = with_shared(with_rays(q, body, T, rng, slope=0.03), 2, rng)
    q = replace(q, groups=rng.integers(-1, 3, n).astype(np.int32), scale_sd=0.3)
    Ts = np.stack([near_pose(T, rng, s, 20 * s) for s in (0, 3e-4, 1e-3)])
    return q, Ts, rng.normal(size=(3, q.states))


def log_densities(body, q, Ts, zs):
    return _core.log_densities(body.shape(), q.core(), np.ascontiguousarray(Ts), zs)


def turned(q, W):
    """Return the same question in another frame of the world."""
    R, t = W[:3, :3], W[:3, 3]
    rays = q.rays.copy()
    rays[:, :3], rays[:, 3:6] = rays[:, :3] @ R.T + t, rays[:, 3:6] @ R.T
    table = np.r_[R @ q.table[:3] + t, R @ q.table[3:6], q.table[6:]] if len(q.table) else q.table
    return replace(
        q, points=q.points @ R.T + t, covs=R @ q.covs @ R.T, directions=q.directions @ R.T, normals=q.normals @ R.T,
        shared_jacobian=R @ q.shared_jacobian, rays=rays, ray_shifts=R @ q.ray_shifts,
        ray_turns=R @ q.ray_turns, table=table, prior_means=W @ q.prior_means,
    )  # fmt: skip


@pytest.mark.parametrize("name", BODIES)
def test_another_frame_of_the_world_changes_nothing(name):
    body, (q, Ts, zs), rng = BODIES[name], mixed_question(BODIES[name], 1), np.random.default_rng(9)
    q, W = with_prior(q, Ts[0], rng), random_pose(rng)
    expected = log_densities(body, q, Ts, zs)
    assert log_densities(body, turned(q, W), W @ Ts, zs) == pytest.approx(expected, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize("name", FLAT)
def test_another_frame_of_the_part_changes_nothing(name):
    body, (q, Ts, zs), rng = BODIES[name], mixed_question(BODIES[name], 2), np.random.default_rng(8)
    # rays that stand for a cone, or for what is beside a beam, and the margin at their ends depend on the frame
    rays = q.rays.copy()
    rays[:, 6:8] = 0.5, 0
    q = replace(q, rays=rays, free_reach=0 * q.free_reach)
    V = random_pose(rng)
    expected = log_densities(body, q, Ts, zs)
    # cuts depend on the frame: boxes are along its axes, and outlines in axes made from them
    assert log_densities(body.moved(V), q, Ts @ np.linalg.inv(V), zs) == pytest.approx(expected, rel=0, abs=2e-2)


@pytest.mark.parametrize("name", FLAT)
def test_without_cuts_the_frame_of_the_part_changes_nothing(name):
    body, rng = BODIES[name], np.random.default_rng(8)
    T, V = random_pose(rng), random_pose(rng)
    q, normals = touched(body, T, 20, 0.02, rng)  # noise so large that every edge and face is near
    q = oriented(anisotropic(q, rng), normals, rng)
    none = np.zeros((1, 0))
    expected = log_densities(body, q, T[None], none)
    assert log_densities(body.moved(V), q, (T @ np.linalg.inv(V))[None], none) == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize("name", BODIES)
def test_the_order_of_points_changes_nothing(name):
    body, (q, Ts, zs) = BODIES[name], mixed_question(BODIES[name], 3)
    order = np.random.default_rng(0).permutation(len(q.points))
    expected = log_densities(body, q, Ts, zs)
    assert log_densities(body, q.taken(order), Ts, zs) == pytest.approx(expected, rel=1e-10, abs=1e-10)


@pytest.mark.parametrize("name", FLAT)
def test_orders_and_names_of_the_mesh_change_nothing(name):
    body, (q, Ts, zs) = BODIES[name], mixed_question(BODIES[name], 4)
    other = body.shuffled(np.random.default_rng(1))
    assert log_densities(other, q, Ts, zs) == pytest.approx(log_densities(body, q, Ts, zs), rel=0, abs=1e-5)


@pytest.mark.parametrize("name", FLAT)
def test_split_triangles_change_nothing(name):
    body, (q, Ts, zs) = BODIES[name], mixed_question(BODIES[name], 5)
    expected = log_densities(body, q, Ts, zs)
    assert log_densities(body.split(), q, Ts, zs) == pytest.approx(expected, rel=0, abs=1e-5)


@pytest.mark.parametrize("name", FLAT)
def test_the_unit_changes_densities_only_by_its_size(name):
    """The same in micrometres: densities of points, one length each, are smaller by the same factor."""
    body, rng = BODIES[name], np.random.default_rng(6)
    T = random_pose(rng)
    q, _ = touched(body, T, 15, 1e-3, rng)
    s = 1e6
    small = replace(body, vertices=s * body.vertices, edges=s * body.edges, corners=s * body.corners)
    far = T.copy()
    far[:3, 3] *= s
    scaled = replace(q, points=s * q.points, covs=s**2 * q.covs, log_outlier=q.log_outlier - 3 * np.log(s))
    expected = log_densities(body, q, T[None], np.zeros((1, 0))) - 15 * 3 * np.log(s)
    assert log_densities(small, scaled, far[None], np.zeros((1, 0))) == pytest.approx(expected, rel=1e-9)
