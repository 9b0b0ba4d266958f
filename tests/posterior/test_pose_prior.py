"""What is known of the pose beforehand: derivatives, and what it does to the answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.factors import FreeRays, surface_points
from tanteo.geometry import SE3
from tanteo.parts import read_part
from tanteo.posterior import PosePrior, Priors, Table, identify_points
from tanteo.posterior.answers import prior_rows


@pytest.fixture(scope="module")
def part(request):
    return read_part(request.config.rootpath / "examples" / "parts" / "block.step")


def touches_at(points, sd=1e-4):
    return surface_points(points, sd)


def on_surface(part, n, rng, faces=None):
    corners = part.vertices[part.triangles]
    if faces is not None:
        corners = corners[np.isin(part.triangle_face, faces)]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    a, b, c = corners[rng.choice(len(corners), n, p=areas / areas.sum())].transpose(1, 0, 2)
    u, v = np.sort(rng.uniform(size=(2, n, 1)), axis=0)
    return u * a + (v - u) * b + (1 - v) * c


def test_rows_against_differences(part):
    rng = np.random.default_rng(1)
    A = rng.normal(size=(6, 6))
    prior = PosePrior(SE3.exp(rng.normal(size=6)), A @ A.T, table=Table(rng.normal(size=3), rng.normal(size=3), 0.1))
    Ts, h = SE3.exp(0.5 * rng.normal(size=(5, 6))), 1e-6
    r, J = prior_rows(prior, part, Ts)
    assert r.shape == (5, 7)
    for k, e in enumerate(h * np.eye(6)):
        plus, minus = (prior_rows(prior, part, Ts @ SE3.exp(s * e))[0] for s in (1, -1))
        np.testing.assert_allclose(J[..., k], (plus - minus) / (2 * h), atol=1e-6)


def test_a_prior_pose_decides_between_the_poses_of_a_corner(part):
    """ContactPoints on three faces of a box fit every corner; a prior pose leaves one."""
    rng = np.random.default_rng(2)
    truth = SE3.exp(np.array([0.4, -0.2, 0.1, 0.3, 0.2, -0.5]))
    corner = [i for i, f in enumerate(part.faces) if f.axis_direction is not None and f.axis_direction.max() > 0.9]
    pool = [on_surface(part, 400, rng, [face]) for face in corner]
    near = [p[np.linalg.norm(p - part.box[1], axis=1) < 0.03] for p in pool]
    local = np.concatenate([p[:n] for p, n in zip(near, (3, 3, 2), strict=True)])
    touches = touches_at(SE3.apply(truth, local))
    free = identify_points(touches, FreeRays.none(), [part])
    assert free.status != "recognized"
    rough = truth @ SE3.exp(rng.normal(size=6) * np.r_[np.full(3, 5e-3), np.full(3, 0.03)])
    prior = PosePrior(rough, np.diag(np.r_[np.full(3, 25e-6), np.full(3, 1e-3)]))
    known = identify_points(touches, FreeRays.none(), [part], priors=Priors(radius=part.radius, pose=prior))
    best = known.hypotheses[0]
    assert known.status == "recognized"
    e = SE3.log(SE3.inverse(best.T_world_part) @ truth)
    assert e @ np.linalg.solve(best.covariance, e) < 22.5


def test_two_touches_more_than_a_table_fix_nothing_else(part):
    """On a table three directions are known; the covariance has exactly these."""
    rng = np.random.default_rng(3)
    low = part.box[0, 2]
    touches = touches_at(on_surface(part, 8, rng, [_top(part)]))
    prior = PosePrior(table=Table(np.array([0.0, 0.0, low]), np.array([0.0, 0.0, 1.0]), 1e-4))
    answer = identify_points(touches, FreeRays.none(), [part], priors=Priors(radius=part.radius, pose=prior))
    assert answer.status == "insufficient"
    assert answer.hypotheses[0].unobserved
    for hypothesis in answer.hypotheses[:1]:
        heights = SE3.apply(hypothesis.T_world_part, part.vertices)[:, 2]
        assert heights.min() == pytest.approx(low, abs=1e-3)


def _top(part):
    return next(i for i, f in enumerate(part.faces) if f.axis_direction is not None and f.axis_direction[2] > 0.9)


def test_a_box_refuses_poses_outside(part):
    rng = np.random.default_rng(4)
    touches = touches_at(on_surface(part, 20, rng))
    here = part.centroid + np.array([[-0.01], [0.01]])
    inside = Priors(radius=part.radius, pose=PosePrior(box=here))
    outside = Priors(radius=part.radius, pose=PosePrior(box=here + 1.0))
    assert identify_points(touches, FreeRays.none(), [part], priors=inside).status == "recognized"
    assert identify_points(touches, FreeRays.none(), [part], priors=outside).status == "unknown"


@pytest.mark.parametrize(
    "make",
    [
        lambda: PosePrior(np.eye(4)),
        lambda: PosePrior(np.eye(4), np.zeros((6, 6))),
        lambda: PosePrior(box=np.array([[1, 1, 1], [0, 2, 2.0]])),
        lambda: Table(np.zeros(3), np.zeros(3), 1.0),
        lambda: Table(np.zeros(3), np.ones(3), 0.0),
    ],
)
def test_half_given_priors_are_refused(make):
    with pytest.raises(InputError, match="expected"):
        make()


def test_the_workspace_is_that_of_the_largest_part_unless_given(part):
    touches = touches_at(on_surface(part, 20, np.random.default_rng(5)))
    given, open_ = (
        identify_points(touches, FreeRays.none(), [part], priors=p)
        for p in (Priors(radius=part.radius), Priors(unknown=0.05))
    )
    assert open_.unknown_probability == pytest.approx(given.unknown_probability, rel=1e-9)


def test_a_prior_pose_names_one_of_the_symmetric_poses(part):
    """The same solid, once with its symmetry unknown: both explain the readings equally, prior pose or not."""
    rng = np.random.default_rng(7)
    assert part.symmetry.order == 4
    plain = replace(part, name="plain", symmetry=replace(part.symmetry, Ts=np.eye(4)[None]))
    truth = SE3.exp(np.array([0.1, 0.2, 0.3, 0.1, -0.2, 0.3]))
    touches = touches_at(SE3.apply(truth, on_surface(part, 12, rng)))
    rough = PosePrior(truth, np.diag(np.r_[np.full(3, 5e-3), np.full(3, 0.05)]) ** 2)
    for pose in (None, rough):
        answer = identify_points(
            touches, FreeRays.none(), [part, plain], top=100, priors=Priors(radius=part.radius, pose=pose)
        )
        of_plain = sum(h.probability for h in answer.hypotheses if h.part == "plain")
        assert of_plain == pytest.approx(0.5, abs=0.02)


def test_a_contradicted_prior_is_not_overruled_in_silence(part):
    rng = np.random.default_rng(8)
    touches = touches_at(on_surface(part, 12, rng))
    wrong = PosePrior(SE3.exp(np.array([0.03, 0.03, 0.03, 0, 0, 0])), np.diag(np.full(6, 1e-3)) ** 2)
    answer = identify_points(touches, FreeRays.none(), [part], priors=Priors(radius=part.radius, pose=wrong))
    assert answer.status == "unknown"


@pytest.mark.slow
def test_a_wrong_prior_is_named_where_readings_agree(part):
    """Eight deviations off: lost in the joint test of a hundred readings, which then were widened to make it fit."""
    for k in range(5):
        rng = np.random.default_rng((9, k))
        truth = SE3.exp(0.3 * rng.normal(size=6))
        touches = touches_at(SE3.apply(truth, on_surface(part, 100, rng)) + 3e-4 * rng.normal(size=(100, 3)), 3e-4)
        rough = truth @ SE3.exp(np.array([8e-4, 0, 0, 0, 0, 0]))
        prior = PosePrior(rough, np.diag(np.repeat([1e-4, 1e-3], 3)) ** 2)
        answer = identify_points(touches, FreeRays.none(), [part], priors=Priors(radius=part.radius, pose=prior))
        assert answer.status == "unknown"
        assert "not at the prior pose" in answer.message
        assert "scatter" not in answer.message


@pytest.mark.parametrize(
    "T",
    [
        np.diag([1.03, 1.03, 1.03, 1.0]), np.diag([1.0, 1.0, -1.0, 1.0]), np.eye(4)[[2, 1, 0, 3]],
        np.eye(4) + np.outer([0, 0, 0, 1.0], [1.0, 2.0, 3.0, 0]), np.eye(3), np.full((4, 4), np.nan),
    ],
    ids=["scaled", "mirrored", "axes swapped", "last row", "3 x 3", "nan"],
)  # fmt: skip
def test_a_prior_pose_that_is_no_rigid_motion_is_refused(T):
    with pytest.raises(InputError, match="prior, T_world_part: expected"):
        PosePrior(T_world_part=T, covariance=1e-4 * np.eye(6))
