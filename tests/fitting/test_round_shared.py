"""Errors that the points of a round feature share: they weigh in the fit, and are carried by name."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special

import tanteo.fitting as ft
from round_scenes import RADIUS, error_of, nees, random_frame, round_points, size_of, whole_covariance
from tanteo.errors import InputError, SideError
from tanteo.features import Feature, SharedError
from tanteo.features.kinds import CYLINDER, KINDS, PLANE, SPHERE
from tanteo.geometry import SE3, SO3

SD, SHARED_SD, N, TRIALS = 2e-6, 1e-5, 16, 120


def turned_tip(rng, away):
    """Return an offset of the tip in the frame of the hand, which rotates between touches."""
    return SharedError("tip offset", SHARED_SD**2 * np.eye(3)), SO3.exp(0.7 * rng.normal(size=(len(away), 3)))


def larger_ball(rng, away):
    """Return the error of a ball that is larger than stated, on bosses."""
    return SharedError("ball", np.array([[SHARED_SD**2]])), -away[..., None]


def off(kind, make, known, seed, trials=TRIALS):
    """Errors of fits whose points share an error, and their whole covariances."""
    rng, errors, covariances = np.random.default_rng(seed), [], []
    for _ in range(trials):
        T, (q, away) = random_frame(rng), round_points(kind, 200, N)
        away = away @ T[:3, :3].T
        error, J = make(rng, away)
        c = np.linalg.cholesky(error.covariance) @ rng.normal(size=len(error.covariance))
        points = SE3.apply(T, q) + SD * rng.normal(size=(N, 3)) - J @ c
        side = {} if kind == "circle" else {"directions": -away}
        size = {"size": size_of(kind)} if known else {}
        covs = np.tile(SD**2 * np.eye(3), (N, 1, 1))
        feature, _ = ft.fit_round(KINDS[kind], points, covs, shared=[(error, J)], **side, **size)
        e, C = error_of(kind, feature.T_world_feature, T, feature.size.value, size_of(kind)), whole_covariance(feature)
        errors.append(e[:-1] if known else e)
        covariances.append(C[:-1, :-1] if known else C)
    return np.array(errors), np.array(covariances)


@pytest.mark.parametrize("kind", ["circle", "cylinder", "cone", "sphere"])
def test_a_rotating_tip_is_separated_from_the_feature(kind):
    """The offset would move single points by ten micrometres; its like is found out of sixteen of them."""
    e, C = off(kind, turned_tip, False, 1)
    total, dim = nees(e, C).sum(), e.shape[1]
    low, high = special.chdtri(dim * TRIALS, [0.999, 0.001])
    assert low < total < high
    place = np.sqrt(np.mean(e[:, :2] ** 2))
    assert place < 0.6 * SHARED_SD


@pytest.mark.parametrize("kind", ["cylinder", "sphere"])
def test_a_larger_ball_shows_where_the_radius_is_known(kind):
    e, C = off(kind, larger_ball, True, 2)
    low, high = special.chdtri(e.shape[1] * TRIALS, [0.999, 0.001])
    assert low < nees(e, C).sum() < high
    assert np.sqrt(np.mean(e[:, :2] ** 2)) < 0.2 * SHARED_SD


@pytest.mark.parametrize("kind", ["cylinder", "cone", "sphere"])
def test_gains_hold_beside_sensed_normals(kind):
    """A point that is elsewhere has another normal, too."""
    rng, (q, away) = np.random.default_rng(6), round_points(kind, 250, N)
    T = random_frame(rng)
    points, covs, sds = SE3.apply(T, q), np.tile(SD**2 * np.eye(3), (N, 1, 1)), np.full(N, 1e-3)
    normals = away @ T[:3, :3].T
    dq = 1e-8 * rng.normal(size=points.shape)
    found, moved = (
        ft.round_ml(KINDS[kind], p, covs, normals=normals, normal_sds=sds, outward=normals)
        for p in (points, points + dq)
    )
    p = error_of(kind, found.fit.T, moved.fit.T, found.size, moved.size)
    np.testing.assert_allclose(p, np.einsum("nij,nj->i", found.fit.shared_jacobian, dq), rtol=5e-3, atol=5e-10)


def test_one_tip_makes_a_boss_larger_and_a_bore_smaller():
    """Their radii share the error by its name; the sum of both does not feel it."""
    rng, found = np.random.default_rng(3), []
    for kind, sign in ((SPHERE, 1), (CYLINDER, -1)):
        T, (q, away) = random_frame(rng), round_points(kind.name, 360, N)
        away = away @ T[:3, :3].T
        points = SE3.apply(T, q) + sign * 1e-3 * away + SD * rng.normal(size=(N, 3))
        covs = np.tile(SD**2 * np.eye(3), (N, 1, 1))
        feature, _ = ft.fit_round(kind, points, covs, directions=-sign * away, tip_radius=1e-3, tip_radius_sd=SHARED_SD)
        found.append((feature.shared[-1].error.name, float(feature.size.shared[-1][0, 0])))
    T, turn = random_frame(rng), np.radians([0.0, 120.0, 240.0])
    away = np.c_[np.cos(turn), np.sin(turn), 0 * turn]
    rim, _ = ft.circle_on_plane(
        SE3.apply(T, (RADIUS - 1e-3) * away), np.tile(SD**2 * np.eye(3), (3, 1, 1)),
        Feature(PLANE, T, np.diag([1e-6, 1e-5, 1e-5]) ** 2, "top"), convex=False, tip_radius=1e-3,
        tip_radius_sd=SHARED_SD,
    )  # fmt: skip
    found.append((rim.shared[-1].error.name, float(rim.size.shared[-1][0, 0])))
    assert [name for name, _ in found] == ["tip radius"] * 3
    assert [gain for _, gain in found] == pytest.approx([-1.0, 1.0, 1.0], abs=1e-3)


def test_an_uncertain_tip_has_a_side_and_a_spread():
    rng = np.random.default_rng(7)
    q, away = round_points("sphere", 360, N)
    points, covs = q + SD * rng.normal(size=q.shape), np.tile(SD**2 * np.eye(3), (N, 1, 1))
    with pytest.raises(SideError, match="a boss from outside or a bore from inside"):
        ft.fit_round(SPHERE, points, covs, tip_radius_sd=1e-5)
    for sd in (-1e-5, np.nan):
        with pytest.raises(InputError, match="tip_radius_sd: expected zero or more"):
            ft.fit_round(SPHERE, points, covs, directions=-away, tip_radius_sd=sd)
    with pytest.raises(InputError, match="expected points of its rim"):
        ft.fit_round(KINDS["circle"], *(x[:8] for x in (points, covs)), tip_radius_sd=1e-5)


def test_a_rigid_error_changes_no_fit():
    rng = np.random.default_rng(4)
    T, (q, _) = random_frame(rng), round_points("cone", 200, N)
    points, covs = SE3.apply(T, q) + SD * rng.normal(size=(N, 3)), np.tile(SD**2 * np.eye(3), (N, 1, 1))
    J = np.concatenate([np.broadcast_to(np.eye(3), (N, 3, 3)), -SO3.hat(points)], axis=-1)
    base = SharedError("robot base", np.diag([1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3]) ** 2)
    alone, shared = (ft.fit_round(KINDS["cone"], points, covs, shared=s)[0] for s in ((), [(base, J)]))
    np.testing.assert_array_equal(alone.T_world_feature, shared.T_world_feature)
    np.testing.assert_array_equal(alone.P, shared.P)


def test_a_circle_at_a_known_height_over_a_plane():
    """Three touches of the wall of a counterbore, whose floor is 4 mm below the face that is known."""
    rng, errors, covariances = np.random.default_rng(5), [], []
    turn = np.radians([0.0, 120.0, 240.0])
    away = np.c_[np.cos(turn), np.sin(turn), 0 * turn]
    L = np.diag([2e-6, 1e-4, 1e-4])
    for _ in range(TRIALS):
        T = random_frame(rng)
        at = T @ SE3.from_parts(np.eye(3), np.array([0.02, 0.01, -4e-3]))
        points = SE3.apply(at, RADIUS * away + [0, 0, 2e-3]) + SD * rng.normal(size=(3, 3))
        face = Feature(PLANE, T @ SE3.exp(-PLANE.B.T @ L @ rng.normal(size=3)), L @ L, "top")
        height = -4e-3 + 5e-6 * rng.normal()
        rim, _ = ft.circle_on_plane(
            points, np.tile(SD**2 * np.eye(3), (3, 1, 1)), face, height=height, height_sd=5e-6, convex=False
        )
        errors.append(error_of("circle", rim.T_world_feature, at, rim.radius, RADIUS))
        covariances.append(rim.full_covariance)
    low, high = special.chdtri(6 * TRIALS, [0.999, 0.001])
    assert low < nees(np.array(errors), np.array(covariances)).sum() < high
    with pytest.raises(InputError, match="height"):
        ft.circle_on_plane(points, np.tile(SD**2 * np.eye(3), (3, 1, 1)), face, height=np.nan)
