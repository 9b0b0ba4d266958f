"""The covariance given the shared errors is a conditional covariance: at most the covariance, and positive."""

from __future__ import annotations

import numpy as np
import pytest

import tanteo
from conftest import PARTS

RIG = """[sensors.tof]
preset = "tmf8820_zone3x3"
position_mm = [0, 0, 0]
quaternion_wxyz = [1, 0, 0, 0]
zones = [3, 3]
field_deg = [33, 32]
mount_sd_mm = 10
mount_turn_sd_deg = 3
"""
RANGES = (184, 177, 179, 187, 182, 188, 190, 192, 193)


@pytest.mark.slow
def test_shared_errors_known_never_widen_a_pose(tmp_path):
    (tmp_path / "rig.toml").write_text(RIG)
    (tmp_path / "log.csv").write_text(
        "\n".join([",".join(f"z{k}" for k in range(9)), ",".join(map(str, RANGES))]) + "\n"
    )
    rig = tanteo.read_rig(tmp_path / "rig.toml")
    readings = tanteo.read_readings(tmp_path / "log.csv", rig=rig, hand="400,200,200mm 180,0,0deg", unit="mm")
    answer = tanteo.locate(readings, tanteo.read_part(PARTS / "block.step"), rig=rig)
    assert len(answer.hypotheses) > 1
    for one in answer.hypotheses:
        C = one.covariance
        size = np.sqrt(np.diag(C))
        given = one.covariance_relative / np.outer(size, size)
        assert np.linalg.eigvalsh(given).min() > 0
        assert np.linalg.eigvalsh(C / np.outer(size, size) - given).min() > -1e-6
