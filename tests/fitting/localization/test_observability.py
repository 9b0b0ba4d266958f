"""What the pairings leave free: found, named, and nothing else; several answers where there are several."""

from __future__ import annotations

import numpy as np
import pytest

from scenes import random_pose
from tanteo.features import Feature
from tanteo.features.kinds import EDGE, PLANE, VERTEX
from tanteo.fitting.localization import (
    ModelFeature,
    Pairing,
    describe_motion,
    estimate_pose,
    motion_scale,
    motions_about,
)
from tanteo.geometry import SE3, SO3

X, Y, Z = np.eye(3)
SLANT = np.array([0.6, 0.8, 0.0])


def plane(normal, point):
    return PLANE, SE3.from_parts(SO3.frame_from_axis(np.asarray(normal), 2), np.asarray(point, dtype=float))


def edge(direction, point):
    return EDGE, SE3.from_parts(SO3.frame_from_axis(np.asarray(direction), 0), np.asarray(point, dtype=float))


def vertex(point):
    return VERTEX, SE3.from_parts(np.eye(3), np.asarray(point, dtype=float))


A, B, C = np.array([0.03, 0.01, 0.02]), np.array([-0.02, 0.03, 0.01]), np.array([0.01, -0.02, 0.05])
CASES = {  # what is paired: number of free translations, number of free turns
    "one plane": ([plane(Z, A)], 2, 1),
    "two parallel planes": ([plane(Z, A), plane(Z, B)], 2, 1),
    "two antiparallel planes": ([plane(Z, A), plane(-Z, B)], 2, 1),
    "identical planes": ([plane(Z, A), plane(Z, A)], 2, 1),
    "two planes": ([plane(Z, A), plane(X, B)], 1, 0),
    "three planes around a prism": ([plane(Y, A), plane(SLANT, B), plane(-SLANT, C)], 1, 0),
    "four sides of a box": ([plane(X, A), plane(-X, B), plane(Y, C), plane(-Y, A)], 1, 0),
    "three planes": ([plane(X, A), plane(Y, B), plane(Z, C)], 0, 0),
    "one edge": ([edge(X, A)], 1, 1),
    "coaxial edges": ([edge(X, A), edge(X, A + 0.05 * X)], 1, 1),
    "parallel edges": ([edge(X, A), edge(X, B)], 1, 0),
    "skew edges": ([edge(X, A), edge(Y, B)], 0, 0),
    "one vertex": ([vertex(A)], 0, 3),
    "two vertices": ([vertex(A), vertex(B)], 0, 1),
    "three vertices": ([vertex(A), vertex(B), vertex(C)], 0, 0),
    "three vertices in line": ([vertex(A), vertex(B), vertex(2 * B - A)], 0, 1),
    "plane and vertex": ([plane(Z, A), vertex(B)], 0, 1),
    "plane and edge in it": ([plane(Z, A), edge(X, A)], 1, 0),
    "plane and edge across": ([plane(Z, A), edge(Z, B)], 0, 1),
    "plane and slanted edge": ([plane(SLANT, A), edge(X, B)], 0, 0),
}


def pairings(features, T_world_part, rng, noise=1.0):
    sd = {"plane": [1e-4, 3e-3, 3e-3], "edge": [1e-4, 1e-4, 3e-3, 3e-3], "vertex": [1e-4] * 3}
    out = []
    for kind, T in features:
        s = np.array(sd[kind.name])
        T_sensed = T_world_part @ T @ SE3.exp(kind.B.T @ (noise * s * rng.normal(size=kind.size)))
        out.append(Pairing(Feature(kind, T_sensed, np.diag(s**2)), ModelFeature(kind, T)))
    return out


def residuals(features, T_world_part, T):
    """Return all residuals of exact features at another pose."""
    exact = pairings(features, T_world_part, np.random.default_rng(0), noise=0.0)
    return np.concatenate(
        [
            p.relation.linearize(SE3.inverse(T @ p.model.T_part_feature) @ p.sensed.T_world_feature, np.zeros(()))[
                0
            ].ravel()
            for p in exact
        ]
    )


@pytest.mark.quick_sets(20)
@pytest.mark.parametrize("noise", [0.0, 1.0, 5.0])
@pytest.mark.parametrize("name", CASES)
def test_free_motions_are_those_that_no_residual_feels(name, noise):
    features, slides, turns = CASES[name]
    rng = np.random.default_rng([21, len(name)])
    T, length = random_pose(rng), 0.1
    e = estimate_pose(pairings(features, T, rng, noise), length=length)
    assert len(e.free) == len(e.unobserved) == slides + turns
    assert e.status == ("insufficient" if slides + turns else "located")
    assert sum(words.startswith("sliding") for words in e.unobserved) == slides
    assert sum(words.startswith("rotation") for words in e.unobserved) == turns
    assert np.linalg.matrix_rank(e.free, tol=1e-6) == len(e.free)
    assert np.all(np.linalg.norm(e.free[slides:, 3:], axis=1) > 1e-6)
    if slides + turns:
        assert "Sense a feature" in e.message
    # brute force at the truth: small motions along the free directions change nothing, all others something
    reference = estimate_pose(pairings(features, T, rng, 0.0), length=length, start=T)
    h = 1e-5
    J = np.column_stack(
        [residuals(features, T, T @ SE3.exp(h * d)) - residuals(features, T, T @ SE3.exp(-h * d)) for d in np.eye(6)]
    ) / (2 * h)
    for xi in reference.free:
        assert np.abs(residuals(features, T, T @ SE3.exp(0.1 * xi))).max() < 1e-9
    assert np.linalg.matrix_rank(J, tol=1e-6) == 6 - slides - turns
    assert np.abs(J @ reference.free.T).max(initial=0.0) < 1e-8
    # along free directions the covariance is wide, across them it has the size of the noise
    for xi in e.free:
        assert xi @ np.linalg.pinv(e.covariance) @ xi < 100


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("three planes around a prism", ["sliding along part z"]),
        ("four sides of a box", ["sliding along part z"]),
        ("plane and edge across", ["rotation about part z"]),
        ("coaxial edges", ["sliding along part x", "rotation about part x"]),
    ],
)
def test_free_motions_in_words(name, words):
    features, _, _ = CASES[name]
    T = SE3.exp(np.array([0.1, 0.0, 0.2, 0.5, 0.4, -0.3]))  # no axis of the part along one of the world
    e = estimate_pose(pairings(features, T, np.random.default_rng(22)))
    for text, expected in zip(e.unobserved, words, strict=True):
        assert text.startswith(expected)
    upright = estimate_pose(pairings(features, np.eye(4), np.random.default_rng(22)))
    for text, expected in zip(upright.unobserved, words, strict=True):
        assert text.startswith(expected.replace("part", "world"))


def test_noise_does_not_hide_a_free_direction():
    """Sensed normals that disagree by their noise do not pin the part along the prism."""
    features, _, _ = CASES["three planes around a prism"]
    for seed in range(20):
        rng = np.random.default_rng([23, seed])
        T = random_pose(rng)
        e = estimate_pose(pairings(features, T, rng, noise=10.0))
        assert e.unobserved == ("sliding along part z",)
        off = SE3.log(SE3.inverse(T) @ e.T_world_part)
        assert np.linalg.norm(off[:2]) < 0.05


@pytest.mark.parametrize(("height", "others"), [(0.0, 3), (0.04, 1)], ids=["crossing", "skew"])
def test_undirected_edges_that_leave_several_poses_report_all(height, others):
    """Crossing edges fit after half turns about x, y and z; skew ones are left- or right-handed: only about z."""
    rng = np.random.default_rng(24)
    features = [edge(X, np.zeros(3)), edge(Y, np.array([0.0, 0.0, height]))]
    T = random_pose(rng)
    e = estimate_pose(pairings(features, T, rng))
    assert len(e.alternatives) == others
    everything = np.concatenate([e.T_world_part[None], e.alternatives])
    gaps = SE3.log(SE3.inverse(everything) @ T)
    assert np.linalg.norm(gaps[:, 3:], axis=1).min() < 0.02
    for other in everything:  # every one of them puts both edges where they were sensed
        assert np.abs(residuals(features, T, other)).max() < 0.02


def test_a_directed_scene_has_no_alternatives():
    features, _, _ = CASES["three planes"]
    rng = np.random.default_rng(25)
    e = estimate_pose(pairings(features, random_pose(rng), rng))
    assert e.alternatives.shape == (0, 4, 4)


def test_flipped_edge_frames_change_nothing():
    features = [edge(X, A), edge(SLANT, B), plane(Z, C)]
    rng = np.random.default_rng(26)
    T = random_pose(rng)
    given = pairings(features, T, rng)
    e = estimate_pose(given)
    flipped = [
        Pairing(
            Feature(
                EDGE,
                p.sensed.T_world_feature @ EDGE.symmetries[1],
                p.sensed.P,
            ),
            p.model,
        )
        if p.sensed.kind is EDGE
        else p
        for p in given
    ]
    f = estimate_pose(flipped)
    np.testing.assert_allclose(f.T_world_part, e.T_world_part, atol=1e-9)
    assert f.chi2 == pytest.approx(e.chi2, rel=1e-6)


def test_contradictory_pairings_are_reported():
    """One model plane sensed from both sides: no pose explains both, and the estimate does not pretend."""
    rng = np.random.default_rng(27)
    first = pairings([plane(X, A), plane(Y, B), plane(Z, C)], np.eye(4), rng)
    wrong = pairings([plane(-X, A)], np.eye(4), rng)[0]
    e = estimate_pose([*first, Pairing(wrong.sensed, first[0].model)])
    assert e.p_value < 1e-6
    assert "contradict" in e.message
    assert np.argmax(e.distances) in (0, 3)
    assert np.all(np.isfinite(e.T_world_part))


@pytest.mark.parametrize("name", ["one plane", "two antiparallel planes", "plane and vertex", "plane and edge in it"])
def test_a_single_direction_keeps_its_side(name):
    """Where directions leave the rotation open, many starts are tried; none may turn a face inside out."""
    for seed in range(10):
        rng = np.random.default_rng([28, seed])
        features, T = CASES[name][0], random_pose(rng)
        e = estimate_pose(pairings(features, T, rng))
        for p in pairings(features, T, rng, 0.0):
            if p.sensed.kind is PLANE:
                assert p.sensed.T_world_feature[:3, 2] @ e.T_world_part[:3, :3] @ p.model.T_part_feature[:3, 2] > 0.9


def test_a_rotation_is_named_by_its_axis_point_nearest_the_part():
    """Not by the one next to the origin of its file, which may be metres away."""
    middle, T = np.array([50.0, -20.0, 10.0]), random_pose(np.random.default_rng(3))
    T[:3, 3] = np.array([1.0, 2.0, 3.0]) - T[:3, :3] @ middle  # so that the middle is at (1, 2, 3) m
    scale = motion_scale(0.1, middle)
    words = describe_motion(np.array([0, 0, 0, 0, 0, 1.0]), T, scale)
    assert str(words) == "rotation about part z through (1000.0, 2000.0, 3000.0) mm"
    beside = describe_motion(np.array([0, 0.1, 0, 0, 0, 1.0]), T, scale)  # v = -w x c, c a tenth of its size off
    np.testing.assert_allclose(beside.point, T[:3, :3] @ (middle - np.array([0.01, 0, 0])) + T[:3, 3], atol=1e-4)


def test_scaled_motions_are_those_of_a_frame_at_the_middle():
    rng = np.random.default_rng(4)
    T, middle, u = random_pose(rng), rng.normal(size=3), rng.normal(size=6)
    S = SE3.from_parts(np.eye(3), middle)
    moved = T @ SE3.exp(motion_scale(0.2, middle) @ u)
    there = T @ S @ SE3.exp(np.r_[0.2 * u[:3], u[3:]]) @ SE3.inverse(S)
    np.testing.assert_allclose(moved, there, atol=1e-12)
    np.testing.assert_allclose(motions_about(middle, 8)[6:, 6:], np.eye(2))
    np.testing.assert_allclose(motions_about(middle) @ motions_about(-middle), np.eye(6), atol=1e-15)
