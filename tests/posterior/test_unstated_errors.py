"""Unstated errors widen the covariance as their prior and the readings imply."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import beams, box_centred_pose, inside, nees
from tanteo.geometry import SE3, SO3
from tanteo.posterior import prepare
from tanteo.sensors import Rig, RigSensor, measure
from tanteo.sensors.error_states import Drift, Fan, Form, Scale

PARTS = Path(__file__).parents[2] / "examples" / "parts"
NOISE = 1e-4
TINY = Scale(1e-9), Drift(1e-9), Form(1e-9)


@pytest.fixture(scope="module")
def target():
    return prepare(tanteo.read_part(PARTS / "housing.step"))


def answer(target, k, *, displaced=None, shift=(0, 0, 0), noise=NOISE, count=20, **options):
    """Locate touches of a scene; ``displaced`` maps true points to sensed ones."""
    rng = np.random.default_rng(k)
    T = box_centred_pose(rng, 0.3)
    T[:3, 3] += shift
    p, d = beams(target, count, rng, tilt=0.02)
    p, d = SE3.apply(T, p), d @ T[:3, :3].T
    points = (p if displaced is None else displaced(p)) + noise * rng.normal(size=p.shape)
    readings = tanteo.Readings.from_columns(points=points, directions=d, sds=np.full(len(p), noise))
    return tanteo.locate(readings, target, conventions=False, **options), T


def covered(target, count, **options):
    """Return the number of truths in the 95 % regions."""
    found = [answer(target, k, **options) for k in range(count)]
    return sum(bool(inside(*nees(target.part, a.best.T_world_part, a.best.covariance, T))) for a, T in found if a.best)


def test_an_unstated_world_scale_is_covered(target):
    assert covered(target, 12, displaced=lambda p: 1.0007 * p) >= 9


def test_an_unstated_drift_is_covered(target):
    way = np.linspace(0, 3e-4, 20)[:, None] * np.array([0.6, 0.8, 0.0])
    assert covered(target, 12, displaced=lambda p: p + way) >= 9


def test_more_readings_do_not_remove_a_small_warp(target):
    free, straight = (answer(target, 1, count=200, shared_errors=e)[0].best.corner_sd for e in (TINY[:2], TINY))
    assert free > 1.3 * straight


def test_even_readings_are_covered_and_not_much_wider(target):
    pairs = [(answer(target, k)[0].best, answer(target, k, shared_errors=TINY)[0].best) for k in range(6)]
    ratios = [np.sqrt(np.trace(a.covariance[:3, :3]) / np.trace(b.covariance[:3, :3])) for a, b in pairs]
    assert 1 < np.median(ratios) < 2.5


def test_stated_errors_replace_the_assumed_ones(target):
    stated, free = (answer(target, 3, shared_errors=e)[0].best.corner_sd for e in (TINY, ()))
    alone = answer(target, 3, shared_errors=TINY[1:])[0].best.corner_sd
    assert stated < alone < free


def test_assumed_errors_do_not_enter_a_stated_estimate(target):
    found = [
        answer(target, 3, shift=(0.6, 0, 0), shared_errors=e)[0] for e in ((Scale(1e-3),), (Scale(1e-3), *TINY[1:]))
    ]
    variances = [a.best.shared.marginal[0, 0] for a in found]
    assert found[0].best.corner_sd > found[1].best.corner_sd
    assert variances[0] == pytest.approx(variances[1], rel=0.02)


def test_assumed_errors_are_in_proportion_to_the_noise(target):
    coarse, fine = (answer(target, 4, noise=noise)[0].best for noise in (5e-5, 5e-6))
    assert np.isclose(coarse.corner_sd / fine.corner_sd, 10, rtol=0.3)


def test_a_robot_has_its_own_errors_in_place_of_the_scale():
    readings = tanteo.Readings.from_columns(points=np.eye(3), sds=np.full(3, NOISE))
    names = [
        [e.name for e in measure(readings, robot=robot).unstated] for robot in (None, "generic_6axis_uncalibrated")
    ]
    assert names == [["scale", "drift", "form"], ["drift", "form"]]


def test_the_answer_names_unstated_errors(target):
    found = answer(target, 5, shift=(1.5, 0, 0))[0]
    named = [one for one in found.findings if one.kind == "shared_error"]
    assert [one.source for one in named] == ["unstated"]
    assert "--scale-sd" in found.message
    assert "unstated" not in [getattr(o, "source", "") for o in answer(target, 5, shared_errors=TINY)[0].findings]


def test_a_far_origin_is_not_that_of_a_machine(target):
    near, far = (answer(target, 7, shift=s)[0].best.corner_sd for s in ((2.0, 0, 0), (50.0, 0, 0)))
    assert far < 0.5 * near


def ranged(target, k, turn, *, mount=0.0, **options):
    """Locate by ranges of a laser 0.2 m from the part, which is mounted turned by an angle [rad]."""
    rng = np.random.default_rng(k)
    T, way = box_centred_pose(rng, 0.3), rng.normal(size=3) * (1, 1, 0)
    p, z = beams(target, 24, rng, tilt=0.2)
    x = np.cross(z, rng.normal(size=z.shape))
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    sensors = SE3.from_parts(np.stack([x, np.cross(z, x), z], axis=-1), p - 0.2 * z)
    hands = T @ sensors @ SE3.from_parts(SO3.exp(turn * way / np.linalg.norm(way)).T, np.zeros(3))
    rig = Rig((RigSensor("laser", np.eye(4), None, NOISE, 0.0, 1.0, 0.0, mount**2 * np.eye(6)),))
    readings = tanteo.Readings.from_columns(
        Ts_world_hand=hands, ranges=0.2 + NOISE * rng.normal(size=24), sensors=["laser"] * 24
    )
    return tanteo.locate(readings, target, rig=rig, conventions=False, seed=k, **options), T


@pytest.mark.slow
def test_unstated_angles_of_a_laser_are_estimated(target):
    rows = []
    for k in range(8):
        (free, T), (exact, _) = (ranged(target, k, np.radians(0.3), shared_errors=e) for e in ((), (Fan(1e-9),)))
        covering = inside(*nees(target.part, free.best.T_world_part, free.best.covariance, T))
        rows.append((free.status == "recognized", covering, free.best.corner_sd / exact.best.corner_sd))
    recognized, covering, ratio = np.array(rows, dtype=float).T
    assert recognized.sum() >= 7
    assert covering.sum() >= 6
    assert np.median(ratio) < 0.7  # without angles the noise explains the deviations


def test_a_straight_laser_loses_little_by_assumed_angles(target):
    ratios = [
        ranged(target, k, 0.0)[0].best.corner_sd / ranged(target, k, 0.0, shared_errors=(Fan(1e-9),))[0].best.corner_sd
        for k in range(4)
    ]
    assert 1.0 < np.median(ratios) < 1.6


def test_a_stated_mounting_error_replaces_assumed_angles(target):
    found = [ranged(target, 1, 0.0, mount=mount)[0] for mount in (0.0, 1e-5)]
    assert ["assumed_angles" in [one.kind for one in a.findings] for a in found] == [True, False]
    assert "The mounting error of laser is not stated: 0.3 deg" in found[0].message
