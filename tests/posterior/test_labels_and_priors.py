"""Labelled readings and what was known of the pose: both count, neither silences the other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from bare_scenes import nees
from scenes import points_on_plane, random_pose
from tanteo import Readings, identify
from tanteo.geometry import SE3, SO3
from tanteo.parts import read_part
from tanteo.posterior import PosePrior, Priors, Table
from tanteo.posterior.unknown import log_between
from tanteo.sensors.error_states import Drift, Form, Scale

PARTS = Path(__file__).parents[2] / "examples" / "parts"
SD = 1e-4
ROUGH = np.repeat([3e-3, 0.03], 3)


@pytest.fixture(scope="module")
def parts():
    return {
        name: read_part(PARTS / f"{name}.step") for name in ("bracket_left", "bracket_right", "square_post", "block")
    }


def labelled(part, T, planes, rng, n=4, bare=0):
    """So many touches of each of those planes, from outside, with labels; and as many bare ones of the first."""
    points = [SE3.apply(T, points_on_plane(part, k, n, rng)) for k in planes]
    labels = [f"face {k}" for k in planes for _ in range(n)]
    points.append(SE3.apply(T, points_on_plane(part, planes[0], bare, rng)))
    into = -np.concatenate(
        [np.tile(part.planes.normals[k], (n, 1)) for k in planes] + [part.planes.normals[[planes[0]] * bare]]
    )
    seen = np.concatenate(points)
    return Readings.from_columns(
        seen + SD * rng.normal(size=seen.shape), sds=np.full(len(seen), SD), features=labels + [""] * bare,
        directions=into @ T[:3, :3].T,
    )  # fmt: skip


def some_planes(part, rng, count=5):
    return rng.permutation(np.argsort(-part.planes.areas)[:9])[:count]


def squared(h, T):
    xi = SE3.log(SE3.inverse(h.T_world_part) @ T)
    return float(xi @ np.linalg.solve(h.covariance, xi))


@pytest.mark.parametrize("seed", range(6))
def test_an_uninformative_box_changes_nothing(parts, seed):
    rng, part = np.random.default_rng(seed), parts["bracket_left"]
    T = random_pose(rng)
    readings, others = labelled(part, T, some_planes(part, rng), rng), [parts["bracket_left"], parts["bracket_right"]]
    wide = Priors(pose=PosePrior(box=np.array([[-2.0] * 3, [2.0] * 3])))
    alone, boxed = identify(readings, others), identify(readings, others, priors=wide)
    assert boxed.status == alone.status
    assert boxed.hypotheses
    assert boxed.message == alone.message
    for a, b in zip(alone.hypotheses, boxed.hypotheses, strict=True):
        assert b.T_world_part == pytest.approx(a.T_world_part, abs=1e-9)
        assert b.covariance == pytest.approx(a.covariance, rel=1e-6)
    assert boxed.hypotheses[0].pairings == alone.hypotheses[0].pairings


def test_a_box_elsewhere_speaks_against_the_part(parts):
    rng, part = np.random.default_rng(1), parts["bracket_left"]
    readings = labelled(part, random_pose(rng), some_planes(part, rng), rng)
    answer = identify(readings, [part], priors=Priors(pose=PosePrior(box=np.array([[4.0] * 3, [5.0] * 3]))))
    assert answer.status == "unknown"
    assert answer.hypotheses[0].part == part.name
    assert "Check the prior pose, or omit it" in answer.message


@pytest.mark.quick_sets(1)
@pytest.mark.parametrize("away", [0.5, 5.0, 5e3])
def test_far_outside_of_box_ps_stay_numbers_that_sum_to_one(parts, away):
    """Nine faces of forty touches: an unknown part is out of the question, until the box is."""
    rng, part = np.random.default_rng(11), parts["bracket_left"]
    readings = labelled(part, random_pose(rng), range(9), rng, n=40)
    box = np.array([[away] * 3, [away + 0.1] * 3])
    answer = identify(readings, [part], priors=Priors(pose=PosePrior(box=box)), top=100)
    total = answer.unknown_probability + sum(h.probability for h in answer.hypotheses)
    assert total == pytest.approx(1.0, abs=1e-9)


def test_the_log_probability_of_a_range_is_right_near_and_far():
    low, high = np.array([-1.0, -50.0, 3.0, 60.0, -0.2]), np.array([2.0, -40.0, 4.0, np.inf, 0.1])
    exact = [-0.2001663, -804.6084420, -6.6314678, -1805.0135607, -2.1278964]  # by quadrature
    assert log_between(low, high) == pytest.approx(exact, abs=1e-6)


@pytest.mark.parametrize("scenes", [25, pytest.param(60, marks=pytest.mark.slow)])
def test_pose_and_covariance_are_of_readings_and_prior(parts, scenes):
    """Three planes that leave no freedom, and a prior pose of equal accuracy: NEES over many scenes."""
    part, values, sizes = parts["bracket_left"], [], []
    fine = np.repeat([5e-5, 1e-3], 3)
    for k in range(scenes):
        rng = np.random.default_rng((2, k))
        T = random_pose(rng)
        rough = T @ SE3.exp(fine * rng.normal(size=6))
        readings = labelled(part, T, some_planes(part, rng), rng)
        answer = identify(readings, [part], priors=Priors(pose=PosePrior(rough, np.diag(fine**2))))
        best = answer.hypotheses[0]
        values.append(squared(best, T))
        sizes.append(best.chi2 / best.dof)
    low, high = chi2.ppf([0.001, 0.999], 6 * len(values)) / len(values)
    assert low < np.mean(values) < high
    assert np.mean(sizes) == pytest.approx(1.0, abs=0.15)  # and what is tested is counted rightly


@pytest.mark.slow
def test_a_prior_pose_settles_what_two_planes_leave_free(parts):
    part, values = parts["bracket_left"], []
    for k in range(40):
        rng = np.random.default_rng((3, k))
        T = random_pose(rng)
        normals = part.planes.normals
        first = int(np.argmax(part.planes.areas))
        second = int(np.argmax(part.planes.areas * (np.abs(normals @ normals[first]) < 0.1)))
        readings = labelled(part, T, [first, second], rng)
        free = identify(readings, [part]).hypotheses[0].covariance  # as far as the faces reach
        assert np.sqrt(np.diag(free)[:3].max()) > 5e-3
        rough = T @ SE3.exp(ROUGH * rng.normal(size=6))
        best = identify(readings, [part], priors=Priors(pose=PosePrior(rough, np.diag(ROUGH**2)))).hypotheses[0]
        assert not best.unobserved
        values.append(squared(best, T))
    low, high = chi2.ppf([0.001, 0.999], 6 * len(values)) / len(values)
    assert low < np.mean(values) < high


def test_a_prior_names_one_of_symmetric_poses(parts):
    """And the faces that were sensed are called as in that pose."""
    part = parts["square_post"]
    assert part.symmetry.order > 1
    for k in range(8):
        rng = np.random.default_rng((4, k))
        T, planes = random_pose(rng), some_planes(part, rng, 4)
        readings = labelled(part, T, planes, rng)
        rough = T @ SE3.exp(ROUGH * rng.normal(size=6))
        best = identify(readings, [part], priors=Priors(pose=PosePrior(rough, np.diag(ROUGH**2)))).hypotheses[0]
        assert squared(best, T) < 30
        faces = {int(name.split()[1]) for _, name in best.pairings}
        assert faces == set(part.planes.faces[planes])


def across(hypothesis, part):
    """Return the standard deviation of the centroid along x [m]."""
    R, C = hypothesis.T_world_part[:3, :3], hypothesis.covariance
    J = (R @ np.hstack([np.eye(3), -SO3.hat(part.centroid)]))[0]
    return float(np.sqrt(J @ C @ J))


def test_a_pose_at_the_border_of_a_box_is_mean_of_what_is_inside(parts):
    part, rng = parts["bracket_left"], np.random.default_rng(11)
    readings = labelled(part, random_pose(rng), some_planes(part, rng), rng)
    exact = Scale(1e-9), Drift(1e-9), Form(1e-9)  # otherwise assumed errors dominate both
    alone = identify(readings, [part], shared_errors=exact).hypotheses[0]
    centre = SE3.apply(alone.T_world_part, part.centroid)
    box = centre + np.array([[5e-5, -0.02, -0.02], [0.04, 0.02, 0.02]])
    answer = identify(readings, [part], priors=Priors(pose=PosePrior(box=box)), shared_errors=exact)
    assert answer.status == "recognized"
    best = answer.hypotheses[0]
    assert SE3.apply(best.T_world_part, part.centroid)[0] > box[0, 0] - 5e-7
    assert across(best, part) < 0.8 * across(alone, part)


def test_a_pose_that_a_box_contradicts_keeps_its_readings(parts):
    """What the box leaves of its distribution are poses far from all readings, with the fit of another one."""
    part, rng = parts["bracket_left"], np.random.default_rng(11)
    readings = labelled(part, random_pose(rng), some_planes(part, rng), rng)
    alone = identify(readings, [part]).hypotheses[0]
    for outside in (5e-3, 0.5):
        box = SE3.apply(alone.T_world_part, part.centroid) + np.array([[outside, -0.02, -0.02], [1.0, 0.02, 0.02]])
        answer = identify(readings, [part], priors=Priors(pose=PosePrior(box=box)))
        assert answer.status == "unknown"
        assert "not at the prior pose" in answer.message
        best = answer.hypotheses[0]
        np.testing.assert_allclose(best.T_world_part, alone.T_world_part, atol=1e-9)
        assert (best.chi2, best.dof, best.rms) == pytest.approx((alone.chi2, alone.dof, alone.rms))


@pytest.mark.slow
def test_a_table_at_another_height_is_named(parts):
    part, rng = parts["block"], np.random.default_rng(10)
    T = SE3.exp(np.array([0.2, 0.1, 0.3, 0, 0, 0.7]))
    readings = labelled(part, T, range(6), rng)
    low = Table(np.array([0, 0, 0.25 + part.box[0, 2]]), np.array([0.0, 0, 1]), 1e-3)
    answer = identify(readings, [part], priors=Priors(pose=PosePrior(table=low)))
    assert answer.status == "unknown"
    assert "block, but it is not at the prior pose" in answer.message


def test_a_table_decides_between_parts_on_it(parts):
    """Two labelled faces that stand on it leave the height free, which it fixes."""
    part, rng = parts["block"], np.random.default_rng(5)
    sides = [k for k in range(len(part.planes)) if abs(part.planes.normals[k][2]) < 0.1 and part.planes.areas[k] > 2e-3]
    x = sides[0]
    y = next(k for k in sides if abs(part.planes.normals[k] @ part.planes.normals[x]) < 0.1)
    T = SE3.exp(np.array([0.2, 0.1, 0.3, 0, 0, 0.7]))
    table = Table(np.array([0, 0, 0.3 + part.box[0, 2]]), np.array([0.0, 0, 1]), 2e-4)
    readings = labelled(part, T, [x, y], rng, n=6)
    loose = identify(readings, [part]).hypotheses[0].corner_sd  # the ends of the faces hold the height a little
    best = identify(readings, [part], priors=Priors(pose=PosePrior(table=table))).hypotheses
    right = [h for h in best if nees(part, h.T_world_part, h.covariance, T)[0] < 30]
    assert right
    assert not right[0].unobserved
    assert right[0].corner_sd < 0.6 * loose


def test_a_prior_pose_far_off_is_doubted(parts):
    part, rng = parts["bracket_left"], np.random.default_rng(6)
    T = random_pose(rng)
    readings = labelled(part, T, some_planes(part, rng), rng)
    off = T @ SE3.exp(np.array([0.05, 0, 0, 0, 0, 0]))
    answer = identify(readings, [part], priors=Priors(pose=PosePrior(off, np.diag(ROUGH**2))))
    assert answer.status == "unknown"
    assert "Check the prior pose, or omit it" in answer.message


def test_labels_stand_beside_readings_without(parts):
    part, rng = parts["bracket_left"], np.random.default_rng(7)
    answer = identify(labelled(part, random_pose(rng), some_planes(part, rng), rng, n=5, bare=2), [part])
    assert answer.hypotheses[0].part == part.name


def test_too_few_readings_of_a_label_go_to_the_surface(parts):
    """Three, two and one touch on three faces of a block: labels that nothing can be fitted to."""
    part, rng = parts["block"], np.random.default_rng(8)
    planes = [np.argmax(part.planes.normals @ axis * part.planes.areas) for axis in np.eye(3)]
    T = random_pose(rng)
    points = np.concatenate([points_on_plane(part, k, n, rng) for k, n in zip(planes, (3, 2, 1), strict=True)])
    into = -np.repeat(part.planes.normals[planes], (3, 2, 1), axis=0) @ T[:3, :3].T
    readings = Readings.from_columns(
        SE3.apply(T, points) + SD * rng.normal(size=points.shape), sds=np.full(6, SD), features=list("AAABBC"),
        directions=into,
    )  # fmt: skip
    rough = T @ SE3.exp(ROUGH * rng.normal(size=6))
    answer = identify(readings, [part], priors=Priors(pose=PosePrior(rough, np.diag(ROUGH**2))))
    assert squared(answer.hypotheses[0], T) < 30


def test_a_prior_eight_sds_off_is_named_among_many_readings(parts):
    part, rng, fine = parts["bracket_left"], np.random.default_rng(9), np.repeat([2e-4, 5e-3], 3)
    T = random_pose(rng)
    readings = labelled(part, T, some_planes(part, rng, 9), rng, n=12)
    off = T @ SE3.exp(np.array([1.6e-3, 0, 0, 0, 0, 0]))
    answer = identify(readings, [part], priors=Priors(pose=PosePrior(off, np.diag(fine**2))))
    assert answer.status == "unknown"
    assert "not at the prior pose" in answer.message
