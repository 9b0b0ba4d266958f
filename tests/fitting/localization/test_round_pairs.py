"""Pairs of round features give a pose: a face with two holes, an axis and a hole, what stays free."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special

import tanteo.fitting as ft
from tanteo.features import Feature
from tanteo.features.kinds import CIRCLE, CYLINDER, PLANE, SPHERE, VERTEX
from tanteo.fitting.localization import ModelFeature, Pairing, estimate_pose
from tanteo.geometry import SE3, SO3

HOLES = np.array([[0.03, 0.0, 0.0], [-0.03, 0.01, 0.0]])


def model(kind, at, name, R=None):
    return ModelFeature(kind, SE3.from_parts(np.eye(3) if R is None else R, np.asarray(at)), radius=4e-3, name=name)


def off(kind, T, L, rng, label):
    return Feature(kind, T @ SE3.exp(-kind.B.T @ L @ rng.normal(size=kind.size)), L @ L, label)


@pytest.mark.slow
@pytest.mark.parametrize("N", [40, pytest.param(120, marks=pytest.mark.slow)])
def test_a_face_and_two_holes_in_it_locate_a_flange(N):
    """Forty poses show a variance that is off by a third, with one false alarm in a thousand."""
    rng, values = np.random.default_rng(1), []
    L = np.diag([5e-6, 3e-4, 2e-4])
    turn = np.linspace(0, 2 * np.pi, 4, endpoint=False)
    away = np.c_[np.cos(turn), np.sin(turn), 0 * turn]
    covs = np.tile(1e-10 * np.eye(3), (4, 1, 1))
    for _ in range(N):
        T = SE3.exp(np.r_[0.1 * rng.normal(size=3), rng.normal(size=3)])
        face = ft.with_named_errors(off(PLANE, T, L, rng, "top"))
        pairs = [Pairing(face, model(PLANE, [0, 0, 0], "face"))]
        for k, hole in enumerate(HOLES):
            points = SE3.apply(T, hole + 4e-3 * away - [0, 0, 3e-3]) + 1e-5 * rng.normal(size=(4, 3))
            sensed, _ = ft.circle_on_plane(points, covs, face, convex=False, label=f"h{k}")
            pairs.append(Pairing(sensed, model(CIRCLE, hole, f"hole {k}")))
        found = estimate_pose(pairs)
        assert found.status == "located"
        xi = SE3.log(SE3.inverse(found.T_world_part) @ T)
        values.append(xi @ np.linalg.solve(found.covariance, xi))
    low, high = special.chdtri(6 * N, [0.9995, 0.0005]) / N
    assert low < np.mean(values) < high


def test_a_boss_is_no_bore_wherever_it_lies():
    T = SE3.exp(np.array([0.1, 0, 0, 0.2, 0.1, 0]))
    sensed = ft.given_round(CIRCLE, T[:3, 3], 1e-5, axis=T[:3, 2], axis_sd=1e-3, size=4e-3, convex=True)
    distances = []
    for convex in (True, None, False):
        of = ModelFeature(CIRCLE, np.eye(4), radius=4e-3, convex=convex)
        found = estimate_pose([Pairing(sensed, of)], length=0.05, middle=np.zeros(3))
        distances.append(found.chi2)
    assert np.isfinite(distances).tolist() == [True, True, False]


def test_one_hole_leaves_the_turn_about_its_axis():
    rng = np.random.default_rng(2)
    T = SE3.exp(rng.normal(size=6) * 0.3)
    L = 1e-5 * np.eye(5)
    sensed = off(CIRCLE, T @ SE3.from_parts(np.eye(3), HOLES[0]), L, rng, "h")
    found = estimate_pose([Pairing(sensed, model(CIRCLE, HOLES[0], "hole"))])
    assert found.status == "insufficient"
    assert len(found.unobserved) == 1
    assert "rotation about" in found.unobserved[0]


@pytest.mark.parametrize(("kind", "of", "free"), [
    (CIRCLE, CYLINDER, 2), (CYLINDER, CIRCLE, 2), (CIRCLE, PLANE, 3), (CYLINDER, CYLINDER, 2), (SPHERE, SPHERE, 3),
    (VERTEX, CIRCLE, 4),
])  # fmt: skip
def test_what_a_round_pair_leaves_free(kind, of, free):
    rng = np.random.default_rng(3)
    T = SE3.exp(rng.normal(size=6) * 0.3)
    at = SE3.from_parts(SO3.exp(np.array([0.3, 0.1, 0.2])), np.array([0.01, 0.02, 0.03]))
    on_rim = SE3.from_parts(np.eye(3), np.array([4e-3, 0, 0])) if kind is VERTEX else np.eye(4)
    sensed = off(kind, T @ at @ on_rim, 1e-6 * np.eye(kind.size), rng, "f")
    found = estimate_pose([Pairing(sensed, ModelFeature(of, at, radius=4e-3))], length=0.05, middle=np.zeros(3))
    assert len(found.free) == free
    assert found.chi2 < 1e-6
