"""Fingertip touches of real and simulated objects, without correspondences: limits of the data, and the answers.

There is no truth of the poses; the published index is the mean distance of the points to the surface. The least that
any pose reaches is in ``benchmarks/fingertips.py``.
"""

from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import no_paths, touches_of
from tanteo.geometry import SE3
from tanteo.posterior import Priors, Problem, identify_points, prepare
from tanteo.posterior.update import posterior_about

FOLDER = Path(__file__).resolve().parents[2].parent / "shared" / "data" / "fingertip_touches"
pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason=f"no data at {FOLDER}")

SD = 5e-3
"""What is known of the fingertips [m]; these sets scatter more."""


def points_of(name):
    """Return the points of a file: ``OFF``, a line of counts, then one point a line."""
    lines = [line.split("#")[0].split() for line in (FOLDER / "touches" / f"{name}.off").read_text().splitlines()]
    rows = [line[:3] for line in lines if line][2:]
    return np.array(rows, dtype=float)


@pytest.fixture(scope="module")
def targets():
    out = {}
    for path in sorted((FOLDER / "models").glob("*.off")):
        out[path.stem] = prepare(tanteo.read_part(path, unit="m"))
    return out


def mean_distance(target, T, points):
    return float(target.surface.closest(SE3.apply(SE3.inverse(T), points)).distances.mean())


def located(targets, name, part, sd):
    points = points_of(name)
    return points, identify_points(touches_of(points, sd), no_paths(), [targets[part]], top=50)


def test_all_eleven_meshes_are_read_and_one_is_open(targets):
    assert len(targets) == 11
    assert [name for name, target in sorted(targets.items()) if not target.part.closed] == ["seashell"]
    np.testing.assert_array_equal(targets["cleaner"].part.vertices, targets["spray"].part.vertices)


@pytest.mark.slow
def test_real_cylinder(targets):
    """Target 5.75 mm; least squares, which maximum likelihood is, cannot be under 5.87 and no pose under 5.45.

    The posterior is flat there: from 5.87 to 6.01 mm maxima differ by less than 0.1 nats. The answer is its mean, a
    tenth of a millimetre and more off the maximum.
    """
    points, answer = located(targets, "measCylinder_exp", "cylinder", SD)
    best = answer.hypotheses[0]
    distances = [mean_distance(targets["cylinder"], h.T_world_part, points) for h in answer.hypotheses]
    assert (
        5.4e-3
        < mean_distance(targets["cylinder"], _peak(targets["cylinder"], best.T_world_part, points), points)
        < 6.1e-3
    )
    assert 5.4e-3 < distances[0] < 6.2e-3
    assert _evidence_beside(targets["cylinder"], best.T_world_part, points) < 0.1
    assert max(d for h, d in zip(answer.hypotheses, distances, strict=True) if h.probability > 1e-3) < 7.0e-3
    assert "times as much as stated" in answer.message
    # its spin is symmetry; its slide is observed, for fingers went past both ends: 220 mm of touches on 200 mm
    assert targets["cylinder"].part.symmetry.continuous
    assert best.unobserved == ()
    local = SE3.apply(SE3.inverse(best.T_world_part), points)
    assert np.ptp(local[:, 1]) > np.ptp(targets["cylinder"].part.box[:, 1])


def _peak(target, T, points):
    """Return the maximum that a search from one pose reaches."""
    problem = Problem(touches_of(points, 1.6 * SD), no_paths(), Priors(noise_factor=1.0, radius=target.part.radius))
    return posterior_about(problem, target, T[None], np.random.default_rng(0)).modes[0].T_peak


def _evidence_beside(target, T, points):
    """Return the log-evidence gain of a pose found from many starts over the maximum it leads to."""
    touches, priors = touches_of(points, 1.6 * SD), Priors(noise_factor=1.0, radius=target.part.radius)
    shaken = T @ SE3.exp(np.random.default_rng(0).normal(size=(300, 6)) * np.repeat([5e-3, 0.05], 3))
    problem = Problem(touches, no_paths(), priors)
    here, about = (
        posterior_about(problem, target, Ts, np.random.default_rng(0)).modes[0].log_mass for Ts in (T[None], shaken)
    )
    return max(about - here, 0.0)


@pytest.mark.slow
def test_real_cleaner(targets):
    """Least squares cannot be under 7.66 mm by much, no pose under 7.45; published 9.1.

    Noise that is taken for 11 mm has the points where more of the surface is near: farther than least squares.
    """
    points, answer = located(targets, "measCleaner_exp", "cleaner", SD)
    distances = [mean_distance(targets["cleaner"], h.T_world_part, points) for h in answer.hypotheses]
    assert 7.4e-3 < distances[0] < 8.5e-3
    assert max(distances) < 9.1e-3
    assert "times as much as stated" in answer.message


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("measTetra9_sim", "tetrahedron"),
        ("measTetra30_sim", "tetrahedron"),
        ("measBox15_sim", "box"),
        ("measBox100_sim", "box"),
    ],
)
def test_exact_sets_lie_on_the_surface(targets, name, part):
    points, answer = located(targets, name, part, 1e-4)
    assert answer.status == "recognized"
    assert answer.hypotheses[0].outliers == ()
    assert mean_distance(targets[part], answer.hypotheses[0].T_world_part, points) < 1e-5


def test_the_helmet_set_is_not_on_the_given_mesh_but_is_located(targets):
    """At the pose that the set was made in its points are 0.8 mm from the mesh: stated as the standard deviation."""
    points, answer = located(targets, "measHelmet_sim", "helmet", 1e-3)
    own = mean_distance(targets["helmet"], np.eye(4), points)
    assert 0.7e-3 < own < 0.9e-3
    assert answer.status == "recognized"
    best = answer.hypotheses[0]
    assert mean_distance(targets["helmet"], best.T_world_part, points) < own
    xi = SE3.log(best.T_world_part)
    assert np.linalg.norm(xi[:3]) < 5e-3
    assert np.linalg.norm(xi[3:]) < 0.05


UNEVEN = pytest.mark.xfail(
    strict=True, reason="touches are taken for even over the surface: of two bottles the smaller is 12 nats ahead"
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "part"),
    [("measCylinder_exp", "cylinder"), pytest.param("measCleaner_exp", "cleaner", marks=UNEVEN)],
)
def test_which_of_these(targets, name, part):
    answer = identify_points(touches_of(points_of(name), SD), no_paths(), list(targets.values()), top=1000)
    by_part = dict.fromkeys(targets, 0.0)
    for h in answer.hypotheses:
        by_part[h.part] += h.probability
    assert by_part[part] > 0.05
    twins = {"cleaner", "spray"} if part == "cleaner" else {part}
    assert all(p < 0.9 for other, p in by_part.items() if other not in twins)
    assert answer.unknown_probability < 0.9


@pytest.mark.slow
def test_the_robot_set_fits_another_mesh_and_is_rejected(targets):
    """Not at the pose of the file, not 113 mm lower, not anywhere: no pose has the points on the mesh within 1 mm."""
    points, answer = located(targets, "measRobot_sim", "robot", 1e-3)
    lower = np.eye(4)
    lower[2, 3] = -0.113
    assert mean_distance(targets["robot"], np.eye(4), points) > 30e-3
    shifted = mean_distance(targets["robot"], lower, points)
    assert shifted < 0.3 * mean_distance(targets["robot"], np.eye(4), points)
    assert answer.status == "unknown"
    assert "the readings contradict it" in answer.message  # nothing else is as like them
    assert mean_distance(targets["robot"], answer.hypotheses[0].T_world_part, points) < shifted
