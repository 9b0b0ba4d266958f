"""Roots of covariances that rounding has made a little indefinite: a nearly free direction beside a sharp one."""

import numpy as np
import trimesh

import tanteo
from tanteo.posterior.sampling.widths import Axes, roots


def test_a_covariance_that_is_indefinite_by_rounding_has_a_root():
    v = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 0.0]) / np.sqrt(2)
    C = np.eye(6) - (1 + 1e-6) * np.outer(v, v)
    assert np.linalg.eigvalsh(C).min() < 0
    L = roots(np.stack([C, np.eye(6)]))
    np.testing.assert_allclose(L @ np.swapaxes(L, 1, 2), np.stack([C, np.eye(6)]), atol=1e-5)
    np.testing.assert_array_equal(L, np.tril(L))


def test_the_widths_of_axes_are_above_rounding():
    C = np.diag([1e-18, 1e-18, 1e-18, 1e-2, 1e-2, 1e-2])
    v = np.linalg.qr(np.random.default_rng(0).normal(size=(20, 6, 6)))[0]
    axes = Axes.of(v @ C @ np.swapaxes(v, 1, 2), np.ones(6))
    assert axes.widths.min() > 1e-10
    np.testing.assert_allclose(axes.widths[:, 3:], 0.1, rtol=1e-6)


def test_touches_of_a_nanometre_on_two_planes_are_answered():
    rng, faces = np.random.default_rng(0), np.zeros((8, 3))
    faces[:, :2] = rng.uniform(0.01, 0.03, (8, 2))
    faces[:4, 2], faces[4:] = 0.02, np.c_[np.full(4, 0.04), faces[4:, 0], np.full(4, 0.015)]
    box = trimesh.creation.box(bounds=[[0, 0, 0], [0.04, 0.03, 0.02]])
    block = tanteo.part_from_mesh(box.vertices, box.faces, unit="m", name="block")
    with np.errstate(divide="raise", invalid="raise"):
        answer = tanteo.locate(tanteo.Readings.from_columns(faces, sds=np.full(8, 1e-9)), block)
    assert answer.hypotheses
