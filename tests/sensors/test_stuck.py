"""A sensor with one range everywhere raises a question; equal ranges of one place, or by chance, do not."""

import numpy as np
import pytest

from tanteo.sensors import Readings
from tanteo.sensors.anomalies import find_stuck


def ranges(values, *, sensors=None, places=None):
    n = len(values)
    hands = np.tile(np.eye(4), (n, 1, 1))
    hands[:, 0, 3] = np.arange(n) if places is None else places
    return Readings.from_columns(ranges=values, sensors=sensors or ["eye"] * n, Ts_world_hand=hands)


@pytest.mark.parametrize(("value", "other", "least"), [(0.10342, 0.2, 4), (0.1, 0.20013, 4), (0.1, 0.2, 7)])
def test_so_many_equal_ranges_are_no_chance(value, other, least):
    """The number is lower if the device shows a fine resolution elsewhere."""
    other = [other, other + 0.01]
    assert find_stuck(ranges([*other, *[value] * (least - 1), *other])) is None
    words = find_stuck(ranges([*other, *[value] * least, *other])).message
    assert words.startswith(f"The {least} ranges 3 to {least + 2} of 'eye' are all {1e3 * value:g} mm")


def test_repeats_with_other_sensors_between_are_no_run():
    assert find_stuck(ranges([0.10342] * 9, places=np.zeros(9))) is None
    mixed = ranges([0.10342, 0.3] * 5, sensors=["left", "right"] * 5)
    assert "1 to 9 of 'left'" in find_stuck(mixed).message
    assert find_stuck(ranges([0.10342, 0.3] * 5)) is None


def test_readings_without_a_range_raise_no_question():
    assert find_stuck(Readings.from_columns(np.zeros((9, 3)))) is None
    assert find_stuck(ranges([0.1] * 0)) is None
