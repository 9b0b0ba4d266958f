"""Edges of an image and stable poses as terms of the log density: plain NumPy, differences, integrals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tanteo import _core
from tanteo.catalogue import known_stable_poses
from tanteo.factors import ContactPoints, FreeRays
from tanteo.geometry import SE3, SO3
from tanteo.parts import read_part
from tanteo.posterior import OnTable, Priors, Problem, prepare
from tanteo.vision.edges import chance_hits
from tanteo.vision.fit import meet
from tanteo.vision.image_edges import ImageEdges, Sums, Weights
from tanteo.vision.settings import EDGES, EVIDENCE
from tanteo.vision.wireframe import see_edges
from vision_scenes import PARTS, bracket, seen_alone

WEIGHTS = Weights()


@pytest.fixture(scope="module")
def scene():
    """A bracket on a table: model, camera with errors, edges, factor, and the pose in the camera."""
    model = bracket()
    camera, _, edges, T = seen_alone(model, 0.6)
    camera = replace(camera, covariance=np.diag(np.r_[np.full(3, 1e-4), np.full(3, 2e-4)] ** 2))
    chance = chance_hits(edges.points)
    return model, camera, edges, ImageEdges(camera, edges, chance), T


def summed(factor, model, Ts):
    """Return the sums of the factor's own term at poses in the camera, without shared errors."""
    world = np.ascontiguousarray(factor.camera.T_world_camera @ Ts)
    return Sums(*_core.image_sums(factor.term(model.part, 0), world, np.zeros((len(Ts), factor.states))).T)


def near(T, rng, count):
    """Poses around one, from a tenth of a millimetre to some millimetres off."""
    sizes = rng.choice([0.1, 0.5, 1.0, 3.0], size=(count, 1))
    return T @ SE3.exp(rng.normal(size=(count, 6)) * np.r_[np.full(3, 1e-3), np.full(3, 0.01)] * sizes)


def foremost(groups, edge_hits):
    """Return the samples whose edge point is not hidden by a nearer parallel edge of the part."""
    out = edge_hits.hits.copy()
    places = edge_hits.pixels + edge_hits.offsets[:, None] * edge_hits.normals
    for i in np.flatnonzero(edge_hits.hits):
        for j in np.flatnonzero(
            edge_hits.hits & (groups != groups[i]) & (np.abs(edge_hits.offsets) < np.abs(edge_hits.offsets[i]))
        ):
            width = max(edge_hits.spans[i], edge_hits.spans[j], 4.0)
            if np.linalg.norm(places[i] - places[j]) < width and abs(edge_hits.normals[i] @ edge_hits.normals[j]) > 0.9:
                out[i] = False
    return out


def from_grid(frame, T):
    """Return the pose with the eye on the nearest grid corner from which the core evaluates visibility."""
    off, step = SE3.inverse(T)[:3, 3] - frame.middle, frame.view_step
    far = np.exp(10 * step * np.rint(np.log(np.linalg.norm(off)) / (10 * step)))
    eye = frame.middle + far * step * np.rint(off / np.linalg.norm(off) / step)
    return SE3.from_parts(T[:3, :3], -T[:3, :3] @ eye)


def by_edges(groups, values, spans):
    """Sum over edges, of which a length L counts as L / (1 + L / 60)."""
    return sum(
        values[(groups == g) & (spans > 0)].sum() / (1 + spans[groups == g].sum() / 60.0) for g in np.unique(groups)
    )


def beside(groups, edge_hits):
    """Return the samples with another edge of the part, or a turn of their own edge, within 4 px."""
    out = np.zeros(len(groups), dtype=bool)
    for i in np.flatnonzero(edge_hits.inside):
        for j in np.flatnonzero(edge_hits.inside):
            if groups[i] == groups[j] and abs(edge_hits.normals[i] @ edge_hits.normals[j]) >= 0.9:
                continue
            gap = edge_hits.pixels[i] - edge_hits.pixels[j]
            across = gap @ edge_hits.normals[j]
            along = max(np.sqrt(max(gap @ gap - across**2, 0.0)) - edge_hits.spans[j] / 2, 0.0)
            out[i] |= across**2 + along**2 < 16.0
    return out


def unbiased(edge_hits, points, z=0.0):
    """Return matches with offsets less the bias of their edge points by shading and by a response curve."""
    at = edge_hits.points
    side = np.sign(np.sum(points.normals[at] * edge_hits.normals, axis=-1))
    by_shading = np.clip(EDGES.extrapolation * points.drifts[at], -EVIDENCE.most_pulled, EVIDENCE.most_pulled)
    bias = side * (by_shading + (0.5 + 0.5 * z) * points.responses[at])
    return replace(edge_hits, offsets=np.where(edge_hits.hits, edge_hits.offsets - bias, 0.0))


def where_edges_are(groups, edge_hits, sds, commons):
    """Sum over edges: a normal density of all offsets of an edge with their full covariance, or another's edge.

    All edges of an image are as exact as stated, or each has an error of 0.4 px more.
    """
    clear, totals = edge_hits.inside & ~beside(groups, edge_hits), np.log([0.98, 0.02])
    for g in np.unique(groups[clear]):
        rows = np.flatnonzero(clear & edge_hits.hits & (groups == g))
        if not len(rows):
            totals += np.log(EVIDENCE.outlying)
            continue
        d, sd, b = edge_hits.offsets[rows], sds[edge_hits.points[rows]], commons[edge_hits.points[rows]]
        with_the_rest = np.abs(d - np.median(d)) < 4 * np.sqrt(sd**2 + b**2 + 0.15**2)
        d, sd, b, rows = d[with_the_rest], sd[with_the_rest], b[with_the_rest], rows[with_the_rest]
        shares = np.minimum(edge_hits.spans[rows] / EDGES.correlation, 1.0)
        stated = np.linalg.slogdet(np.diag(sd**2 / shares) + np.outer(b, b))[1]
        for k, more in enumerate((0.0, 0.4)):
            common = np.sqrt(b**2 + more**2)
            covariance = np.diag(sd**2 / shares) + np.outer(common, common)
            log = (shares.sum() - d @ np.linalg.solve(covariance, d) + stated - np.linalg.slogdet(covariance)[1]) / 2
            totals[k] += np.log((1 - EVIDENCE.outlying) * np.exp(log) + EVIDENCE.outlying)
    return np.logaddexp.reduce(totals)


def test_the_density_is_that_of_plain_numpy(scene):
    model, camera, edges, factor, T = scene
    frame, points = model.frame, edges.points
    assert not frame.bends.any()
    shift = np.sqrt(0.5) * camera.edge_sd
    misplaced = (0.01**2 + (0.25 * points.drifts) ** 2) / 2
    noise = EDGES.extrapolated_noise * points.sds
    sds, commons = np.sqrt(noise**2 + 0.01**2 + misplaced), np.sqrt(misplaced + shift**2)

    def normal(d, sd):
        return np.exp(-0.5 * (d / sd) ** 2) / np.sqrt(2 * np.pi) / sd

    Ts = near(T, np.random.default_rng(1), 12)
    sums, expected = summed(factor, model, Ts), []
    for pose in Ts:
        edge_hits = meet(frame, camera, edges, pose, EVIDENCE.reach, see_edges(frame, from_grid(frame, pose)))
        edge_hits = unbiased(edge_hits, points)
        q = np.where(edge_hits.seen.rims, 0.85, 0.65)
        c = factor.chance[edge_hits.points] / (2 * EVIDENCE.reach)
        hit = np.log(q * (0.7 * normal(edge_hits.offsets, 0.15) + 0.3 * normal(edge_hits.offsets, 0.8)) / c + 1 - q)
        own, missed = foremost(frame.groups, edge_hits), edge_hits.inside & ~edge_hits.hits
        expected.append((
            by_edges(frame.groups, edge_hits.spans / 12 * hit, np.where(own, edge_hits.spans, 0.0)),
            by_edges(frame.groups, edge_hits.spans / 12 * np.log1p(-q), np.where(missed, edge_hits.spans, 0.0)),
            where_edges_are(frame.groups, edge_hits, sds, commons),
        ))  # fmt: skip
    hits, misses, located = np.array(expected).T
    np.testing.assert_allclose(sums.hits, hits, rtol=1e-5)  # chances are single precision
    np.testing.assert_allclose(sums.misses, misses, rtol=1e-9)
    np.testing.assert_allclose(sums.located, located, rtol=1e-6)
    there = WEIGHTS.hits * sums.hits + WEIGHTS.misses * sums.misses
    np.testing.assert_allclose(sums.there, there, rtol=1e-12)
    np.testing.assert_allclose(sums.log, there + located, rtol=1e-6)
    alone = factor.sums(model, Ts)
    np.testing.assert_allclose(alone.log, there, rtol=1e-9)


def test_a_constant_is_taken_about_each_pose(scene):
    model, camera, _, factor, T = scene
    near_it, far = T @ SE3.exp(np.r_[1e-4, 0, 0, 0, 0, 0]), T @ SE3.exp(np.r_[0, 0, 0, 0, 0, 1.0])
    about = np.ascontiguousarray(camera.T_world_camera @ np.stack([T, far]))
    levelled = replace(factor, levels={model.part: (about, np.array([3.0, -2.0]))})
    before, after = (summed(one, model, np.stack([near_it, far])).log for one in (factor, levelled))
    np.testing.assert_allclose(before - after, [3.0, -2.0])


def test_its_slope_is_that_of_differences(scene):
    """Within the noise of edge points: the slope ignores that lengths and directions of edges follow the pose.

    A sample that gets another edge point jumps by the noise of both, so the median of several poses counts.
    """
    model, camera, _, factor, T = scene
    term, c, rng = factor.term(model.part, 2), model.part.centroid, np.random.default_rng(4)
    about, z = SE3.from_parts(np.eye(3), c), np.zeros((1, 12))  # two errors before those of the image, one behind
    steps = np.r_[np.full(3, 2e-5), np.full(3, 2e-4), np.full(12, 0.05)]
    gaps, sizes = [], []
    for _ in range(9):
        off = rng.normal(size=6) * np.r_[np.full(3, 2e-4), np.full(3, 1e-3)]
        Ts = np.ascontiguousarray((camera.T_world_camera @ T @ SE3.exp(off))[None])
        log, gradient, information = _core.term_slopes(term, Ts, z, c)
        alone = summed(factor, model, SE3.inverse(camera.T_world_camera) @ Ts).log[0]
        assert log[0] == pytest.approx(alone, abs=1e-9)
        differences = []
        for k, h in enumerate(steps):
            moves = h * np.eye(18)[k]
            ends = [
                _core.term_slopes(
                    term,
                    np.ascontiguousarray(Ts @ about @ SE3.exp(s * moves[:6]) @ SE3.inverse(about)),
                    z + s * moves[6:],
                    c,
                )[0][0]
                for s in (1, -1)
            ]
            differences.append((ends[0] - ends[1]) / (2 * h))
        sd = np.sqrt(np.diag(information[0]))
        np.testing.assert_array_equal(gradient[0, [6, 7, 17]], 0.0)
        gaps.append((gradient[0] - differences)[sd > 0] / sd[sd > 0])
        sizes.append(gradient[0][sd > 0] / sd[sd > 0])
        np.testing.assert_array_equal(information[0], information[0].T)
        assert np.linalg.eigvalsh(information[0]).min() > -1e-6 * np.abs(information[0]).max()
    assert np.median(np.abs(gaps), axis=0).max() < 1.0
    assert np.median(np.linalg.norm(sizes, axis=1)) > 5


def test_a_motion_of_the_camera_is_one_of_the_part(scene):
    """A camera moved by its errors gives the same image as a part moved back."""
    model, camera, edges, factor, T = scene
    term = factor.term(model.part, 0)
    z = np.random.default_rng(3).normal(size=6)
    world = np.ascontiguousarray((camera.T_world_camera @ T)[None])
    here = _core.image_sums(term, world, np.zeros((1, 9)))[0, 0]
    values, vectors = np.linalg.eigh(camera.covariance)
    xi = (vectors * np.sqrt(values)) @ z
    moved = camera.T_world_camera @ SE3.exp(xi) @ SE3.inverse(camera.T_world_camera)
    there = _core.image_sums(term, np.ascontiguousarray(moved @ world), np.r_[z, 0, 0, 0][None])[0, 0]
    assert there == pytest.approx(here, abs=0.3)
    assert edges is factor.edges


def test_terms_are_added_to_the_log_density(scene):
    model, camera, _, factor, T = scene
    lying = OnTable(np.eye(4), 2e-4, 2e-3, 1e-2)
    prepared, poses = prepare(model.part), np.ascontiguousarray((camera.T_world_camera @ T)[None])
    problem = Problem(ContactPoints.none(), FreeRays.none(), Priors(radius=0.1), pose_factors=(factor, lying))
    assert problem.states == 9
    z = np.full((1, 9), 0.1)
    core = problem.compiled(prepared)
    log, _, information = _core.slopes(prepared.shape, core, poses, z)
    terms = [one.term(model.part, 0) for one in problem.pose_factors]
    own = [_core.term_slopes(term, poses, z, prepared.shape.centre) for term in terms]
    assert log[0] == pytest.approx(sum(a[0][0] for a in own) - 0.5 * 9 * 0.01)
    prior = np.diag(np.r_[np.zeros(6), np.ones(9)])
    np.testing.assert_allclose(information[0], own[0][2][0] + own[1][2][0] + prior, rtol=1e-9)
    assert _core.log_densities(prepared.shape, core, poses, z)[0] == pytest.approx(log[0])


@pytest.mark.parametrize("name", ["bracket_left", "block", "hex_spacer", "flange"])
def test_stable_poses_have_their_probabilities(name):
    """The density of the pose integrates to one over place, height, tilt and yaw, symmetric poses included."""
    part = read_part(PARTS / f"{name}.step")
    lying = OnTable(np.eye(4), 3e-3, 0.08, 4e-2)
    term, rng, N = lying.term(part, 0), np.random.default_rng(5), 400_000
    q = rng.normal(size=(N, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    w, x, y, z = q.T
    R = np.stack([
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z), 1 - 2 * (x * x + z * z),
        2 * (y * z - w * x), 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    ], axis=-1).reshape(-1, 3, 3)  # fmt: skip
    high = 1.2 * part.diagonal
    t = np.stack([np.zeros(N), np.zeros(N), rng.uniform(0, high, N)], axis=-1) - R @ part.centroid
    logs, _, _ = _core.term_slopes(term, np.ascontiguousarray(SE3.from_parts(R, t)), np.zeros((N, 0)), part.centroid)
    values = np.exp(logs) * 4e-2 * high * 8 * np.pi**2
    mean, sd = values.mean(), values.std() / np.sqrt(N)
    print(mean, sd)
    assert sd < 0.1
    assert abs(mean - 1) < 4 * sd + 0.01


def test_a_ball_lies_in_every_attitude_with_equal_density():
    """Times the area and the volume of attitudes, the density at the most probable height is that of the height."""
    up, area, sd = np.array([[0.0, 0.0, 1.0]]), 4e-2, 1e-3
    term = _core.stable_poses(up, np.array([0.02]), np.zeros(1), np.zeros(3), 2, up[0], np.eye(4), sd, 0.1, area)
    poses = SE3.from_parts(SO3.exp(np.random.default_rng(0).normal(size=(5, 3))), np.array([0.0, 0.0, 0.02]))
    logs, _, _ = _core.term_slopes(term, np.ascontiguousarray(poses), np.zeros((5, 0)), np.zeros(3))
    np.testing.assert_allclose(np.exp(logs) * area * 8 * np.pi**2, 1 / (np.sqrt(2 * np.pi) * sd))


def test_the_slope_of_stable_poses_is_that_of_differences():
    part = read_part(PARTS / "bracket_left.step")
    T = OnTable(np.eye(4), 1e-3, 0.02, 1.0)
    rest = known_stable_poses(part)[0].T_table_part
    pose = rest @ SE3.exp(np.array([1e-3, 5e-4, 2e-3, 0.01, -0.02, 0.015]))
    c = part.centroid + np.array([0.03, -0.02, 0.05])  # a lever moves the height with a turn
    about = SE3.from_parts(np.eye(3), c)
    _, gradient, information = _core.term_slopes(T.term(part, 0), pose[None], np.zeros((1, 0)), c)
    found = []
    for k in range(6):
        step = 1e-6 * np.eye(6)[k]
        ends = [
            _core.term_slopes(
                T.term(part, 0), np.ascontiguousarray(pose @ about @ SE3.exp(s * step) @ SE3.inverse(about))[None],
                np.zeros((1, 0)), c,
            )[0][0]
            for s in (1, -1)
        ]  # fmt: skip
        found.append((ends[0] - ends[1]) / 2e-6)
    np.testing.assert_allclose(gradient[0], found, rtol=2e-2, atol=1e-2 * np.sqrt(np.diag(information[0]).max()))


def test_what_cannot_be_meant_is_refused(scene):
    model, camera, edges, factor, _ = scene
    points = edges.points
    right = [
        camera.numbers, camera.T_world_camera, np.eye(6), np.zeros((0, 6)), 0.1, edges.nearest, points.pixels,
        points.sds, points.sds, points.widths, points.normals, points.drifts, points.responses, 1.0,
        np.array([0.1], dtype=np.float32),
    ]  # fmt: skip
    assert _core.make_edge_image(*right).states == 9
    assert _core.make_edge_image(*right[:12], 0 * points.responses, *right[13:]).states == 8
    wrong = {
        0: np.zeros(3), 1: np.eye(3), 2: np.eye(5), 3: np.eye(5), 4: -1.0, 5: edges.nearest[0], 6: points.pixels[:, :1],
        7: 0 * points.sds, 8: points.sds[1:], 9: points.widths[1:], 10: points.normals[1:],
        11: points.drifts[1:], 12: points.responses[1:], 13: -1.0, 14: np.zeros(1, dtype=np.float32),
    }  # fmt: skip
    for k, value in wrong.items():
        with pytest.raises(ValueError, match="expected"):
            _core.make_edge_image(*[value if j == k else one for j, one in enumerate(right)])
    with pytest.raises(ValueError, match="expected"):
        _core.image_edges(model.seen, factor.image, np.ones(3), np.zeros((0, 4, 4)), np.zeros(0), 2.5, 0, 0)
    with pytest.raises(ValueError, match="shared errors"):
        _core.image_sums(factor.term(model.part, 1), np.eye(4)[None], np.zeros((1, 9)))
