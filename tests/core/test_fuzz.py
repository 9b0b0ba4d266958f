"""The core neither crashes nor hangs nor returns nan: damaged meshes, strange questions, wrong arrays.

``make sanitize`` runs these on a core that is watched for bad accesses and undefined behaviour. TANTEO_FUZZ is how many
random questions are used.
"""

from __future__ import annotations

import os
from dataclasses import fields, replace

import numpy as np
import pytest

from core.bodies import flat_bodies
from core.meshes import random_mesh
from core.questions import Question, point_question, random_pose, with_prior, with_rays, with_shared
from tanteo import _core

COUNT = int(os.environ.get("TANTEO_FUZZ", "60"))
BLOCK = flat_bodies()["block"]
ARRAYS = [
    f.name
    for f in fields(Question)
    if f.name not in ("kinds", "circles", "groups", "elsewhere", "scale_sd", "mean_rate", "one_sided")
]


def strange_question(body, scale, rng):
    """Return a valid question: any size of noise, any kind of point, groups with gaps."""
    n = int(rng.integers(0, 12))
    T = random_pose(rng, scale)
    p = body.surface_points(n, rng)[0] if n else np.zeros((0, 3))
    sd = scale * 10.0 ** rng.integers(-6, 2)
    q = point_question(p @ T[:3, :3].T + T[:3, 3] + sd * rng.normal(size=(n, 3)), sd)
    if rng.uniform() < 0.5:
        A = rng.normal(size=(n, 3, 3)) * rng.choice([0.0, 1e-6, 1.0], size=(n, 1, 3), p=[0.3, 0.2, 0.5])
        q = replace(q, covs=sd**2 * (A @ np.swapaxes(A, 1, 2)), extra=np.full(n, sd**2 * rng.choice([1e-18, 0.1])))
    some = [rng.normal(size=(n, 3)) * (rng.uniform(size=(n, 1)) < 0.5) for _ in range(2)]
    directions, normals = (s / np.maximum(np.linalg.norm(s, axis=1, keepdims=True), 1e-9) for s in some)
    kinds = (rng.integers(0, 7, n) if rng.uniform() < 0.3 else np.zeros(n)).astype(np.int32)
    q = replace(
        q, directions=directions, normals=normals, normal_sds=10.0 ** rng.integers(-6, 1, n), kinds=kinds,
        circles=rng.choice([0, 1], size=(n, 3)) * [scale * 1e-2, scale * 1e-3, 1] + [0, 1e-9, 0],
        radii=scale * rng.choice([0, 1e-3, 1], size=n), free_reach=scale * rng.choice([0, 0.1, 10], size=n),
        groups=rng.choice([-1, 0, max(n - 1, 0)], size=n).astype(np.int32) if n else q.groups,
        scale_sd=float(rng.choice([0.0, 0.5])), log_outlier=q.log_outlier + rng.choice([-50, 0, 50]),
    )  # fmt: skip
    q = with_rays(q, body, T, rng, m=int(rng.integers(0, 4)), slope=0.1) if rng.uniform() < 0.3 else q
    q = with_prior(q, T, rng) if rng.uniform() < 0.3 else q
    return with_shared(q, int(rng.choice([0, 0, 1, 3, 57])), rng, scale * 1e-3), T


def made(make, refusal):
    """Return the result, or None if the input was refused with one of the expected messages."""
    try:
        return make()
    except ValueError as error:
        if not str(error).startswith(refusal):
            raise
        return None


@pytest.mark.parametrize("seed", range(COUNT))
def test_valid_questions_are_answered(seed):
    rng = np.random.default_rng(seed)
    body, scale = random_mesh(rng)
    shape = made(lambda: body.shape(int(rng.integers(4, 12))), "triangles: ")
    if shape is None:
        return
    q, T = strange_question(body, scale, rng)
    core = made(q.core, "covs: ")
    if core is None:
        return
    Ts = np.stack([T, np.eye(4), T @ np.diag([1, 1, 1, 1.0])])
    Ts[2, :3, :3] *= rng.choice([0.0, 2.0, -1.0])  # no rotation
    zs = rng.normal(size=(3, q.states))
    answers = [_core.log_densities(shape, core, Ts, zs), *_core.slopes(shape, core, Ts, zs)]
    answers += _core.maximize(shape, core, Ts[:2], zs[:2], np.array([0.01 * scale]), 5, 1e-3, 1e3)[:4]
    answers += [*_core.marginals(shape, core, Ts[:2], zs[:2]), _core.details(shape, core, Ts[:2], zs[:2])[0]]
    rows = np.arange(len(q.points), dtype=np.int32)
    answers += [_core.scores(shape, core, rows, Ts, scale, 0.3)]
    answers += _core.refine_poses(shape, core, rows, np.array([scale]), Ts[:2])[:2]
    pairs = rows[: len(rows) // 2 * 2]
    seeds = np.full(len(pairs) // 2, seed)
    answers += _core.propose(shape, core, rows, pairs, 5, 4, scale, scale, 0.3, 5, seeds)
    for answer in answers:
        assert not np.isnan(answer).any()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", ARRAYS)
def test_what_is_not_finite_is_refused_by_name(name, value):
    rng = np.random.default_rng(0)
    q = with_shared(with_rays(point_question(rng.normal(size=(4, 3)), 1e-3), BLOCK, np.eye(4), rng), 2, rng)
    q = with_prior(q, np.eye(4), rng)
    array = getattr(q, name).astype(float)
    array.flat[rng.integers(array.size)] = value
    with pytest.raises(ValueError, match=f"^{name}: "):
        replace(q, **{name: array}).core()


@pytest.mark.parametrize(
    "change", [lambda a: a[:-1], lambda a: a[..., None], lambda a: np.zeros((5, 0)), lambda a: a[0]]
)
@pytest.mark.parametrize("name", [name for name in ARRAYS if name != "table"])
def test_wrong_shapes_are_refused(name, change):
    rng = np.random.default_rng(0)
    q = with_shared(with_rays(point_question(rng.normal(size=(4, 3)), 1e-3), BLOCK, np.eye(4), rng), 2, rng)
    q = with_prior(q, np.eye(4), rng)
    with pytest.raises((ValueError, TypeError)):
        replace(q, **{name: np.ascontiguousarray(change(getattr(q, name)))}).core()


@pytest.mark.parametrize("kind", ["axis_centre", "sphere_centre", "cone_apex"])
@pytest.mark.parametrize("name", ["sizes", "size_sds", "material_sides", "offsets"])
@pytest.mark.parametrize("value", [[np.nan] * 3, [-2.0] * 3, [1.0] * 2, [[1.0]] * 3])
def test_sizes_that_make_no_sense_are_refused_by_name(kind, name, value):
    columns = {"points": np.zeros((3, 3)), "covs": np.tile(np.eye(3), (3, 1, 1)), "sizes": np.ones(3)}
    columns |= {"size_sds": np.ones(3), name: np.array(value)}
    with pytest.raises(ValueError, match=f"^{name}: "):
        _core.make_factors(kind, columns)


def test_an_unknown_kind_is_refused_with_those_that_are_known():
    with pytest.raises(ValueError, match=r"^kind: expected one of .*surface_point.*, got wall"):
        _core.make_factors("wall", {})


@pytest.mark.parametrize("rows", [[0, 1, 1], [0, 1, 3], [0, -1, 1], [0, 1]])
def test_every_measurement_stands_in_one_row(rows):
    q = point_question(np.zeros((3, 3)), 1e-3)
    points = _core.make_factors("surface_point", {"points": q.points, "covs": q.covs})
    rest = q.groups, np.zeros(0), q.shared_jacobian, np.zeros((0, 3, 0)), 0.0, q.rates, q.rate_weights, q.mean_rate
    last = q.rays, q.ray_shifts, q.ray_turns, q.prior_means, q.prior_roots, q.prior_log_weights, q.table
    last = *last, np.zeros(2), np.zeros(0), np.zeros(0, np.int32)
    with pytest.raises(ValueError, match=r"^rows: "):
        _core.make_problem([(points, np.array(rows, np.int32))], np.zeros(3), *rest, *last)


@pytest.mark.parametrize("name", ["vertices", "profiles", "edges", "corners"])
def test_a_mesh_that_is_not_finite_is_refused(name):
    array = np.vstack([getattr(BLOCK, name), np.full((1, getattr(BLOCK, name).shape[1]), np.nan)])
    with pytest.raises(ValueError, match=f"^{name}: "):
        replace(BLOCK, **{name: array}).shape()


@pytest.mark.parametrize(
    "change",
    [
        {
            "triangles": np.zeros((0, 3), np.int32),
            "faces": np.zeros(0, np.int32),
            "profile_rows": np.zeros(0, np.int32),
        },
        {"triangles": BLOCK.triangles + 100},
        {"triangles": BLOCK.triangles - 1},
        {"faces": BLOCK.faces - 1},
        {"faces": BLOCK.faces + 2**30},
        {"profile_rows": BLOCK.profile_rows + 1},
        {"profile_rows": BLOCK.profile_rows[:-1]},
        {"vertices": 0 * BLOCK.vertices},
        {"vertices": 1e200 * BLOCK.vertices},
    ],
)
def test_meshes_that_are_none_are_refused(change):
    body = replace(BLOCK, **change)
    arrays = body.vertices, body.triangles, body.faces, body.profile_rows, body.profiles, body.edges, body.corners
    arrays = [np.ascontiguousarray(a, dtype=np.int32 if a.dtype.kind == "i" else float) for a in arrays]
    some = np.ones((1, 3))
    with pytest.raises(ValueError, match="expected"):
        _core.make_shape(*arrays, BLOCK.axes, BLOCK.vertices, np.zeros(3), some, some, 6)


@pytest.mark.parametrize(
    "change",
    [
        {"covs": np.zeros((2, 3, 3))},
        {"covs": -np.tile(np.eye(3), (2, 1, 1))},
        {"covs": np.tile(np.triu(np.ones((3, 3))), (2, 1, 1))},
        {"extra": np.full(2, -1.0)},
        {"radii": np.full(2, -1.0)},
        {"normals": np.ones((2, 3)), "normal_sds": np.zeros(2)},
        {"groups": np.full(2, 2, np.int32)},
        {"shared_jacobian": np.zeros((2, 3, 507))},
        {"shared_jacobian": np.zeros((2, 3, 506)), "scale_sd": 0.5},
        {"scale_sd": -1.0},
        {"rates": np.zeros(0), "rate_weights": np.zeros(0)},
        {"rates": np.array([0.0]), "rate_weights": np.ones(1)},
        {"rates": np.array([1.5]), "rate_weights": np.ones(1)},
        {"mean_rate": 0.0},
        {"table": np.r_[np.zeros(5), 1.0, 0.0]},
    ],
)
def test_questions_that_make_no_sense_are_refused(change):
    with pytest.raises(ValueError, match="expected"):
        replace(point_question(np.zeros((2, 3)), 1e-3), **change).core()


def test_poses_are_checked_everywhere():
    shape, q = BLOCK.shape(), point_question(np.zeros((2, 3)), 1e-3)
    core, bad = q.core(), np.full((1, 4, 4), np.nan)
    none, x = np.zeros((1, 0)), np.zeros((1, 6))
    rows = np.zeros(1, np.int32)
    calls = [
        lambda T: _core.log_densities(shape, core, T, none),
        lambda T: _core.slopes(shape, core, T, none),
        lambda T: _core.details(shape, core, T, none),
        lambda T: _core.marginals(shape, core, T, none),
        lambda T: _core.maximize(shape, core, T, none, np.zeros(0), 5, 1e-3, 10.0),
        lambda T: _core.scores(shape, core, rows, T, 1.0, 1.0),
        lambda T: _core.refine_poses(shape, core, rows, np.ones(1), T),
        lambda T: _core.place(T, x, np.zeros(3)),
        lambda T: _core.offsets(np.eye(4), T, np.zeros(3)),
        lambda T: _core.distinct(T, np.eye(6)[None], 4.0, 5, np.zeros(3)),
    ]
    for call in calls:
        for T in (bad, np.zeros((1, 4)), np.zeros((2, 3, 3)), np.zeros((5, 0))):
            with pytest.raises(ValueError, match=r"^poses: "):
                call(T)
        call(np.eye(4)[None])


@pytest.mark.parametrize(
    ("name", "value"),
    [("blurs", np.array([-1.0])), ("blurs", np.array([np.nan])), ("steps", -1), ("enough", -1.0), ("margin", np.nan)],
)
def test_maximizations_that_make_no_sense_are_refused_by_name(name, value):
    good = {"blurs": np.array([0.01]), "steps": 5, "enough": 1e-3, "margin": 10.0}
    q = point_question(np.zeros((3, 3)), 1e-3)
    with pytest.raises(ValueError, match=f"^{name}: "):
        _core.maximize(BLOCK.shape(), q.core(), poses=np.eye(4)[None], shared=np.zeros((1, 0)), **{**good, name: value})


def test_searches_that_keep_nothing_are_refused():
    shape, core, rows = BLOCK.shape(), point_question(np.eye(3)[:2], 1e-3).core(), np.arange(2, dtype=np.int32)
    good = {"per_pair": 5, "spins": 4, "tolerance": 1.0, "blur": 1.0, "tilt": 1.0, "keep": 3, "seeds": np.zeros(1, int)}
    for bad in ({"keep": 0}, {"blur": 0.0}, {"tilt": np.nan}, {"tolerance": -1.0}, {"spins": 0}, {"per_pair": -1}):
        with pytest.raises(ValueError, match=next(iter(bad))):
            _core.propose(shape, core, rows, rows, **{**good, **bad})
    with pytest.raises(ValueError, match="rows"):
        _core.propose(shape, core, rows + 2, rows, **good)
    with pytest.raises(ValueError, match="pairs"):
        _core.propose(shape, core, rows, rows, **{**good, "seeds": np.zeros(2, int)})
    assert _core.propose(shape, core, rows, rows, **good)[0].shape[1:] == (4, 4)


def test_a_mixture_without_components_is_no_density():
    none = (
        np.zeros((0, 4, 4)),
        np.zeros((0, 6, 6, 6)),
        np.zeros(0, np.int32),
        0,
        np.zeros((0, 6)),
        np.zeros((0, 6, 6)),
        np.zeros(0),
        4.0,
        np.zeros(3),
    )
    logs, shares = _core.mixture(np.eye(4)[None], *none)
    assert np.all(logs == -np.inf)
    assert shares.shape == (1, 0)
