"""Maxima of one region become one mode: about the best of them, with the moments of the whole."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bare_scenes import SENSORS, box_centred_pose, no_paths, scene
from tanteo.lie import SE3
from tanteo.matching import Priors
from tanteo.parts import read_part
from tanteo.surface_search import prepare_target
from tanteo.surface_search.modes import Mode, _one_region
from tanteo.surface_search.moments import Moments
from tanteo.surface_search.polish import polish

PARTS = Path(__file__).parents[2] / "examples" / "parts"


def test_moments_about_another_maximum_are_those_of_the_same_draws():
    target, rng = prepare_target(read_part(PARTS / "bracket_left.step")), np.random.default_rng(1)
    T = box_centred_pose(rng)
    touches, _, _ = scene(target.surface, T, SENSORS[1], 15, rng)
    scale = np.array([1e-3, 2e-3, 1e-3, 0.02, 0.01, 0.03])
    apart = T @ SE3.exp(2 * scale)
    found = polish(touches, no_paths(), np.stack([T, T]), target, Priors(radius=0.1))
    found.Ts[0], found.Ts[1] = T, apart
    draws = SE3.exp(scale * (1 + rng.normal(size=(20_000, 6))))  # about T, their mean between both

    def about(base):
        xi = SE3.log(SE3.inverse(base) @ T @ draws)
        return xi.mean(axis=0), xi.T @ xi / len(xi)

    mean, covariance = about(apart)
    other = Mode(target, found, 1, -3.0, Moments(mean, covariance, covariance, 0.5))
    joined = _one_region(Mode(target, found, 0, -2.0), other)
    assert joined.k == 0
    assert joined.log_mass == -2.0
    true_mean, true_covariance = about(T)
    np.testing.assert_allclose(joined.moments.mean / scale, true_mean / scale, atol=0.1)
    np.testing.assert_allclose(
        joined.moments.covariance / np.outer(scale, scale), true_covariance / np.outer(scale, scale), atol=0.2
    )
