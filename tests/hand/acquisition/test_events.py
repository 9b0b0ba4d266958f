"""Events on a line, and what speaks against one edge."""

import numpy as np
import pytest

from felt_scenes import gripper
from tanteo.geometry import SE3
from tanteo.hand.acquisition.edge_events import agreeing, distance_from, doubt, line_through, on_line, place_of
from tanteo.hand.motion import EdgeEvent
from tanteo.words.findings import EdgesMixed, FewEdgeCrossings, PlaceBeside

ALONG, OUTWARDS = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
SD = 4e-4


def event(x, y, sensor=0, sd=SD):
    """Return the event of a beam straight down at (x, y), 20 mm over the surface."""
    R = np.diag([1.0, -1.0, -1.0])
    foot = np.array([x, y, 0.0]) - R @ (gripper().origins[sensor] + [0, 0, 0.02])
    return EdgeEvent(sensor, SE3.from_parts(R, foot), 0.02, 1e-4, sd, True)


def edge(xs, ys, sensor=0, sd=SD):
    """There and back at every place."""
    return [event(x, y, sensor, sd) for x, y in zip(xs, ys, strict=True) for _ in range(2)]


def side_of(events):
    return doubt(gripper(), events, ALONG, OUTWARDS)[0]


def test_the_place_of_an_event():
    np.testing.assert_allclose(place_of(gripper(), event(0.03, -0.01)), [0.03, -0.01, 0.0], atol=1e-15)
    np.testing.assert_allclose(place_of(gripper(), event(0.03, -0.01, sensor=1)), [0.03, -0.01, 0.0], atol=1e-15)


def test_the_line_through_events():
    events = edge([0.0, 0.012, 0.024], [0.001, 0.0, -0.001])
    point, direction = line_through(gripper(), events)
    np.testing.assert_allclose(point, [0.012, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(np.abs(direction @ [12, -1, 0]) / np.sqrt(145), 1.0, atol=1e-12)
    assert distance_from(gripper(), event(0.012, 0.003), (point, direction)) == pytest.approx(0.003 * 12 / np.sqrt(145))
    assert line_through(gripper(), edge([0.0], [0.0])) is None
    assert line_through(gripper(), []) is None
    assert (
        line_through(gripper(), edge([0.0, 0.003] * 8, [0.0] * 16)) is None
    )  # as near to each other, only more of them


def test_events_of_another_edge_are_left_out():
    line = line_through(gripper(), edge([0.0, 0.02], [0.0, 0.0]))
    near, far = event(0.01, 0.003), event(0.01, -0.005)
    assert on_line(gripper(), [far, near, far], line) == [near]


def test_one_straight_edge_is_not_doubted():
    """The rate is that of its gate: 3.3 standard deviations of a few residuals."""
    rng, doubted, n = np.random.default_rng(0), 0, 400
    xs = np.array([-0.032, -0.02, -0.008, 0.008, 0.02, 0.032])
    for _ in range(n):
        ys = 0.05 * xs + rng.normal(size=len(xs)) * SD / np.sqrt(2)
        doubted += bool(side_of(edge(xs, ys)))
    assert doubted <= 10


@pytest.mark.parametrize("k", range(6))
def test_a_place_of_another_edge_is_found(k):
    xs = np.array([-0.032, -0.02, -0.008, 0.008, 0.02, 0.032])
    ys = np.where(np.arange(6) == k, 0.004, 0.0)
    assert isinstance(side_of(edge(xs, ys)), PlaceBeside)
    assert side_of(edge(xs, 0 * ys)) is None


@pytest.mark.parametrize("k", range(5))
def test_one_place_of_another_edge_is_left_out(k):
    xs = np.array([-0.02, -0.01, 0.0, 0.01, 0.02])
    off = edge(xs, np.where(np.arange(5) == k, 0.0035, 0.0))
    kept, why = agreeing(gripper(), off, ALONG, OUTWARDS)
    assert why is None
    assert kept == off[: 2 * k] + off[2 * k + 2 :]
    clean = edge(xs, 0 * xs)
    assert agreeing(gripper(), clean, ALONG, OUTWARDS) == (clean, None)


def test_more_is_not_left_out():
    """Of four places none, of six not two; and none that leaves the others in doubt."""
    four = edge([-0.02, -0.01, 0.01, 0.02], [0, 0.0035, 0, 0])
    two = edge(np.arange(6) * 0.01, [0.004, 0, 0, 0, 0, 0.004])
    alone = edge([0.0, 0.006, 0.012, 0.018, 0.1], [0, 0.004, 0, 0, 0])
    for events in (four, two, alone):
        kept, why = agreeing(gripper(), events, ALONG, OUTWARDS)
        assert why
        assert kept == events


def test_most_hits_must_be_on_one_edge():
    """Of fourteen events of several edges five are on one line by chance sooner or later."""
    events = edge([-0.02, 0.0, 0.02], [0, 0, 0])
    assert agreeing(gripper(), events, ALONG, OUTWARDS, 12) == (events, None)
    assert agreeing(gripper(), events, ALONG, OUTWARDS, 13)[1] == EdgesMixed(13, 6)
    doubtful = edge([0, 0.003], [0, 0])
    assert agreeing(gripper(), doubtful, ALONG, OUTWARDS, 13)[1] == FewEdgeCrossings(len(doubtful), alone=False)


def test_three_places_control_each_other():
    """There and back meet the same corner: the number of events does not help, the middle place does."""
    xs = np.array([-0.01, 0.0, 0.01])
    assert side_of(edge(xs, [0, 0, 0])) is None
    assert isinstance(side_of(edge(xs, [0, 0, 0.0027])), PlaceBeside)
    assert side_of(edge(xs[:2], [0, 0]) * 4) == FewEdgeCrossings(16, alone=False)
    assert side_of([]) == FewEdgeCrossings(0, alone=False)
    assert side_of(edge([0, 0.003, 0.006, 0.009], [0] * 4)) == FewEdgeCrossings(8, alone=False)
    assert side_of(edge([-0.006, 0.0, 0.07], [0, 0, 0])) == FewEdgeCrossings(6, alone=True)


def test_sensors_may_differ_by_their_mounting():
    """Sharp events of two sensors in turn, 0.5 mm apart: their mounting is not known better; 1 mm is too much."""
    for apart, doubted in ((5e-4, False), (1e-3, True)):
        one = edge([-0.03, -0.01, 0.01], [0, 0, 0], sensor=0, sd=1e-5)
        other = edge([-0.02, 0.0, 0.02], [apart] * 3, sensor=1, sd=1e-5)
        assert bool(side_of(one + other)) == doubted
