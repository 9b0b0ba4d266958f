"""A box that truncates the poses: the answer is the part of the density inside it, for every seed."""

from __future__ import annotations

import numpy as np
import pytest

from bare_scenes import box_centred_pose, no_paths, surface_points, touches_of
from tanteo.geometry import SE3
from tanteo.posterior import PosePrior, Priors, Problem, prepare
from tanteo.posterior.update import posterior_about

SD = 1e-5


def answered(target, touches, T, seed, box=None):
    priors = Priors(radius=target.part.radius, pose=None if box is None else PosePrior(box=box), noise_factor=1)
    posterior = posterior_about(Problem(touches, no_paths(), priors), target, T[None], np.random.default_rng(seed))
    return posterior.modes[0]


@pytest.fixture(scope="module")
def scene(parts):
    """A pose with a nearly normal posterior, and the centroid in many samples of it."""
    target, rng = prepare(parts["bracket_left"]), np.random.default_rng(11)
    T = box_centred_pose(rng)
    touches = touches_of(SE3.apply(T, surface_points(target, 20, rng)[0]) + SD * rng.normal(size=(20, 3)), SD)
    alone = answered(target, touches, T, 0)
    Ts = alone.T_world_part @ SE3.exp(rng.multivariate_normal(np.zeros(6), alone.covariance, 400_000))
    return target, touches, T, Ts, SE3.apply(Ts, target.part.centroid)


@pytest.mark.parametrize("beyond", [-1.0, 1.0, 3.0])
def test_the_pose_in_a_box_is_a_truncated_normal(scene, beyond):
    """The border is some standard deviations beyond the most probable pose, in x; rejected samples reveal it."""
    target, touches, T, Ts, at = scene
    edge = at[:, 0].mean() + beyond * at[:, 0].std()
    inside = at[:, 0] > edge
    box = np.array([[edge, *(at.mean(axis=0) - 1e-2)[1:]], at.mean(axis=0) + 1e-2])
    whole = box - np.array([[1e-2, 0, 0], [0, 0, 0]])  # twice the volume, half the density
    masses = [answered(target, touches, T, 0, whole).log_mass + np.log(2 * inside.mean())]
    for seed in range(3):
        mode = answered(target, touches, T, seed, box)
        away = SE3.log(SE3.inverse(mode.T_world_part) @ Ts[inside])
        z = np.linalg.solve(np.linalg.cholesky(mode.covariance), away.T)
        # four standard deviations of a mean of 300 samples
        assert np.abs(z.mean(axis=1)).max() < 4 / np.sqrt(300)
        assert np.abs(np.mean(z * z, axis=1) - 1).max() < 4 * np.sqrt(2 / 300)
        masses.append(mode.log_mass)
    assert np.ptp(masses) < 0.2
