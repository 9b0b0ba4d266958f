"""Readings of curved faces: compared with the surface itself, not with the facets of its mesh."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from bare_scenes import SENSORS, box_centred_pose, nees, no_paths, scene, surface_points, touches_of
from tanteo import Readings, locate
from tanteo.lie import SE3, SO3
from tanteo.matching import Priors
from tanteo.parts import read_part
from tanteo.surface_search import identify_touches, prepare_target
from tanteo.surface_search.likelihood import explain
from tanteo.surface_search.modes import weigh
from tanteo.surface_search.polish import polish

PARTS = Path(__file__).parents[2] / "examples" / "parts"


@pytest.fixture(scope="module")
def flange():
    return prepare_target(read_part(PARTS / "flange.step"))


def with_normals(target, curved, flat, rng, sd, tilt):
    """So many readings of curved faces and of flat ones, with sensed normals, and the pose."""
    T = box_centred_pose(rng)
    p, n = surface_points(target, 3000, rng)
    on = target.curved.rows[target.surface.closest(p).triangles] >= 0
    rows = np.r_[np.flatnonzero(on)[:curved], np.flatnonzero(~on)[:flat]]
    turned = SO3.exp(tilt * rng.normal(size=(len(rows), 3))) @ (n[rows] @ T[:3, :3].T)[..., None]
    points = SE3.apply(T, p[rows]) + sd * rng.normal(size=(len(rows), 3))
    return touches_of(points, sd, normals=turned[..., 0], normal_sd=tilt), T


def test_every_curved_face_of_the_flange_is_known_exactly(flange):
    kinds = np.array([face.surface for face in flange.part.faces])[flange.part.triangle_face]
    assert ((flange.curved.rows >= 0) == (kinds == "cylinder")).all()
    points, _ = surface_points(flange, 2000, np.random.default_rng(1))
    away = flange.borders.nearest(points, np.zeros(len(points)))[0] > 2e-4  # at a rim the nearest place is on the rim
    assert np.abs(flange.distance(points[away])[0]).max() < 1e-9
    assert np.abs(replace(flange, curved=None).distance(points)[0]).max() > 2e-5  # so far are facets off


def test_touches_of_a_hundredth_of_a_millimetre_are_believed_and_place_it_as_well_as_they_say(flange):
    """Of facets 36 micrometres deep, as the mesh has them, a quarter of such readings would be of no known part."""
    values = []
    for k in range(25):
        rng = np.random.default_rng((1, k))
        T = box_centred_pose(rng)
        touches, _, _ = scene(flange, T, SENSORS[0], 25, rng)
        answer = identify_touches(touches, no_paths(), [flange], priors=Priors(radius=flange.part.radius))
        assert answer.status == "recognized"
        best = answer.hypotheses[0]
        assert not best.outliers
        values.append(nees(flange.part, best.T_world_part, best.covariance, T)[0])
    low, high = chi2.ppf([0.001, 0.999], 6 * len(values)) / len(values)
    assert low < np.mean(values) < high


def test_derivatives_of_sensed_normals_on_cylinders_are_those_of_differences(flange):
    touches, T = with_normals(flange, 12, 0, np.random.default_rng(3), 1e-5, 0.05)
    priors, z = Priors(radius=flange.part.radius), np.zeros((1, 0))
    here = explain(touches, T[None], z, flange, priors)
    scales = np.repeat([np.abs(here.J[..., :3]).max(), np.abs(here.J[..., 3:]).max()], 3)
    for k, step in enumerate(1e-6 * np.eye(6)):
        ahead, back = (explain(touches, (T @ SE3.exp(s * step))[None], z, flange, priors).r for s in (1, -1))
        slope = (ahead - back)[0] / 2e-6
        assert here.J[0, :, k] == pytest.approx(slope, abs=1e-3 * scales[k])


def test_a_cylinder_that_turns_about_its_axis_keeps_its_normals(flange):
    """Taken as planes they would tell of that turn, of which they know nothing."""
    touches, T = with_normals(flange, 12, 0, np.random.default_rng(4), 1e-4, 0.02)
    own = flange.curved.rows[flange.surface.closest(SE3.apply(SE3.inverse(T), touches.points)).triangles]
    face = np.bincount(own).argmax()
    touches = touches.take(np.flatnonzero(own == face))
    a, c = flange.curved.profiles.axes[face], flange.curved.profiles.points[face]
    spin = np.r_[np.cross(c, a), a]
    J = explain(touches, T[None], np.zeros((1, 0)), flange, Priors(radius=flange.part.radius)).J[0, len(touches) :]
    whole = np.linalg.norm(J[:, 3:], axis=0).max()
    assert np.linalg.norm(J @ spin) < 0.05 * whole


def test_normals_are_off_by_their_tilt_and_by_how_far_the_nearest_place_is_from_the_one_met(flange):
    """Noise of a fifth of the bores' radius: with the tilt alone, squares would come out many times too large."""
    sd, tilt, rng = 1e-3, 0.05, np.random.default_rng(5)
    p, n = surface_points(flange, 20000, rng)
    rows = flange.curved.rows[flange.surface.closest(p).triangles]
    away = flange.borders.nearest(p, np.zeros(len(p)))[0] > 5 * sd
    wide = flange.curved.profiles.offsets[np.maximum(rows, 0)] > 8 * sd
    some = np.flatnonzero((rows >= 0) & away & wide)[:600]
    turned = (SO3.exp(tilt * rng.normal(size=(len(some), 3))) @ n[some, :, None])[..., 0]
    points = p[some] + sd * rng.normal(size=(len(some), 3))
    touches = touches_of(points, sd, normals=turned, normal_sd=tilt)
    r = explain(touches, np.eye(4)[None], np.zeros((1, 0)), flange, Priors(radius=flange.part.radius)).r
    squares = np.sum(r[0, len(some) :].reshape(-1, 3) ** 2, axis=1)
    assert squares.mean() == pytest.approx(2.0, abs=0.25)


@pytest.mark.slow
@pytest.mark.parametrize("base_sd", [0.0, 5e-4])
def test_readings_with_normals_place_the_flange_as_well_as_they_say(flange, base_sd):
    """Half of them on its cylinders; NEES of 60 poses, climbed to from the truth."""
    values, priors = [], Priors(radius=flange.part.radius)
    for k in range(60):
        rng = np.random.default_rng((6, k))
        touches, T = with_normals(flange, 8, 8, rng, 3e-4, 0.03)
        if base_sd:
            shift = base_sd * rng.normal(size=3)
            gains = np.broadcast_to(base_sd * np.eye(3), (len(touches), 3, 3))
            touches = replace(touches, points=touches.points - shift, gains=gains)
        found = polish(touches, no_paths(), T[None], flange, priors)
        mode = weigh(touches, no_paths(), [(flange, found)], -np.inf, 1, priors)[0][0]
        values.append(nees(flange.part, found.Ts[0], mode.covariance, T)[0])
    low, high = chi2.ppf([0.001, 0.999], 6 * len(values)) / len(values)
    assert low < np.mean(values) < high


@pytest.mark.slow
def test_a_ball_tip_with_sensed_normals_places_it_as_well_as_it_says(flange):
    """A tip of 3 mm in bores of 7 mm: its centre and the normal are two readings, not one moved by the other."""
    values, r, sd, tilt = [], 3e-3, 1e-4, 0.05
    for k in range(25):
        rng = np.random.default_rng((8, k))
        T = box_centred_pose(rng)
        p, n = surface_points(flange, 3000, rng)
        fits = np.abs(flange.distance(p + r * n)[0] - r) < 1e-6
        p, n = p[fits], n[fits]
        on = flange.curved.rows[flange.surface.closest(p).triangles] >= 0
        rows = np.r_[np.flatnonzero(on)[:10], np.flatnonzero(~on)[:10]]
        centres = SE3.apply(T, p[rows] + r * n[rows]) + sd * rng.normal(size=(20, 3))
        turned = (SO3.exp(tilt * rng.normal(size=(20, 3))) @ (n[rows] @ T[:3, :3].T)[..., None])[..., 0]
        sensed = {"sds": np.full(20, sd), "radii": np.full(20, r), "normals": turned, "normal_sds": np.full(20, tilt)}
        answer = locate(Readings.from_columns(centres, **sensed), flange.part)
        if answer.status == "recognized":
            best = answer.hypotheses[0]
            values.append(nees(flange.part, best.T_world_part, best.covariance, T)[0])
    assert len(values) > 21
    low, high = chi2.ppf([0.001, 0.999], 6 * len(values)) / len(values)
    assert low < np.mean(values) < high
