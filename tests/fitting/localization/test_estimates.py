"""Pose estimates against the truth: errors follow the stated covariance, chi-square its degrees of freedom."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, chi2

from scenes import random_pose
from tanteo.errors import InputError
from tanteo.features import Feature, SharedError, SharedTerm
from tanteo.features.kinds import EDGE, KINDS, PLANE, VERTEX
from tanteo.fitting.localization import (
    RELATIONS,
    Block,
    ModelFeature,
    Pairing,
    estimate_pose,
    fuse_features,
    gauss_newton,
    pose_information,
)
from tanteo.geometry import SE3, SO3

KIND = {"plane": PLANE, "edge": EDGE, "vertex": VERTEX}
SETS = {
    "planes": ["plane_plane"] * 5,
    "planes, edges, vertices": ["plane_plane"] * 2 + ["edge_edge"] * 2 + ["vertex_vertex"] * 2,
    "partial": [
        *("vertex_on_edge", "vertex_on_plane", "edge_on_plane", "plane_has_vertex", "plane_has_edge"),
        *("edge_has_vertex", "point_on_cylinder", "point_on_sphere", "point_on_circle", "edge_on_plane"),
    ],
}


def interval(dof, level=0.95):
    return chi2.ppf([(1 - level) / 2, (1 + level) / 2], dof)


def free_motion(kind, rng, size=0.02):
    """Return a random motion of a feature along its own degrees of freedom."""
    out = np.eye(4)
    for rows, scale in (([i for i in kind.free if i < 3], size), ([i for i in kind.free if i >= 3], 1.0)):
        xi = np.zeros(6)
        xi[rows] = scale * rng.normal(size=len(rows))
        out = out @ SE3.exp(xi)
    return out


def on_feature(relation, radius, rng):
    """Return a relative frame for which the relation holds exactly, a few centimetres away."""
    T = SE3.exp(rng.normal(size=6) * np.r_[np.full(3, 0.05), np.ones(3)])
    for _ in range(60):
        f, D = relation.linearize(T, np.array(radius))
        T = T @ SE3.exp(-np.linalg.pinv(D) @ f)
    assert np.abs(relation.linearize(T, np.array(radius))[0]).max() < 1e-12
    inside_out = relation.name == "plane_plane" and T[2, 2] < 0
    return T @ SE3.exp(np.array([0, 0, 0, np.pi, 0, 0])) if inside_out else T


def random_covariance(kind, rng, sd=3e-4, tilt=3e-3):
    A = np.diag([sd if row < 3 else tilt for row in kind.rows]) @ (
        np.eye(kind.size) + 0.3 * rng.normal(size=(kind.size,) * 2)
    )
    return A @ A.T


class Scene:
    """Model features of one part, the frames of exact sensed features in it, covariances and shared gains."""

    def __init__(self, names, rng, shared=False, tolerance=0.0):
        self.relations = [RELATIONS[name] for name in names]
        self.T = random_pose(rng)
        self.Ts_model = [SE3.exp(rng.normal(size=6) * np.r_[np.full(3, 0.05), np.ones(3)]) for _ in names]
        self.radii = [0.02 if name.startswith("point_on") else 0.0 for name in names]
        self.Ts_exact = [
            M @ on_feature(r, radius, rng)
            for M, r, radius in zip(self.Ts_model, self.relations, self.radii, strict=True)
        ]
        self.Ps = [random_covariance(r.sensed, rng) for r in self.relations]
        self.P_models = [
            (tolerance * np.diag([1.0 if i < 3 else 30.0 for i in r.model.rows])) ** 2 for r in self.relations
        ]
        self.errors = []
        if shared:
            self.errors = [
                SharedError("base", np.diag([3e-4] * 3 + [1e-3] * 3) ** 2),
                SharedError("tip", (2e-4) ** 2 * np.eye(3)),
            ]
        self.R_hands = [SO3.from_quaternion(rng.normal(size=4)) for _ in names]

    def shared_jacobian(self, i, T_world_feature):
        """Rigid base error (left, of the world) and tip offset (in a hand of this attitude), on the feature's rows."""
        rows = SE3.adjoint_inverse(T_world_feature)[..., list(self.relations[i].sensed.rows), :]
        return rows, rows[..., :3] @ self.R_hands[i]

    def draw(self, rng, trials):
        """Sensed frames ``(trials, 4, 4)`` of every feature, and the shared draws."""
        c = [rng.multivariate_normal(np.zeros(len(e.covariance)), e.covariance, size=trials) for e in self.errors]
        out = []
        for i, relation in enumerate(self.relations):
            kind, model = relation.sensed, relation.model
            T_made = SE3.exp(rng.multivariate_normal(np.zeros(model.size), self.P_models[i], size=trials) @ model.B)
            T_rel = SE3.inverse(self.Ts_model[i]) @ self.Ts_exact[i]
            T = self.T @ self.Ts_model[i] @ T_made @ T_rel
            p = rng.multivariate_normal(np.zeros(kind.size), self.Ps[i], size=trials)
            for gain, draw in zip(self.shared_jacobian(i, T), c, strict=False):
                p = p + np.einsum("tij,tj->ti", gain, draw)
            out.append(T @ SE3.exp(p @ kind.B))
        return out

    def pairings(self, Ts):
        out = []
        for i, (relation, T) in enumerate(zip(self.relations, Ts, strict=True)):
            terms = tuple(SharedTerm(e, g) for e, g in zip(self.errors, self.shared_jacobian(i, T), strict=False))
            sensed = Feature(relation.sensed, T, self.Ps[i], f"f{i}", terms)
            out.append(Pairing(sensed, ModelFeature(relation.model, self.Ts_model[i], self.P_models[i], self.radii[i])))
        return out

    def blocks(self, Ts, trials):
        """Return all trials as one batch with one block for each pairing."""
        L = np.sqrt(np.concatenate([np.diag(e.covariance) for e in self.errors])) if self.errors else np.zeros(0)
        blocks = []
        for i, (relation, T) in enumerate(zip(self.relations, Ts, strict=True)):
            shared_jacobian = (
                np.concatenate(self.shared_jacobian(i, T), axis=-1)[:, None] * L
                if len(L)
                else np.zeros((1, 1, relation.sensed.size, 0))
            )
            blocks.append(
                Block(
                    relation,
                    T[:, None],
                    self.Ps[i][None],
                    self.Ts_model[i][None],
                    self.P_models[i][None],
                    shared_jacobian,
                    np.array([self.radii[i]]),
                    np.ones((trials, 1), dtype=bool),
                )
            )
        return blocks, len(L)


def nees(T_true, Ts, information):
    xi = SE3.log(SE3.inverse(Ts) @ T_true)
    return np.einsum("ti,tij,tj->t", xi, information, xi)


@pytest.mark.parametrize("tolerance", [0.0, 2e-4], ids=["exact part", "made part"])
@pytest.mark.parametrize("shared", [False, True], ids=["independent", "shared"])
@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("trials", [400, pytest.param(2000, marks=pytest.mark.slow)])
def test_consistent_over_many_trials(trials, name, shared, tolerance):
    rng = np.random.default_rng([11, len(name), shared, int(tolerance > 0)])
    scene = Scene(SETS[name], rng, shared, tolerance)
    blocks, n_shared = scene.blocks(scene.draw(rng, trials), trials)
    start = scene.T @ SE3.exp(1e-2 * rng.normal(size=(trials, 6)))
    solution = gauss_newton(blocks, start, n_shared, iterations=30)
    assert np.all(solution.steps < 1e-12)
    values = nees(scene.T, solution.T_world_part, pose_information(solution.information))
    low, high = interval(6 * trials)
    assert low <= values.sum() <= high
    dof = solution.equations[0] - 6
    low, high = interval(dof * trials)
    assert low <= solution.chi2.sum() <= high


def test_same_robot_covariance_is_of_error_that_same_robot_makes():
    """Going back with the same robot, the part is where its base and tip errors put it, not where the world has it."""
    rng, trials = np.random.default_rng(12), 150
    scene = Scene(["plane_plane"] * 5, rng)
    scene.errors = [SharedError("base", np.diag([3e-4] * 3 + [1e-3] * 3) ** 2)]
    c = rng.multivariate_normal(np.zeros(6), scene.errors[0].covariance, size=trials)
    Ts = [
        SE3.exp(c) @ scene.T @ T @ SE3.exp(rng.multivariate_normal(np.zeros(3), P, size=trials) @ PLANE.B)
        for T, P in zip(scene.Ts_exact, scene.Ps, strict=True)
    ]
    estimates = [estimate_pose(scene.pairings([T[t] for T in Ts])) for t in range(trials)]
    low, high = interval(6 * trials)
    poses = np.stack([e.T_world_part for e in estimates])
    world = nees(scene.T, poses, np.linalg.inv([e.covariance for e in estimates]))
    assert low <= world.sum() <= high
    seen = SE3.exp(c) @ scene.T
    same = nees(seen, poses, np.linalg.inv([e.covariance_relative for e in estimates]))
    assert low <= same.sum() <= high
    wrong = nees(scene.T, poses, np.linalg.inv([e.covariance_relative for e in estimates]))
    assert wrong.sum() > 2 * high


def test_ignoring_shared_errors_is_overconfident():
    """Each feature's total covariance is right, but taken as independent the errors are averaged away."""
    rng, trials = np.random.default_rng(13), 300
    scene = Scene(["plane_plane"] * 9, rng, shared=True)
    Ts = scene.draw(rng, trials)
    blocks = []
    for i, (block, T) in enumerate(zip(scene.blocks(Ts, trials)[0], Ts, strict=True)):
        gains = zip(scene.errors, scene.shared_jacobian(i, T), strict=True)
        P = scene.Ps[i] + sum(J @ error.covariance @ np.swapaxes(J, 1, 2) for error, J in gains)
        none = np.zeros((1, 1, block.relation.sensed.size, 0))
        blocks.append(replace(block, Ps=P[:, None], shared_jacobian=none))
    solution = gauss_newton(blocks, np.tile(scene.T, (trials, 1, 1)), 0, iterations=30)
    values = nees(scene.T, solution.T_world_part, pose_information(solution.information))
    assert np.sum(values) > 1.5 * interval(6 * trials)[1]


@pytest.mark.quick_sets(2)
@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("trials", [25, pytest.param(80, marks=pytest.mark.slow)])
def test_estimate_pose_finds_the_pose_without_a_start(trials, name, shared):
    rng = np.random.default_rng([14, len(name), shared])
    values, sums, dofs, lost = [], 0.0, 0, 0
    scene = Scene(SETS[name], rng, shared)
    Ts = scene.draw(rng, trials)
    for t in range(trials):
        start = None if name != "partial" else scene.T @ SE3.exp(1e-2 * rng.normal(size=6))
        e = estimate_pose(scene.pairings([T[t] for T in Ts]), start=start)
        assert e.status == "located"
        assert e.free.shape == (0, 6)
        assert not np.any(np.linalg.eigvalsh(e.covariance) <= 0)
        values.append(nees(scene.T, e.T_world_part[None], np.linalg.inv(e.covariance)[None])[0])
        sums, dofs, lost = sums + e.chi2, dofs + e.dof, lost + (e.p_value < 0.01)
    low, high = interval(6 * trials, 0.99)
    assert low <= np.sum(values) <= high
    low, high = interval(dofs, 0.99)
    assert low <= sums <= high
    assert lost <= binom.ppf(0.999, trials, 0.01)


@pytest.mark.slow
def test_prior_is_used_as_information():
    """Three vertices on planes leave three directions to the prior; chi-square counts both."""
    rng, trials = np.random.default_rng(15), 200
    scene = Scene(["vertex_on_plane"] * 3, rng)
    Ts = scene.draw(rng, trials)
    A = np.diag([2e-3] * 3 + [2e-2] * 3) @ (np.eye(6) + 0.3 * rng.normal(size=(6, 6)))
    values, total = [], 0.0
    for t in range(trials):
        T0 = scene.T @ SE3.inverse(SE3.exp(A @ rng.normal(size=6)))
        e = estimate_pose(scene.pairings([T[t] for T in Ts]), prior=(T0, A @ A.T))
        assert not e.unobserved
        values.append(nees(scene.T, e.T_world_part[None], np.linalg.inv(e.covariance)[None])[0])
        total += e.chi2
    low, high = interval(6 * trials, 0.99)
    assert low <= np.sum(values) <= high
    assert e.dof == 3
    low, high = interval(3 * trials, 0.99)
    assert low <= total <= high


def test_a_prior_that_agrees_is_not_called_a_contradiction():
    """Its six equations count: else p is too small by far, as chi-square has them."""
    rng, p = np.random.default_rng(17), []
    scene, A = Scene(["plane_plane"] * 4, rng), np.diag([2e-3] * 3 + [2e-2] * 3)
    Ts = scene.draw(rng, 40)
    for t in range(40):
        T0 = scene.T @ SE3.inverse(SE3.exp(A @ rng.normal(size=6)))
        e = estimate_pose(scene.pairings([T[t] for T in Ts]), prior=(T0, A @ A.T))
        assert e.dof == 12
        p.append(e.p_value)
    assert np.sum(np.array(p) < 0.01) <= binom.ppf(0.999, 40, 0.01)
    assert 0.3 < np.mean(p) < 0.7  # four standard errors


@pytest.mark.parametrize(
    ("known", "words"),
    [
        ({"prior": (2 * np.eye(4), np.eye(6))}, "prior, T_world_part: "),
        ({"prior": (np.eye(4), -np.eye(6))}, "prior, covariance: "),
        ({"prior": (np.eye(4), np.zeros((6, 6)))}, "positive variance in every direction"),
        ({"prior": (np.eye(4), np.eye(3))}, "prior, covariance: expected 6 x 6"),
        ({"prior": (np.eye(4)[None], np.eye(6))}, "expected one pose and one covariance"),
        ({"start": np.eye(3)}, "start: expected 4 x 4"),
        ({"length": -1.0}, "length: expected a length"),
    ],
)
def test_what_cannot_be_known_of_a_pose_is_refused(known, words):
    rng = np.random.default_rng(18)
    scene = Scene(["plane_plane"] * 3, rng)
    with pytest.raises(InputError, match=words):
        estimate_pose(scene.pairings([T[0] for T in scene.draw(rng, 1)]), **known)


def test_a_prior_alone_is_the_answer():
    T0, C = SE3.exp(np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])), np.diag([1e-3, 2e-3, 3e-3, 1e-2, 2e-2, 3e-2]) ** 2
    e = estimate_pose([], prior=(T0, C))
    np.testing.assert_allclose(e.T_world_part, T0, atol=1e-12)
    np.testing.assert_allclose(e.covariance, C, rtol=1e-9, atol=1e-18)
    assert (e.dof, e.p_value) == (0, 1.0)


@pytest.mark.parametrize("name", SETS)
def test_invariance(name):
    """Re-framing along symmetries, another world frame, another order: the same pose and covariance, transported."""
    rng = np.random.default_rng([16, len(name)])
    scene = Scene(SETS[name], rng, shared=True)
    Ts = [T[0] for T in scene.draw(rng, 1)]
    pairings, start = scene.pairings(Ts), scene.T @ SE3.exp(1e-3 * rng.normal(size=6))
    e = estimate_pose(pairings, start=start)

    def same(other, T=e.T_world_part, tolerance=1e-6, shift=1e-4):
        assert other.chi2 == pytest.approx(e.chi2, rel=tolerance)
        gap = SE3.log(SE3.inverse(T) @ other.T_world_part)
        assert np.sqrt(gap @ np.linalg.solve(e.covariance, gap)) < shift
        sd = np.sqrt(np.diag(e.covariance))
        for name in ("covariance", "covariance_relative"):
            np.testing.assert_allclose(
                getattr(other, name), getattr(e, name), atol=shift * np.max(np.outer(sd, sd)), rtol=max(shift, 1e-5)
            )

    order = rng.permutation(len(pairings))
    shuffled = estimate_pose([pairings[i] for i in order], start=start)
    same(shuffled)
    np.testing.assert_allclose(shuffled.distances, e.distances[order], rtol=1e-6)

    moved = []
    for pairing in pairings:  # sensed frames slid and turned along unsensed directions
        kind = pairing.sensed.kind
        S = free_motion(kind, rng)
        A = kind.B @ SE3.adjoint_inverse(S) @ kind.B.T
        terms = tuple(SharedTerm(term.error, A @ term.jacobian) for term in pairing.sensed.shared)
        P = A @ pairing.sensed.P @ A.T
        sensed = replace(
            pairing.sensed, T_world_feature=pairing.sensed.T_world_feature @ S, P=0.5 * (P + P.T), shared=terms
        )
        model = replace(
            pairing.model, T_part_feature=pairing.model.T_part_feature @ free_motion(pairing.model.kind, rng)
        )
        moved.append(Pairing(sensed, model))
    same(
        estimate_pose(moved, start=start, length=None), tolerance=0.02, shift=2e-2
    )  # equal up to second order in the noise

    W = random_pose(rng)
    base = replace(
        scene.errors[0], covariance=_symmetric(SE3.adjoint(W) @ scene.errors[0].covariance @ SE3.adjoint(W).T)
    )
    elsewhere = []
    for pairing in pairings:
        T = W @ pairing.sensed.T_world_feature
        terms = (SharedTerm(base, pairing.sensed.shared[0].jacobian @ SE3.adjoint_inverse(W)), pairing.sensed.shared[1])
        elsewhere.append(replace(pairing, sensed=replace(pairing.sensed, T_world_feature=T, shared=terms)))
    same(estimate_pose(elsewhere, start=W @ start), W @ e.T_world_part)


def _symmetric(C):
    return 0.5 * (C + C.T)


@pytest.mark.parametrize("kind", ["vertex", "edge", "plane"])
def test_fusing_two_estimates_of_one_feature(kind):
    rng, trials, kind = np.random.default_rng(17), 2000, KIND[kind]
    T = random_pose(rng)
    P1, P2 = random_covariance(kind, rng), random_covariance(kind, rng)
    T1, T2 = (
        T @ free_motion(kind, rng) @ SE3.exp(rng.multivariate_normal(np.zeros(kind.size), P, size=trials) @ kind.B)
        for P in (P1, P2)
    )
    fused, P, statistic, size = fuse_features(kind, T1, P1, T2, P2)
    assert size is None
    f, D = RELATIONS[f"{kind.name}_{kind.name}"].linearize(SE3.inverse(T) @ fused, np.zeros(trials))
    G = D @ kind.B.T
    values = np.einsum("ti,ti->t", f, np.linalg.solve(G @ P @ np.swapaxes(G, 1, 2), f[..., None])[..., 0])
    low, high = interval(kind.size * trials)
    assert low <= values.sum() <= high
    assert low <= statistic.sum() <= high
    assert np.all(np.linalg.eigvalsh(P1 - P) > -1e-15)


@pytest.mark.parametrize("name", ["circle", "cylinder", "cone", "sphere"])
def test_fusing_two_estimates_with_their_sizes(name):
    """Frame and size go together in each, as on an arc: the fused ones are as uncertain as they say."""
    rng, trials, kind, size = np.random.default_rng(18), 1000, KINDS[name], 0.01
    T, m = random_pose(rng), kind.size
    roots = [
        1e-5 * np.diag(np.r_[np.where(np.array(kind.rows) < 3, 1.0, 50.0), 1.0]) @ _mixed(m + 1, rng) for _ in "ab"
    ]
    P1, P2 = (root @ root.T for root in roots)
    errors = [rng.normal(size=(trials, m + 1)) @ root.T for root in roots]
    T1, T2 = (T @ SE3.exp(e[:, :m] @ kind.B) for e in errors)
    fused, P, statistic, sizes = fuse_features(kind, T1, P1, T2, P2, tuple(size + e[:, m] for e in errors))
    f, D = RELATIONS[f"{name}_{name}"].linearize(SE3.inverse(T) @ fused, np.zeros(trials))
    G = np.zeros((trials, m + 1, m + 1))
    G[:, :m, :m], G[:, m, m] = D @ kind.B.T, 1.0
    off = np.column_stack([f, sizes - size])
    values = np.einsum("ti,ti->t", off, np.linalg.solve(G @ P @ np.swapaxes(G, 1, 2), off[..., None])[..., 0])
    low, high = interval((m + 1) * trials)
    assert low <= values.sum() <= high
    assert low <= statistic.sum() <= high
    with pytest.raises(InputError, match="P1: expected a covariance of"):
        fuse_features(kind, T1, P1, T2, P2)


def _mixed(n, rng):
    return np.eye(n) + 0.3 * rng.normal(size=(n, n))


def test_features_that_are_not_the_same_fail_the_merge_test():
    P = np.diag([1e-4, 1e-3, 1e-3]) ** 2
    T2 = SE3.exp(np.array([0, 0, 1e-3, 0, 0, 0]))
    statistic = fuse_features(PLANE, np.eye(4), P, T2, P).chi2
    assert chi2.sf(statistic, 3) < 1e-6


def test_no_pairings_is_a_misuse():
    with pytest.raises(InputError, match="pairing"):
        estimate_pose([])
