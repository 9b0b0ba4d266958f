"""One of several groups of factors holds: the density is their mixture, and a prior of poses is one such factor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tanteo import _core, part_from_mesh
from tanteo.factors import ContactPoints, FreeRays
from tanteo.geometry import SE3
from tanteo.parts import read_part
from tanteo.posterior import OnTable, PoseMixture, Priors, Problem, prepare
from tanteo.posterior.alternatives import Alternatives, NormalPoses

PARTS = Path(__file__).parents[2] / "examples" / "parts"


def density(term, Ts):
    return _core.term_slopes(term, np.ascontiguousarray(Ts), np.zeros((len(Ts), 0)), np.zeros(3))[0]


def mixture(rng, count=2):
    xi = rng.normal(size=(count, 6)) * np.repeat([0.05, 1.0], 3)
    L = rng.normal(size=(count, 6, 6)) * 0.2 + np.eye(6)
    S = np.diag(np.repeat([0.01, 0.1], 3))
    return PoseMixture(SE3.exp(xi), S @ (L @ np.swapaxes(L, 1, 2)) @ S, np.log([0.7, 0.3][:count]))


@pytest.mark.parametrize("name", ["bracket_left", "block"])
def test_normal_poses_are_the_mixture_of_the_prior(name):
    """As the prior of a problem, but for the number of poses that symmetry makes one."""
    part = prepare(read_part(PARTS / f"{name}.step"))
    rng = np.random.default_rng(1)
    known = mixture(rng)
    Ts = known.Ts[[0, 0, 1, 1]] @ SE3.exp(rng.normal(size=(4, 6)) * np.repeat([0.01, 0.1], 3))
    prior = Problem(ContactPoints.none(), FreeRays.none(), Priors(radius=0.1), mixtures={part: known})
    expected = _core.log_densities(part.shape, prior.compiled(part), Ts, np.zeros((4, 0)))
    found = density(NormalPoses({part.part: known}).term(part.part, 0), Ts)
    np.testing.assert_allclose(found, expected - np.log(len(part.part.symmetry.Ts)), rtol=1e-9)


def test_normal_poses_of_a_round_part_do_not_resist_its_spin(tmp_path):
    """Its axis is not the frame's: turns about it are uniform, and have a density of one over a whole turn."""
    angles = 2 * np.pi * np.arange(96) / 96
    ring = 30 * np.c_[np.cos(angles), np.sin(angles)] + [50.0, -20.0]
    ends = [[50, -20, 0], [50, -20, 20]]
    i, j, n = np.arange(96), np.roll(np.arange(96), -1), np.full(96, 192)
    triangles = [np.c_[i, j, 96 + j], np.c_[i, 96 + j, 96 + i], np.c_[n, j, i], np.c_[n + 1, 96 + i, 96 + j]]
    vertices = np.concatenate([np.c_[ring, 0 * angles], np.c_[ring, 0 * angles + 20], ends])
    part = part_from_mesh(1e-3 * vertices, np.concatenate(triangles), unit="m", name="wheel")
    assert part.symmetry.continuous
    point, axis = part.symmetry.axis
    spin = np.r_[np.cross(point, axis), axis]
    C = np.diag(np.repeat([1e-3, 0.02], 3) ** 2)
    known = PoseMixture(np.eye(4)[None], C[None], np.zeros(1))
    term = NormalPoses({part: known}).term(part, 0)
    logs = density(term, SE3.exp(np.linspace(-0.05, 0.05, 9)[:, None] * spin))
    np.testing.assert_allclose(logs, logs[0], atol=1e-6)
    # the integral over shifts and turns, spins of a whole circle included, by samples of a wider density
    rng, wide = np.random.default_rng(5), np.repeat([2e-3, 0.04], 3)
    about = SE3.from_parts(np.eye(3), point)
    xi = rng.normal(size=(200_000, 6)) * wide
    across = xi - np.outer(xi[:, 3:] @ axis, np.r_[np.zeros(3), axis])  # at the middle, without its spin
    keep = across @ np.eye(6)
    q = -0.5 * np.sum((keep / wide) ** 2, axis=1) - 5 * 0.5 * np.log(2 * np.pi) - np.log(np.delete(wide, 5)).sum()
    value = density(term, about @ SE3.exp(keep) @ SE3.inverse(about))
    flips = len(part.symmetry.Ts)
    np.testing.assert_allclose(np.mean(np.exp(value - q)) * 2 * np.pi * flips, 1.0, atol=0.05)


def test_alternatives_sum_their_densities_and_slopes():
    part = read_part(PARTS / "block.step")
    rng = np.random.default_rng(3)
    known = mixture(rng)
    first = NormalPoses({part: known})
    second, third = NormalPoses({part: mixture(rng)}), OnTable(np.eye(4), 0.02, 0.2, 0.1)
    either = Alternatives(((first,), (second, third)), np.log([0.9, 0.1]), -1.5)
    assert (either.states, either.is_pose_prior, either.log_unknown) == (0, True, -1.5)
    assert len(either.poses(part)) == len(first.poses(part)) + len(second.poses(part))
    Ts = known.Ts[[0, 1, 0]] @ SE3.exp(rng.normal(size=(3, 6)) * np.repeat([0.01, 0.1], 3))
    one = density(first.term(part, 0), Ts) + np.log(0.9)
    other = density(second.term(part, 0), Ts) + density(third.term(part, 0), Ts) + np.log(0.1)
    term = either.term(part, 0)
    np.testing.assert_allclose(density(term, Ts), np.logaddexp(one, other), rtol=1e-12)
    slopes = _core.term_slopes(term, Ts, np.zeros((3, 0)), np.zeros(3))[1]
    for k in range(6):
        step = np.zeros(6)
        step[k] = 1e-6
        numeric = (density(term, Ts @ SE3.exp(step)) - density(term, Ts @ SE3.exp(-step))) / 2e-6
        np.testing.assert_allclose(slopes[:, k], numeric, rtol=1e-4, atol=1e-3)


def test_a_part_without_a_mixture_has_no_such_pose():
    block, wedge = (read_part(PARTS / f"{name}.step") for name in ("block", "wedge"))
    own = NormalPoses({block: mixture(np.random.default_rng(4))})
    either = Alternatives(((own,), (OnTable(np.eye(4), 0.02, 0.2, 0.1),)), np.log([0.5, 0.5]))
    rests = density(OnTable(np.eye(4), 0.02, 0.2, 0.1).term(wedge, 0), np.eye(4)[None])
    np.testing.assert_allclose(density(either.term(wedge, 0), np.eye(4)[None]), rests + np.log(0.5))
    assert len(own.poses(wedge)) == 0
