"""Unknown objects with flat faces: the density of readings on their planes, and what it decides."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import box_centred_pose, surface_points, touches_of
from tanteo.factors import FreeRays
from tanteo.geometry import SE3, SO3
from tanteo.geometry.special import log_sum
from tanteo.posterior import Priors, Problem, prepare
from tanteo.posterior.details import details_at
from tanteo.posterior.joint_surface_model import SharedPlanes, log_covered, log_gain_of_planes, log_reach, shared_planes
from tanteo.posterior.labels import SMALLEST
from tanteo.posterior.part_search import start_search

EXAMPLES = Path(__file__).parents[2] / "examples" / "parts"
SD, RADIUS, BARE = 1e-4, 0.1, -7.0


@pytest.fixture(scope="module")
def block():
    return prepare(tanteo.read_part(EXAMPLES / "block.step"))


def on_faces(target, counts, rng):
    """Return points on the first faces of a part, so many on each, and the number of the face of each point."""
    p, _ = surface_points(target, 4000, rng)
    faces = target.part.triangle_face[target.surface.closest(p).triangles]
    rows = np.concatenate([np.flatnonzero(faces == f)[:n] for f, n in counts.items()])
    return p[rows], faces[rows]


def shared(target, points, T, tolerance=0.0, noise_factor=1.0, **columns):
    """Return the problem of touches and what they share at a pose, at the noise as stated."""
    priors = Priors(radius=RADIUS, noise_factor=noise_factor)
    touches = replace(touches_of(points, SD, **columns), tolerance=tolerance)
    problem = Problem(touches, FreeRays.none(), priors, typical_area=target.part.area)
    objective, zs = start_search(problem, target, np.random.default_rng(0)).objective, np.zeros((1, problem.states))
    at = details_at(objective, T[None], zs)
    return problem, at, shared_planes(at, problem, target.part, T[None], zs, BARE)


def covariances(places, number, normals, tolerance, scale):
    """Return the covariances of distances from faces as made exactly, and from displaced and tilted faces."""
    noise, common = SD**2 - tolerance**2, tolerance**2 or (scale * SD) ** 2 / 2
    exact = (scale**2 * noise + tolerance**2) * np.eye(len(places))
    faces = np.zeros_like(exact)
    for k in np.unique(number):
        own = number == k
        across = places[own] @ SO3.frame_from_axis(normals[own][0], 2)[:, :2]
        across -= across.mean(axis=0)
        across /= np.maximum(np.abs(across).max(axis=0), SMALLEST * RADIUS)  # a face is not smaller
        faces[np.ix_(own, own)] = 0.6 * (1 + across @ across.T) * common
    return exact, faces + exact - common * np.eye(len(places))


def log_normal(off, covariance):
    """Return the log density of columns of distances."""
    L = np.linalg.cholesky(covariance)
    q = np.sum(np.linalg.solve(L, off) ** 2, axis=0)
    return -0.5 * q - np.log(np.diag(L)).sum() - 0.5 * len(off) * np.log(2 * np.pi)


@pytest.mark.quick_sets(2)
@pytest.mark.parametrize(
    ("counts", "errors", "tolerance", "factor"),
    [
        ({0: 5, 2: 4, 4: 3}, 0, 0.0, 1.0),
        ({0: 5, 2: 4, 4: 3}, 2, 0.0, 1.0),
        ({0: 5, 2: 4}, 0, 0.0, 1.0),
        ({0: 5, 2: 4, 4: 3}, 0, 0.8 * SD, 2.0),
        ({0: 5, 2: 4, 4: 3}, 0, 0.0, 2.0),
    ],
)
def test_the_density_is_an_integral_over_boxes(block, counts, errors, tolerance, factor):
    """Draw boxes from the prior, and turns, planes and shared errors by importance; turns are exact."""
    rng = np.random.default_rng(errors)
    p, faces = on_faces(block, counts, rng)
    T = box_centred_pose(rng)
    points = SE3.apply(T, p) + SD * rng.normal(size=p.shape)
    more = {"shared_jacobian": 2e-4 * rng.normal(size=(len(p), 3, errors))} if errors else {}
    problem, at, (own,) = shared(block, points, T, tolerance, factor, **more)
    d, n, local = at.distances[0], at.normals[0], at.in_part[0]
    middle, K, number = local.mean(axis=0), len(counts), np.unique(faces, return_inverse=True)[1]
    by_error = np.einsum("ni,nik->nk", n @ T[:3, :3].T, more.get("shared_jacobian", np.zeros((len(p), 3, 0))))
    J = np.concatenate([np.eye(K)[number], np.cross(local - middle, n), -by_error], axis=1) / SD
    H = J.T @ J + np.diag(np.r_[np.zeros(K + 3), np.ones(errors)])
    mean, root = np.linalg.solve(H, J.T @ d / SD), np.linalg.cholesky(2.0 * np.linalg.inv(H))
    u = rng.normal(size=(200_000 if factor == 1 else 20_000, len(H)))
    x = mean + u @ root.T
    turned = (SO3.exp(x[:, K : K + 3]) @ n.T).transpose(2, 0, 1)
    off = d[:, None] - x[:, number].T + np.einsum("nsi,ni->ns", turned - n[:, None], local - middle)
    off += by_error @ x[:, K + 3 :].T
    nodes = np.linspace(-4, 4, 33) if factor > 1 else np.zeros(1)
    shares = np.exp(-(nodes**4) / 16) / np.exp(-(nodes**4) / 16).sum()
    noises = [C for s in nodes for C in covariances(local, number, n, tolerance, factor**s)]
    log = log_sum(
        [log_normal(off, C) + np.log(w / 2) for C, w in zip(noises, np.repeat(shares, 2), strict=True)], axis=0
    )
    log += 0.5 * np.sum(u**2, axis=1) + np.log(np.diag(root)).sum() + 0.5 * (K + 3) * np.log(2 * np.pi)
    log += np.log(24) - np.log(8 * np.pi**2) - 0.5 * np.sum(x[:, K + 3 :] ** 2, axis=1)
    sides, window = 2 * RADIUS * rng.uniform(size=(2_000_000, 3)), 0.5
    low = np.tile(local.min(axis=0), (len(sides), 1))  # the block is along its own axes, with the faces at lower ends
    if K == 2:
        low[:, 2] = middle[2] + window * rng.uniform(-1, 0.2, len(sides))
    holds = np.all(sides + low > local.max(axis=0), axis=1) & np.all(low < local.min(axis=0) + 1e-9, axis=1)
    area = 2 * (sides[:, 0] * sides[:, 1] + sides[:, 1] * sides[:, 2] + sides[:, 2] * sides[:, 0])
    even = area ** -len(p)
    chosen = even * np.maximum(area / problem.region.area, 1.0) ** (len(p) - 1)
    boxes = np.mean(holds * (even + chosen) / 2) * (1.2 * window if K == 2 else 1.0)
    places = np.log(boxes) + sum(log_covered(int(k)) for k in counts.values())
    anywhere = BARE + problem.log_outlier.sum()
    assert {rows for rows, _ in own.planes} == {frozenset(np.flatnonzero(number == k).tolist()) for k in range(K)}
    expected = float(log_sum(log) - np.log(len(u))) + places - anywhere
    assert own.log_gain == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_the_cover_of_a_side_has_beta_moments(count):
    fractions = np.random.default_rng(0).beta(1.0, 0.5, 400_000)
    assert np.exp(log_covered(count)) == pytest.approx(np.mean(fractions**count), rel=0.01)


def test_the_reach_of_a_face_is_that_of_random_rectangles():
    """Draw the sides log-uniformly and the place of the rectangle evenly: condition on the first reading."""
    rng = np.random.default_rng(5)
    places = rng.uniform(-0.02, 0.02, (4, 2))
    sides = 0.2 * np.exp(rng.uniform(np.log(1 / 32), 0.0, (1_000_000, 2)))
    middle = places[0] + rng.uniform(-0.1, 0.1, sides.shape)
    angles = rng.uniform(0, np.pi / 2, len(sides))
    u = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    v = np.stack([-u[:, 1], u[:, 0]], axis=1)
    inside = [
        (np.abs(np.sum((q - middle) * u, axis=1)) < sides[:, 0] / 2)
        & (np.abs(np.sum((q - middle) * v, axis=1)) < sides[:, 1] / 2)
        for q in places
    ]
    reached = np.mean(np.all(inside, axis=0)) / np.mean(inside[0])
    assert np.exp(log_reach(places, 0.2)) == pytest.approx(reached, rel=0.03)


def test_equal_sets_of_readings_count_once():
    """Several poses propose the same planes; other readings, or another side of a plane, are another assumption."""
    one = frozenset({(frozenset({0, 1, 2}), True)})
    others = frozenset({(frozenset({0, 1, 3}), True)}), frozenset({(frozenset({0, 1, 2}), False)})
    once = log_gain_of_planes([SharedPlanes(one, 4.0)])
    assert once == pytest.approx(np.log((1 + np.exp(4.0)) / 2))
    assert log_gain_of_planes([SharedPlanes(one, 4.0), SharedPlanes(one, 3.0)]) == pytest.approx(once)
    for other in others:
        both = log_gain_of_planes([SharedPlanes(one, 4.0), SharedPlanes(other, 4.0)])
        assert both == pytest.approx(np.log((1 + 2 * np.exp(4.0)) / 2))
    assert log_gain_of_planes([]) == 0.0


def test_a_sensed_normal_has_evidence_of_its_own(block):
    """Planes of labelled and oriented readings are in the density already."""
    rng = np.random.default_rng(1)
    p, _ = on_faces(block, {0: 5, 2: 4}, rng)
    normals = block.surface.normals[block.surface.closest(p).triangles]
    assert shared(block, p, np.eye(4))[2][0].log_gain > 5
    assert shared(block, p, np.eye(4), normals=normals, normal_sd=0.05)[2] == []


@pytest.mark.parametrize("directed", [False, True])
def test_two_perpendicular_planes_do_not_recognize_a_part(block, directed):
    """Touches of two perpendicular planes fit any object with a right angle: the known part is hardly more probable."""
    rng = np.random.default_rng(1)
    p, _ = on_faces(block, {0: 6, 2: 4}, rng)
    normals = block.surface.normals[block.surface.closest(p).triangles]
    columns = {"directions": -normals} if directed else {}
    readings = tanteo.Readings.from_columns(p + SD * rng.normal(size=p.shape), sds=np.full(len(p), SD), **columns)
    wedge = tanteo.read_part(EXAMPLES / "wedge.step")
    answer = tanteo.identify(readings, [wedge], priors=Priors(unknown=0.5), conventions=False)
    assert answer.unknown_probability > 0.3


@pytest.mark.parametrize("name", ["block", "clamp"])
def test_displaced_faces_are_still_those_of_the_part(name):
    """Each face is off by about two standard deviations, which many readings show and free planes fit exactly."""
    target, rng = prepare(tanteo.read_part(EXAMPLES / f"{name}.step")), np.random.default_rng(202)
    p, _ = surface_points(target, 200, rng)
    triangles = target.surface.closest(p).triangles
    off = 2 * SD * rng.normal(size=len(target.part.faces))[target.part.triangle_face[triangles]]
    p = p + off[:, None] * target.surface.normals[triangles] + SD * rng.normal(size=p.shape)
    answer = tanteo.identify(tanteo.Readings.from_columns(p, sds=np.full(len(p), SD)), [target.part], conventions=False)
    assert answer.status == "recognized"
    assert answer.unknown_probability < 0.01


@pytest.mark.quick_sets(1)
@pytest.mark.parametrize(("name", "seed"), [("t_slot", 3), ("clamp", 7), ("wedge", 10)])
def test_no_object_smaller_than_the_noise_explains_readings(name, seed):
    """A pose that fits badly proposes a small box; readings far beyond its ends are not on it."""
    names = "block", "clamp", "housing", "t_slot", "wedge", "bracket_left"
    targets = {one: prepare(tanteo.read_part(EXAMPLES / f"{one}.step")) for one in names}
    rng = np.random.default_rng(seed)
    p, _ = surface_points(targets[name], 12, rng)
    readings = tanteo.Readings.from_columns(p + 2e-3 * rng.normal(size=p.shape), sds=np.full(len(p), 2e-3))
    answer = tanteo.identify(readings, [one.part for one in targets.values()], conventions=False)
    assert answer.unknown_probability < 0.1
    assert answer.hypotheses[0].part == name


@pytest.mark.parametrize("seed", [0, 7])
def test_noise_known_to_a_factor_of_ten_is_answered(seed):
    """The information of readings and of the priors differs by more than numbers have digits."""
    target, rng = prepare(tanteo.read_part(EXAMPLES / "t_slot.step")), np.random.default_rng(seed)
    p, _ = surface_points(target, 8, rng)
    p, directions = p + 4e-4 * rng.normal(size=p.shape), rng.normal(size=p.shape)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    readings = tanteo.Readings.from_columns(p, sds=np.full(len(p), 4e-4), directions=directions)
    priors = Priors(noise_factor=10.0, outlier_rate=0.9, unknown=0.5)
    answer = tanteo.identify(readings, [target.part], priors=priors, conventions=False)
    assert 0 < answer.unknown_probability < 1


@pytest.mark.parametrize("tolerance", [0.0, 0.8 * SD])
def test_displaced_faces_have_the_restricted_likelihood(block, tolerance):
    """Patterson and Thompson 1971: the density of the distances, integrated over the pose, with each covariance."""
    rng = np.random.default_rng(7)
    p, faces = on_faces(block, {0: 5, 2: 4, 4: 5}, rng)
    normals = block.surface.normals[block.surface.closest(p).triangles]
    p = p + (SD * rng.normal(size=faces.max() + 1)[faces])[:, None] * normals + 5e-5 * rng.normal(size=p.shape)
    _, at, (own,) = shared(block, p, np.eye(4), tolerance)
    d, n, local, number = at.distances[0], at.normals[0], at.in_part[0], np.unique(faces, return_inverse=True)[1]
    across = np.linalg.svd(np.concatenate([n, np.cross(local, n)], axis=1))[0][:, 6:]
    logs = [
        log_normal(across.T @ d[:, None], across.T @ C @ across)[0]
        for C in covariances(local, number, n, tolerance, 1.0)
    ]
    expected = np.logaddexp(0, logs[1] - logs[0]) - np.log(2)
    assert own.log_displaced == pytest.approx(expected, abs=1e-3)
