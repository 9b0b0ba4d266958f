"""Maxima of one region become one mode: about the best of them, with the moments of the whole."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from bare_scenes import SENSORS, box_centred_pose, no_paths, scene
from tanteo.lie import SE3
from tanteo.matching import Priors
from tanteo.matching.part_motions import part_scale, spins
from tanteo.parts import read_part
from tanteo.surface_search import modes, prepare_target
from tanteo.surface_search.mode import Mode
from tanteo.surface_search.modes import _one_region, _weighed, weigh
from tanteo.surface_search.moments import Moments
from tanteo.surface_search.polish import polish

PARTS = Path(__file__).parents[2] / "examples" / "parts"


def test_moments_about_another_maximum_are_those_of_the_same_draws():
    target, rng = prepare_target(read_part(PARTS / "bracket_left.step")), np.random.default_rng(1)
    T = box_centred_pose(rng)
    touches, _, _ = scene(target, T, SENSORS[1], 15, rng)
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


@pytest.mark.parametrize(("widths", "moved"), [((1.0, 0.01), 0), ((0.01, 1.0), 1)])
def test_maxima_of_one_region_count_once_about_the_best(monkeypatch, widths, moved):
    """Two maxima, one of them weighed as wide as both: the other is within it, whichever is the better one."""
    target, rng = prepare_target(read_part(PARTS / "bracket_left.step")), np.random.default_rng(2)
    T = box_centred_pose(rng)
    touches, _, _ = scene(target, T, SENSORS[1], 15, rng)
    scale, priors = np.array([1e-3, 1e-3, 1e-3, 0.01, 0.01, 0.01]), Priors(radius=0.1)
    found = polish(touches, no_paths(), np.stack([T, T]), target, priors)
    Ts = np.stack([T, T @ SE3.exp(0.5 * scale)])
    found = replace(found, Ts=Ts, log_evidence=np.array([50.0, 49.0]), kin=np.full(2, -50.0))

    def weighed(touches, free, mode, priors):
        C = np.diag((widths[mode.k] * scale) ** 2)
        return replace(mode, moments=Moments(np.zeros(6), C, C, 0.0))

    monkeypatch.setattr(modes, "_weighed", weighed)
    (only,), unknown, _ = weigh(touches, no_paths(), [(target, found)], -100.0, 1, priors)
    assert only.k == 0
    assert only.probability + unknown == pytest.approx(1.0)
    shift = SE3.log(SE3.inverse(T) @ Ts[moved])
    np.testing.assert_allclose(only.moments.mean, shift, atol=1e-12)
    np.testing.assert_allclose(only.moments.covariance, np.diag(scale**2) + np.outer(shift, shift), atol=1e-12)


def test_facets_of_a_round_part_do_not_fix_its_spin(tmp_path, monkeypatch):
    """What the facets feign to resist is not handed on to what looks about the maximum."""
    trimesh.creation.cylinder(20, 60, sections=96).export(tmp_path / "pin.stl")
    target, rng = prepare_target(read_part(tmp_path / "pin.stl", unit="mm")), np.random.default_rng(3)
    T, seen = box_centred_pose(rng), []
    touches, _, _ = scene(target, T, SENSORS[1], 25, rng)
    found = polish(touches, no_paths(), T[None], target, Priors(radius=0.1))
    spin = part_scale(target.part) @ spins(target.part)[0]
    feigned = 1e3 * np.outer(spin, spin)
    found.information[0] += feigned
    monkeypatch.setattr(modes, "posterior_moments", lambda density, T, z, information, *_: seen.append(information))
    _weighed(touches, no_paths(), Mode(target, found, 0, 0.0), Priors(radius=0.1))
    assert spin @ found.information[0] @ spin > 1.0
    assert np.abs(seen[0] @ spin).max() < 1e-6
