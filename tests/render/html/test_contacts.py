"""Contact points of readings on a part, and their distances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from report_scenes import SD, TRUTH, touches
from tanteo.geometry import SE3
from tanteo.planning import Sensing
from tanteo.recognition import locate
from tanteo.render.html import find_contacts, gather
from tanteo.sensors import Readings


@pytest.fixture(scope="module")
def answer(wedge):
    return locate(touches(wedge, np.random.default_rng(1)), wedge).hypotheses[0]


def at_truth(answer, **changes):
    return replace(answer, T_world_part=TRUTH, **changes)


def test_a_point_off_face_is_off_by_that_and_outside_is_positive(wedge, answer):
    readings = Readings.from_columns(
        points=SE3.apply(TRUTH, np.array([[0.02, 0.02, 0.0312], [0.02, 0.02, 0.0295]])), sds=np.full(2, SD)
    )
    h = at_truth(answer, pairings=(("1", "face 0"),), outliers=("2",))
    contacts = find_contacts(gather(readings), wedge, h)
    assert contacts.distances == pytest.approx([1.2e-3, -0.5e-3], abs=1e-9)
    assert contacts.sds == pytest.approx(SD)
    assert list(contacts.used) == [True, False]
    assert SE3.apply(SE3.inverse(TRUTH), contacts.feet) == pytest.approx(np.array([[0.02, 0.02, 0.03]] * 2), abs=1e-9)


def test_the_ball_of_a_tip_is_one_radius_off(wedge, answer):
    readings = Readings.from_columns(
        points=SE3.apply(TRUTH, np.array([[0.02, 0.02, 0.0331]])), sds=[SD], radii=np.array([3e-3])
    )
    contacts = find_contacts(gather(readings), wedge, at_truth(answer, pairings=(("1", "face 0"),)))
    assert contacts.distances == pytest.approx([1e-4], abs=1e-9)


def test_an_excluded_reading_has_its_stated_distance(wedge, answer):
    readings = Readings.from_columns(points=SE3.apply(TRUTH, np.array([[0.02, 0.02, 0.032]])), sds=[SD])
    h = at_truth(answer, pairings=(), outliers=("1",), outlier_distances=(2.5e-3,))
    assert find_contacts(gather(readings), wedge, h).distances == pytest.approx([2.5e-3])


def test_edges_are_two_rows_and_corners_three(wedge, answer):
    k = int(np.argmax(wedge.edges.lengths))
    T, corner = wedge.edges.Ts_part_feature[k], wedge.corners.points[2]
    points = np.stack([T[:3, 3] + 3e-4 * T[:3, 1] + 4e-4 * T[:3, 2] + 0.01 * T[:3, 0], corner + np.array([0, 1e-3, 0])])
    readings = Readings.from_columns(points=SE3.apply(TRUTH, points), sds=np.full(2, SD))
    h = at_truth(answer, pairings=(("1", f"edge {k}"), ("2", "vertex 2")))
    contacts = find_contacts(gather(readings), wedge, h)
    assert contacts.distances == pytest.approx([5e-4, 1e-3], abs=1e-9)
    assert list(contacts.reading) == [0, 0, 1, 1, 1]


def test_rows_are_the_derivatives_of_the_distances(wedge, answer):
    readings = touches(wedge, np.random.default_rng(2))
    sensed = gather(readings)
    pairings = tuple((i, "") for i in readings.ids)
    contacts = find_contacts(sensed, wedge, at_truth(answer, pairings=pairings))
    step = 1e-7
    for k, xi in enumerate(step * np.eye(6)):
        moved = replace(at_truth(answer, pairings=pairings), T_world_part=TRUTH @ SE3.exp(xi))
        change = (find_contacts(sensed, wedge, moved).distances - contacts.distances) / step
        assert contacts.rows[:, k] == pytest.approx(-change, abs=1e-5)


def test_an_error_that_all_readings_share_is_not_in_distances(wedge, answer):
    """A sensor that reads 0.3 mm long along its beam: two opposite sides separate it from a shift."""
    rng = np.random.default_rng(3)
    exact = touches(wedge, rng)
    hands = np.broadcast_to(np.eye(4), (len(exact), 4, 4)).copy()
    hands[:, :3, 2] = exact.directions.values  # the tip's z is along the touch
    hands[:, :3, 0] = np.linalg.svd(exact.directions.values[:, None])[2][:, 1]
    hands[:, :3, 1] = np.cross(hands[:, :3, 2], hands[:, :3, 0])
    long = Readings.from_columns(
        points=exact.points.values + 3e-4 * exact.directions.values, directions=exact.directions, sds=exact.sds,
        features=exact.features, kinds=exact.kinds, Ts_world_hand=hands,
    )  # fmt: skip
    h = at_truth(answer, pairings=tuple((i, "") for i in exact.ids))
    known = find_contacts(gather(long, Sensing(tip_sd=(2e-3, 2e-3, 2e-3))), wedge, h)
    unknown = find_contacts(gather(long), wedge, h)
    assert np.median(np.abs(unknown.distances)) == pytest.approx(3e-4, rel=0.2)
    assert np.median(np.abs(known.distances)) < 1.5 * SD


def test_a_sensed_normal_fixes_two_rotations(wedge, answer):
    normal = TRUTH[:3, :3] @ np.array([0.0, 0.0, 1.0])
    readings = Readings.from_columns(
        points=SE3.apply(TRUTH, np.array([[0.02, 0.02, 0.03]])), sds=[SD], normals=normal[None],
        normal_sds=np.array([0.01]),
    )  # fmt: skip
    contacts = find_contacts(gather(readings), wedge, at_truth(answer, pairings=(("1", "face 0"),)))
    tilts = contacts.rows[1:]
    assert len(tilts) == 2
    assert tilts[:, :3] == pytest.approx(0.0)
    assert tilts[:, 5] == pytest.approx(0.0, abs=1e-9)  # a turn about the normal is not seen
    assert contacts.noise[1:] == pytest.approx(1e-4)
