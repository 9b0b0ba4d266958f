"""Where the hand may be: distances from bounds and forbidden boxes, with the whole body, at many poses at once."""

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.hand import ForbiddenBox, Workspace, gripper_body
from tanteo.io import read_rig

POSED = SE3.from_parts(SO3.exp(np.array([0.3, -0.5, 0.8])), np.array([0.2, -0.1, 0.4]))
BOX = ForbiddenBox("clamp", np.array([-0.1, -0.05, 0.0]), np.array([0.2, 0.05, 0.3]), POSED)


@pytest.fixture(scope="module")
def body():
    return gripper_body(read_rig("paper-gripper"))


def some_points(n=4000, seed=0):
    return SE3.apply(POSED, np.random.default_rng(seed).uniform(-0.4, 0.6, (n, 3)))


def test_the_distance_of_a_box_is_that_of_its_nearest_point():
    points = some_points()
    local = SE3.apply(SE3.inverse(POSED), points)
    to_nearest = np.linalg.norm(local - np.clip(local, BOX.low, BOX.high), axis=1)
    depth = np.minimum(local - BOX.low, BOX.high - local).min(axis=1)
    inside = depth > 0
    assert 20 < inside.sum() < len(points) - 20
    np.testing.assert_allclose(BOX.distances(points)[0], np.where(inside, -depth, to_nearest), atol=1e-12)


def test_the_way_out_of_a_box_is_the_gradient_of_the_distance():
    points, h = some_points(seed=1), 1e-7
    _, away = BOX.distances(points)
    slopes = np.stack(
        [(BOX.distances(points + h * e)[0] - BOX.distances(points - h * e)[0]) / (2 * h) for e in np.eye(3)]
    )
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), 1, atol=1e-12)
    # but for the few points at which two faces are equally near
    assert (np.abs(slopes.T - away).max(axis=1) < 1e-5).mean() > 0.999


def test_from_the_middle_of_a_box_there_is_a_way_out():
    far, away = BOX.distances(SE3.apply(POSED, 0.5 * (BOX.low + BOX.high)))
    assert far == pytest.approx(-0.05)
    assert np.linalg.norm(away) == pytest.approx(1)


def test_bounds_and_boxes_in_their_order():
    space = Workspace(np.array([-np.inf, 0, 0]), np.array([np.inf, 1, np.inf]), [BOX])
    assert [("y" in s, "z" in s, "clamp" in s) for s in space.limits] == [
        (True, False, False), (False, True, False), (True, False, False), (False, False, True)
    ]  # fmt: skip
    point = np.array([0.0, 0.2, 0.5])
    found, away = space.clearances(point)
    np.testing.assert_allclose(found[:3], [0.2, 0.5, 0.8])
    np.testing.assert_allclose(away[:3], [[0, 1, 0], [0, 0, 1], [0, -1, 0]])
    assert found[3] == BOX.distances(point)[0]
    np.testing.assert_array_equal(away[3], BOX.distances(point)[1])


def test_the_whole_body_counts_at_every_pose(body):
    space = Workspace(np.array([-np.inf, -np.inf, 0.0]), np.full(3, np.inf), [BOX])
    Ts = SE3.exp(np.random.default_rng(2).normal(size=(7, 5, 6)) * [0.2, 0.2, 0.2, 1, 1, 1])
    clear = space.clear(body, Ts)
    assert clear.shape == (7, 5)
    for k in np.ndindex(7, 5):
        centres = SE3.apply(Ts[k], body.centres)
        expected = np.minimum(centres[:, 2], BOX.distances(centres)[0]) - body.radii
        assert clear[k] == pytest.approx(expected.min(), abs=1e-12)
    np.testing.assert_array_equal(space.allows(body, Ts), clear >= 0)
    np.testing.assert_array_equal(space.allows(body, Ts, 0.08), clear >= 0.08)
    assert 0 < space.allows(body, Ts, 0.08).sum() < space.allows(body, Ts).sum() < 35


def test_a_box_beside_the_palm_alone_is_enough(body):
    """The fingers end 100 mm before the palm's frame: at this box only the palm is."""
    beside = ForbiddenBox("rail", np.array([0.02, -0.1, -0.02]), np.array([0.2, 0.1, 0.0]))
    assert Workspace.everywhere().allows(body, np.eye(4))
    assert not Workspace.everywhere([beside]).allows(body, np.eye(4))
    ahead = SE3.from_parts(np.eye(3), np.array([0.0, 0.0, 0.08]))
    assert Workspace.everywhere([beside]).allows(body, ahead)


def test_no_limits(body):
    space = Workspace.everywhere()
    assert space.limits == ()
    assert np.isinf(space.clear(body, np.eye(4)))
    assert space.clearances(np.zeros((4, 3)))[0].shape == (4, 0)
    assert Workspace.above(0.3).low[2] == 0.3


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Workspace(np.ones(3), np.zeros(3)), "workspace: expected a low and a high corner"),
        (lambda: Workspace.everywhere([BOX, BOX]), "expected forbidden boxes with unique names"),
        (lambda: ForbiddenBox("b", np.zeros(2), np.ones(2)), "'b': expected a low and a high corner"),
        (lambda: ForbiddenBox("b", np.zeros(3), np.array([1, 1, np.inf])), "'b': expected finite corners"),
        (lambda: ForbiddenBox("b", np.zeros(3), np.ones(3), 2 * np.eye(4)), "'b': expected a rigid pose"),
    ],
)
def test_limits_that_are_none(make, message):
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize("margin", [0.0, 0.03])
def test_a_way_leads_through_a_box_if_some_place_is_inside(margin):
    """Against many places on every way; ways along a side of the box, too."""
    rng, box = np.random.default_rng(2), ForbiddenBox("same", BOX.low - margin, BOX.high + margin, POSED)
    starts, ends = rng.uniform(-0.4, 0.6, (2, 3000, 3))
    ends[::3, 0], ends[::7, 1:] = starts[::3, 0], starts[::7, 1:]
    starts, ends = SE3.apply(POSED, starts), SE3.apply(POSED, ends)
    places = starts[:, None] + np.linspace(0, 1, 400)[:, None] * (ends - starts)[:, None]
    gaps = box.distances(places)[0].min(axis=1)
    sure = np.abs(gaps) > 2e-3
    assert 300 < (gaps[sure] < 0).sum() < 2000
    np.testing.assert_array_equal(BOX.crossed(starts, ends, margin)[sure], gaps[sure] < 0)


def test_a_way_along_a_box_does_not_lead_through_it():
    box = ForbiddenBox("table", np.array([-1.0, -1, -1]), np.array([1.0, 1, 0]))
    starts = np.array([[0, 0, 0.3], [-2.0, 0, 0], [0, 0, 0.3], [0, 0, 0.3]])
    ends = np.array([[0, 0, 0.0], [2.0, 0, 0], [0, 0, -1e-6], [0, 0, -2.0]])
    np.testing.assert_array_equal(box.crossed(starts, ends), [False, False, True, True])
