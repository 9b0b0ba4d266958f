"""The compiled log density against plain NumPy, to 1e-9, over random questions of every kind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.bodies import flat_bodies, round_bodies, tent
from core.oracle import Oracle
from core.questions import (
    anisotropic,
    directed,
    furnished,
    near_pose,
    oriented,
    point_question,
    random_pose,
    sided,
    touched,
    with_prior,
    with_rays,
    with_shared,
)
from tanteo import _core

BODIES = {**flat_bodies(), **round_bodies()}
FLAT, ROUND = list(flat_bodies()), list(round_bodies())


def _plain(q, normals, body, T, rng):
    return q


def _anisotropic(q, normals, body, T, rng):
    return anisotropic(q, rng)


def _beams(q, normals, body, T, rng):
    return directed(q, normals, rng, free_reach=0.2)


def _blunt_beams(q, normals, body, T, rng):
    return directed(anisotropic(q, rng), normals, rng)


def _normals(q, normals, body, T, rng):
    return oriented(q, normals, rng)


def _uneven_normals(q, normals, body, T, rng):
    return oriented(directed(anisotropic(q, rng), normals, rng), normals, rng)


def _tips(q, normals, body, T, rng):
    return replace(q, radii=rng.uniform(0, 4e-3, len(q.points)), points=q.points + 2e-3 * normals)


def _uneven_tips(q, normals, body, T, rng):
    return anisotropic(_tips(q, normals, body, T, rng), rng)


def _labels(q, normals, body, T, rng):
    return replace(q, groups=rng.integers(-1, 4, len(q.points)).astype(np.int32))


def _labelled_beams(q, normals, body, T, rng):
    return _labels(directed(q, normals, rng), normals, body, T, rng)


def _labelled_sides(q, normals, body, T, rng):
    return _labels(sided(q, normals, rng), normals, body, T, rng)


def _shared(q, normals, body, T, rng):
    return replace(with_shared(with_rays(q, body, T, rng), 3, rng), one_sided=np.array([0, 1, 0], np.int32))


def _scale(q, normals, body, T, rng):
    return replace(with_shared(anisotropic(q, rng), 2, rng), scale_sd=0.4)


def _furnished(q, normals, body, T, rng):
    return furnished(q, rng)


def _labels_among_furniture(q, normals, body, T, rng):
    return furnished(_labels(q, normals, body, T, rng), rng)


def _rays(q, normals, body, T, rng):
    return with_rays(q, body, T, rng)


def _cones(q, normals, body, T, rng):
    return with_rays(q, body, T, rng, slope=0.05)


def _prior(q, normals, body, T, rng):
    return with_prior(q, T, rng)


KINDS = [
    _plain, _anisotropic, _beams, _blunt_beams, _normals, _uneven_normals, _tips, _uneven_tips, _labels,
    _labelled_beams, _labelled_sides, _shared, _scale, _furnished, _labels_among_furniture, _rays, _cones, _prior,
]  # fmt: skip
OF_FACES = [_plain, _anisotropic, _blunt_beams, _normals, _uneven_normals, _tips, _uneven_tips, _scale]


def posed(body, make, seed, *, sd=1e-3, n=10):
    """Return a question and poses near the truth with states."""
    rng = np.random.default_rng(seed)
    T = random_pose(rng)
    q, normals = touched(body, T, n, sd, rng)
    q = make(q, normals, body, T, rng)
    Ts = np.stack([near_pose(T, rng, s, 20 * s) for s in (0, 5e-4, 3e-3)])
    return q, Ts, rng.normal(size=(len(Ts), q.states))


def agree(body, q, Ts, zs):
    oracle = Oracle(body, q)
    got = _core.log_densities(body.shape(), q.core(), Ts, zs)
    for T, z, log in zip(Ts, zs, got, strict=True):
        least = most = oracle.log_density(T, z)
        if abs(log - least) > 1e-9 * abs(least):
            most = oracle.boxless().log_density(T, z)
        assert most - least < 0.5  # of points that are six standard deviations away and more
        assert log == pytest.approx(np.clip(log, least, most), rel=1e-9, abs=1e-9)


@pytest.mark.quick_sets(18)
@pytest.mark.parametrize("make", KINDS, ids=lambda f: f.__name__[1:])
@pytest.mark.parametrize("name", FLAT)
def test_flat_faces_agree_with_the_oracle(name, make):
    agree(BODIES[name], *posed(BODIES[name], make, 11))


@pytest.mark.quick_sets(11)
@pytest.mark.parametrize("make", OF_FACES, ids=lambda f: f.__name__[1:])
@pytest.mark.parametrize("name", ROUND)
def test_round_faces_agree_with_the_oracle(name, make):
    q, Ts, zs = posed(BODIES[name], make, 11, n=7)
    agree(BODIES[name], q, Ts[:2], zs[:2])


@pytest.mark.quick_sets(11)
@pytest.mark.parametrize("kind", [1, 2], ids=["edges", "corners"])
@pytest.mark.parametrize("make", [_plain, _anisotropic, _labels, _scale], ids=lambda f: f.__name__[1:])
@pytest.mark.parametrize("name", FLAT)
def test_edges_and_corners_agree_with_the_oracle(name, make, kind):
    body, rng = BODIES[name], np.random.default_rng(5)
    q, Ts, zs = posed(body, make, 12, sd=2e-3)
    if kind == 2:
        near = body.corners[rng.integers(len(body.corners), size=len(q.points))] + 2e-3 * rng.normal(
            size=q.points.shape
        )
        q = replace(q, points=near @ Ts[0][:3, :3].T + Ts[0][:3, 3])
    agree(body, replace(q, kinds=np.full(len(q.points), kind, np.int32)), Ts, zs)


def _aimed(q, normals, rng):
    return directed(q, normals, rng)


def _felt(q, normals, rng):
    return oriented(directed(q, normals, rng), normals, rng, tilt=0.3)


@pytest.mark.quick_sets(9)
@pytest.mark.parametrize("make", [lambda q, *_: q, _aimed, _felt], ids=["plain", "aimed", "felt"])
@pytest.mark.parametrize("opened", [False, True], ids=["closed", "open"])
@pytest.mark.parametrize("name", [*FLAT, "tent", "star"])
def test_balls_about_vertices_agree_with_the_oracle(name, opened, make):
    """Convex vertices can be touched; those with a concave edge, or at the border of an open mesh, cannot."""
    body, rng = {**BODIES, "tent": tent(), "star": tent(low=-0.025)}[name], np.random.default_rng(8)
    if opened:
        rows = np.arange(len(body.triangles)) > 0
        body = replace(
            body, triangles=body.triangles[rows], faces=body.faces[rows], profile_rows=body.profile_rows[rows]
        )
    T, radius, sd = random_pose(rng), 4e-3, 5e-4
    out = rng.normal(size=(20, 3))
    out /= np.linalg.norm(out, axis=1)[:, None]
    centres = body.vertices[rng.integers(len(body.vertices), size=20)] + radius * out + sd * rng.normal(size=(20, 3))
    q = point_question(centres @ T[:3, :3].T + T[:3, 3], sd)
    q = make(replace(q, radii=np.full(20, radius)), out @ T[:3, :3].T, rng)
    agree(body, q, T[None], np.zeros((1, 0)))


def test_all_at_once_agrees_with_the_oracle():
    body, rng = BODIES["bracket"], np.random.default_rng(2)
    q, Ts, _ = posed(body, _uneven_normals, 21, n=16)
    q = with_prior(with_shared(with_rays(q, body, Ts[0], rng, slope=0.03), 2, rng), Ts[0], rng)
    kinds = np.array([0] * 12 + [1] * 2 + [2] * 2, np.int32)
    q = replace(q, kinds=kinds, groups=np.where(kinds == 0, rng.integers(-1, 2, 16), -1).astype(np.int32), scale_sd=0.3)
    agree(body, q, Ts, rng.normal(size=(3, q.states)))
