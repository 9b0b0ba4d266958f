"""Descriptors: known shapes, invariance, derivatives by differences, covariance by simulation."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.stats import chi2

from tanteo.errors import InputError
from tanteo.vision.descriptors import DESCRIPTOR_NAMES, describe, descriptor_values, gradient

L_SHAPE = np.array([[0, 0], [60, 0], [60, 20], [25, 20], [25, 50], [0, 50]], dtype=float) + np.array([100, 80])
HU = [k for k, name in enumerate(DESCRIPTOR_NAMES) if name.startswith("hu")]


def normals_of(outline):
    tangents = np.roll(outline, -1, axis=0) - np.roll(outline, 1, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    return np.stack([tangents[:, 1], -tangents[:, 0]], axis=1)


def dense(outline, step=4.0):
    sides = np.roll(outline, -1, axis=0) - outline
    shares = [np.arange(0, 1, step / np.linalg.norm(side))[:, None] for side in sides]
    return np.concatenate([a + share * side for a, share, side in zip(outline, shares, sides, strict=True)])


def test_a_rectangle_is_as_in_the_book():
    got = dict(zip(DESCRIPTOR_NAMES, descriptor_values(np.array([[0, 0], [8.0, 0], [8, 2], [0, 2]])), strict=True))
    assert got["area"] == pytest.approx(16)
    assert got["perimeter"] == pytest.approx(20)
    assert (got["x"], got["y"]) == pytest.approx((4, 1))
    assert (got["long_axis"], got["short_axis"]) == pytest.approx((8 / np.sqrt(12), 2 / np.sqrt(12)))


def test_hu_s_invariants_are_opencv_s():
    expected = cv2.HuMoments(cv2.moments(L_SHAPE.astype(np.float32))).ravel()
    assert descriptor_values(L_SHAPE)[HU] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("angle", [0.3, 2.0, -1.2])
def test_they_do_not_change_when_the_shape_moves(angle):
    R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    moved, scaled = descriptor_values(L_SHAPE @ R.T + [7, -900]), descriptor_values(3.7 * L_SHAPE)
    still = descriptor_values(L_SHAPE)
    same = [0, 1, 4, 5, *HU]
    assert moved[same] == pytest.approx(still[same], rel=1e-6)
    assert scaled[HU] == pytest.approx(still[HU], rel=1e-6)
    assert scaled[0] == pytest.approx(3.7**2 * still[0])


def test_a_mirror_changes_only_the_sign_of_the_last():
    still, mirrored = descriptor_values(L_SHAPE)[HU], descriptor_values(L_SHAPE * [-1, 1])[HU]
    assert mirrored[:6] == pytest.approx(still[:6], rel=1e-9)
    assert mirrored[6] == pytest.approx(-still[6], rel=1e-9)


def test_the_sense_of_the_outline_does_not_matter():
    assert descriptor_values(L_SHAPE[::-1]) == pytest.approx(descriptor_values(L_SHAPE))


def test_the_derivatives_are_derivatives():
    J, h = gradient(L_SHAPE), 1e-5
    for i in range(len(L_SHAPE)):
        for c in (0, 1):
            step = np.zeros_like(L_SHAPE)
            step[i, c] = h
            difference = (descriptor_values(L_SHAPE + step) - descriptor_values(L_SHAPE - step)) / (2 * h)
            assert J[:, i, c] == pytest.approx(difference, rel=1e-4, abs=1e-9)


@pytest.mark.parametrize("bias", [0.0, 0.2])
def test_the_covariance_is_calibrated(bias):
    rng, runs = np.random.default_rng(4), 500
    outline = dense(L_SHAPE)
    normals, sds = normals_of(outline), rng.uniform(0.05, 0.3, len(outline))
    stated = describe(outline, normals, sds, bias)
    used = [
        k
        for k, name in enumerate(DESCRIPTOR_NAMES)
        if name in ("area", "x", "y", "long_axis", "short_axis", "hu1", "hu2")
    ]
    errors = []
    for _ in range(runs):
        off = rng.normal(0, sds) + bias * rng.normal()
        errors.append((descriptor_values(outline + off[:, None] * normals) - stated.values)[used])
    C = stated.covariance[np.ix_(used, used)]
    scale = np.sqrt(np.diag(C))
    values, vectors = np.linalg.eigh(C / np.outer(scale, scale))
    keep = values > 1e-6  # some descriptors are nearly functions of the others
    z = (np.array(errors) / scale) @ vectors[:, keep] / np.sqrt(values[keep])
    nees = np.sum(z**2, axis=1)
    # second-order terms have the size of the error over that of the shape
    low, high = chi2.ppf([0.001, 0.999], keep.sum() * runs) / runs
    assert 0.97 * low < nees.mean() < 1.03 * high


def test_no_area_is_refused():
    with pytest.raises(InputError, match="line"):
        descriptor_values(np.array([[0, 0], [1.0, 1], [2, 2]]))
    with pytest.raises(InputError, match="three"):
        descriptor_values(np.zeros((2, 2)))
