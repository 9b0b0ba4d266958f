"""Gradients against differences, information against what it has to be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.bodies import flat_bodies, round_bodies
from core.questions import (
    anisotropic,
    directed,
    furnished,
    near_pose,
    oriented,
    random_pose,
    touched,
    with_amounts,
    with_prior,
    with_shared,
)
from core.test_oracle import KINDS, posed
from tanteo import _core

FLAT = flat_bodies()
BODIES = {**FLAT, **round_bodies()}


def differences(shape, core, Ts, zs, step=1e-6):
    """Central ones of the log density, by shifts and turns about the centre and by the other states."""
    S, K = len(Ts), 6 + zs.shape[1]
    out = np.zeros((S, K))
    for k in range(K):
        h = step * (shape.diagonal if k < 3 else 1)
        x, dz = np.zeros((S, 6)), np.zeros_like(zs)
        if k < 6:
            x[:, k] = h
        else:
            dz[:, k - 6] = h
        there, back = (_core.place(Ts, sign * x, shape.centre) for sign in (1, -1))
        gain = _core.log_densities(shape, core, there, zs + dz) - _core.log_densities(shape, core, back, zs - dz)
        out[:, k] = gain / (2 * h)
    return out


def off(body, q, Ts, zs, keep=slice(None)):
    """Errors of the gradient in standard deviations of the states, as the information has them."""
    shape, core = body.shape(), q.core()
    _, gradient, information = _core.slopes(shape, core, Ts, zs)
    sd = 1 / np.sqrt(np.maximum(np.einsum("sii->si", information), 1 / shape.diagonal**2))
    error = np.abs(gradient - differences(shape, core, Ts, zs)) * sd
    return error[:, keep]


def scene(body, seed, make=lambda q, normals, rng: q, n=15, poses=6):
    rng = np.random.default_rng(seed)
    T = random_pose(rng)
    q, normals = touched(body, T, n, 1e-3, rng)
    q = make(q, normals, rng)
    Ts = np.stack([near_pose(T, rng, 5e-4, 1e-2) for _ in range(poses)])
    return q, Ts, 0.5 * rng.normal(size=(poses, q.states))


EXACT = {
    "points": lambda q, normals, rng: q,
    "shared": lambda q, normals, rng: with_shared(q, 3, rng),
    "amounts": lambda q, normals, rng: with_amounts(q, rng),
    "labels": lambda q, normals, rng: replace(q, groups=rng.integers(-1, 3, len(q.points)).astype(np.int32)),
    "normals": lambda q, normals, rng: oriented(q, normals, rng),
    "furniture": lambda q, normals, rng: furnished(
        replace(q, groups=rng.integers(-1, 3, len(q.points)).astype(np.int32)), rng
    ),
    "scale": lambda q, normals, rng: replace(q, scale_sd=0.4),
    "scale and tolerance": lambda q, normals, rng: replace(q, scale_sd=0.4, extra=np.full(len(q.points), 5e-7)),
}


@pytest.mark.parametrize("kind", EXACT)
@pytest.mark.parametrize("name", FLAT)
def test_the_gradient_is_exact_on_flat_faces(name, kind):
    assert off(FLAT[name], *scene(FLAT[name], 1, EXACT[kind])).max() < 1e-4


@pytest.mark.parametrize("make", ["points", "scale"])
@pytest.mark.parametrize("kind", [1, 2], ids=["edges", "corners"])
def test_the_gradient_is_exact_on_edges_and_corners(kind, make):
    body, rng = FLAT["bracket"], np.random.default_rng(3)
    q, Ts, zs = scene(body, 2, EXACT[make])
    near = rng.choice(body.corners, size=len(q.points)) + 1e-3 * rng.normal(size=q.points.shape)
    q = replace(q, points=near @ Ts[0][:3, :3].T + Ts[0][:3, 3], kinds=np.full(len(q.points), kind, np.int32))
    assert off(body, q, Ts, zs).max() < 1e-4


@pytest.mark.parametrize("name", FLAT)
def test_shifts_are_exact_for_uneven_noise_and_beams(name):
    """A rotation of a part under uneven noise or a beam changes variances and cosines: the slope ignores that."""
    q, Ts, zs = scene(FLAT[name], 3, lambda q, normals, rng: directed(anisotropic(q, rng), normals, rng))
    assert off(FLAT[name], q, Ts, zs, slice(0, 3)).max() < 1e-4
    assert np.median(off(FLAT[name], q, Ts, zs, slice(3, 6))) < 0.5


@pytest.mark.parametrize("name", round_bodies())
def test_the_gradient_on_round_faces_is_nearly_right(name):
    """How facets share a point is taken as if the tangent plane did not turn."""
    error = off(BODIES[name], *scene(BODIES[name], 4, poses=12))
    assert np.median(error) < 0.05
    assert np.quantile(error, 0.95) < 0.5


def test_the_gradient_of_the_prior_is_that_of_its_logarithm():
    body, rng = FLAT["block"], np.random.default_rng(5)
    T = random_pose(rng)
    q, _ = touched(body, T, 1, 1e-3, rng)
    q = with_prior(replace(q, points=q.points + 1.0), T, rng, count=3, shift=0.02, turn=0.3)
    Ts = np.stack([near_pose(T, rng, 0.01, 0.2) for _ in range(8)])
    assert off(body, q, Ts, np.zeros((8, 0))).max() < 1e-5


@pytest.mark.parametrize("make", KINDS, ids=lambda f: f.__name__[1:])
@pytest.mark.parametrize("name", ["bracket", "cylinder"])
def test_the_information_is_symmetric_and_never_negative(name, make):
    q, Ts, zs = posed(BODIES[name], make, 6)
    logs, gradient, information = _core.slopes(BODIES[name].shape(), q.core(), Ts, zs)
    assert np.isfinite(gradient).all()
    assert np.array_equal(information, np.swapaxes(information, 1, 2))
    size = np.einsum("sii->s", information)
    assert np.all(np.linalg.eigvalsh(information)[:, 0] >= -1e-9 * size)
    assert logs == pytest.approx(_core.log_densities(BODIES[name].shape(), q.core(), Ts, zs), rel=1e-14)
