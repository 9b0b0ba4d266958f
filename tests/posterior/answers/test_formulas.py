"""Priors, and how parts move, against the same by other means: integrals and draws."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes import random_pose
from tanteo.fitting.localization import covariance_with_free
from tanteo.geometry import SE3, SO3
from tanteo.parts import read_part
from tanteo.posterior import PosePrior, Table
from tanteo.posterior.answers import (
    corner_sd,
    in_box,
    log_density_within,
    part_scale,
    prior_residuals,
    prior_rows,
    split_by_symmetry,
    symmetry_motions,
    where_to_sense,
    without_symmetry,
)

RADIUS = 0.2


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """A cylinder of 60 mm by 20 mm whose axis misses the origin."""
    steps = 96
    a = 2 * np.pi * np.arange(steps) / steps
    ring = 30 * np.c_[np.cos(a), np.sin(a)] + [50.0, -20.0]
    vertices = np.concatenate([np.c_[ring, 0 * a], np.c_[ring, 0 * a + 20], [[50, -20, 0], [50, -20, 20]]])
    i, j, n = np.arange(steps), np.roll(np.arange(steps), -1), np.full(steps, 2 * steps)
    ends = np.c_[n, j, i], np.c_[n + 1, steps + i, steps + j]
    triangles = [np.c_[i, j, steps + j], np.c_[i, steps + j, steps + i], *ends]
    lines = ["OFF", f"{len(vertices)} {4 * steps} 0", *(" ".join(map(str, v)) for v in vertices.tolist())]
    lines += [f"3 {p} {q} {r}" for p, q, r in np.concatenate(triangles).tolist()]
    path = tmp_path_factory.mktemp("wheel") / "wheel.off"
    path.write_text("\n".join(lines) + "\n")
    part = read_part(path, unit="mm")
    assert part.symmetry.continuous
    return part


def turned_about(part, angle):
    """Return the rotation of the part about its own axis, as a motion of its frame."""
    point, axis = part.symmetry.axis
    return SE3.exp(angle * np.r_[np.cross(point, axis), axis])


def anyhow(rng, n):
    """Even attitudes at the origin ``(n, 4, 4)``."""
    return SE3.from_parts(SO3.from_quaternion(rng.normal(size=(n, 4))), np.zeros((n, 3)))


@pytest.mark.parametrize("kind", ["near", "table", "box"])
def test_what_is_known_of_a_pose_is_a_density(parts, kind):
    """Its mean over anywhere is one, all equivalent poses of a symmetric part counted."""
    part, rng = parts["block"], np.random.default_rng(2)
    T0 = random_pose(rng)
    sds = np.r_[np.full(3, 4e-3), np.full(3, 0.03)]
    reach = 4 * sds
    prior = {
        "near": PosePrior(T0, np.diag(sds**2)),
        "table": PosePrior(table=Table(T0[:3, 3], np.array([0.2, -0.3, 0.9]), 3e-3)),
        "box": PosePrior(box=SE3.apply(T0, part.centroid) + 5e-3 * np.array([[-1, -1, -2], [1, 1, 2]])),
    }[kind]
    n = 100_000
    if kind == "near":  # anywhere else it is next to nothing
        e = rng.uniform(-reach, reach, size=(n, 6))
        Ts, share = T0 @ SE3.exp(e), np.prod(2 * reach) / ((2 * RADIUS) ** 3 * 8 * np.pi**2)
    elif kind == "table":
        n = 4_000
        Ts = anyhow(rng, n)
        normal = prior.table.normal
        heights = ((part.vertices @ np.swapaxes(Ts[:, :3, :3], 1, 2)) @ normal).min(axis=1)
        place = rng.uniform(-0.02, 0.02, n)  # along the normal, about where it would lie
        Ts[:, :3, 3] = prior.table.point + (place - heights)[:, None] * normal
        share = 0.04 / (2 * RADIUS)
    else:
        Ts = anyhow(rng, 40_000)
        centre = SE3.apply(T0, part.centroid) + rng.uniform(-0.02, 0.02, (len(Ts), 3))
        Ts[:, :3, 3] = centre - np.einsum("sij,j->si", Ts[:, :3, :3], part.centroid)
        share = 0.04**3 / (2 * RADIUS) ** 3
    r = prior_rows(prior, part, Ts)[0]
    within = in_box(prior, part, Ts) * np.exp(log_density_within(prior, RADIUS))
    density = within * np.exp(-0.5 * np.sum(r * r, axis=1))
    assert density.mean() * share == pytest.approx(1, abs=5 * density.std() * share / np.sqrt(len(Ts)))


def test_the_spin_of_a_round_part_is_no_error(wheel):
    known = np.diag(np.r_[np.full(3, 1e-4), np.full(3, 2e-3)]) ** 2
    information = without_symmetry(wheel, np.linalg.inv(known))
    scale = part_scale(wheel)
    spin = symmetry_motions(wheel)[0]
    assert np.abs(information @ scale @ spin).max() < 1e-6 * np.abs(information).max()
    left, rest = split_by_symmetry(wheel, spin[None], covariance_with_free(information, spin[None], scale))
    assert left.shape == (0, 6)
    # the rest is the information across the spin
    rest_of = np.linalg.svd(spin[None])[2][1:]
    across, dual = rest_of @ scale.T, rest_of @ np.linalg.inv(scale)  # five motions, in metres and radians
    expected = np.linalg.inv(across @ information @ across.T)
    np.testing.assert_allclose(dual @ rest @ dual.T, expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max())
    assert abs(spin @ np.linalg.solve(scale, np.linalg.solve(scale, rest).T) @ spin) < 1e-3
    free = np.eye(6)[:1]
    covariance = covariance_with_free(information, np.concatenate([spin[None], free]), scale)
    np.testing.assert_array_equal(split_by_symmetry(wheel, free, covariance)[0], free)


def test_the_worst_corner_is_that_of_draws(parts):
    part, rng = parts["wedge"], np.random.default_rng(4)
    A = rng.normal(size=(6, 6)) * np.r_[np.full(3, 1e-4), np.full(3, 1e-3)][:, None]
    corners = np.stack(np.meshgrid(*part.box.T), axis=-1).reshape(8, 3)
    moved = SE3.apply(SE3.exp(rng.multivariate_normal(np.zeros(6), A @ A.T, 40_000))[:, None], corners) - corners
    spread = max(np.linalg.eigvalsh(np.cov(moved[:, k].T))[-1] for k in range(8))
    assert corner_sd(part, A @ A.T) == pytest.approx(np.sqrt(spread), rel=0.02)


def test_a_free_slide_is_resisted_by_a_face_across_it(parts):
    part = parts["block"]
    for axis in range(3):
        words = where_to_sense(part, np.eye(4), np.eye(6)[axis])
        face = next(f for f in part.faces if f"sense {f.name} of block" in words)
        assert abs(face.axis_direction[axis]) == pytest.approx(1)


def test_residuals_of_a_prior_are_those_of_its_rows():
    part = read_part(Path(__file__).parents[3] / "examples" / "parts" / "wedge.step")
    Ts = SE3.exp(0.1 * np.random.default_rng(4).normal(size=(5, 6)))
    for prior in (
        PosePrior(np.eye(4), np.eye(6)),
        PosePrior(table=Table(np.zeros(3), np.array([0.0, 0, 1]), 1e-3)),
        PosePrior(Ts, np.tile(np.eye(6), (5, 1, 1))),
        PosePrior(box=np.array([[-1.0, -1, -1], [1, 1, 1]])),
    ):
        np.testing.assert_array_equal(prior_residuals(prior, part, Ts), prior_rows(prior, part, Ts)[0])
