"""The real time-of-flight runs as recordings of ROS: from a bag they are calibrated as from their tables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tanteo.io import read_readings
from tanteo.sensors import calibrate
from tof_planes import FOLDER, run

pytest.importorskip("rosbags", reason="the extra tanteo[bags] is not installed")

from recordings import Recording

pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason=f"no data at {FOLDER}")

REST, BETWEEN = 10.0, 0.1
"""How long the wrist rests at a place, and from one reading there to the next [s]."""


def recorded(readings, kind, folder):
    """Write a bag: the wrist rests at each place while the sensor repeats its reading; poses come between."""
    recording, begin, before = Recording(kind), 0.0, None
    for k, T in enumerate(readings.Ts_world_hand):
        if before is None or not np.array_equal(T, before):
            begin, count, before = begin + REST, 0, T
            recording.pose(begin - 0.05, T)
        t = begin + BETWEEN * count
        recording.range(t, readings.ranges[k], readings.sensors[k], least=0.0, most=4.0)
        recording.pose(t + 0.05, T)
        count += 1
    return recording.write(folder)


@pytest.mark.parametrize(
    ("sensor", "surface", "kind"), [("L3CX", "R1", "mcap"), pytest.param("6180", "W2", "ros1", marks=pytest.mark.slow)]
)
def test_a_bag_gives_the_same_answer(sensor, surface, kind, tmp_path):
    direct = run(sensor, surface)
    read = read_readings(recorded(direct, kind, tmp_path))
    assert len(read) == len(direct)
    assert np.allclose(read.ranges, direct.ranges, rtol=1e-6)
    assert np.allclose(read.Ts_world_hand, direct.Ts_world_hand, atol=1e-6)
    labelled = replace(read, features=direct.features, kinds=direct.kinds)  # a bag has no information about the surface
    found, expected = calibrate(labelled), calibrate(direct)
    assert found.status == expected.status
    assert found.planes[0].rms == pytest.approx(expected.planes[0].rms, abs=1e-6)
    assert np.allclose(found.planes[0].T_world_plane, expected.planes[0].T_world_plane, atol=1e-4)
