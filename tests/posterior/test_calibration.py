"""Probabilities are frequencies: scenes drawn from the stated model, outliers and absent parts included.

The full campaign of 2,000 scenes for each way of sensing is ``benchmarks/calibration.py``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from calibration import campaign

SCENES = 100
TARGET = 0.03


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mode", "settings"),
    [("touches", {"unknown": 1e-9, "outlier_rate": 1e-6}), ("touches", {}), ("planes", {}), ("edges", {})],
    ids=["parts of the catalogue", "touches, outliers and unknown objects", "planes", "edges"],
)
def test_claimed_is_right_as_often_as_claimed(mode, settings):
    rows = campaign(mode, SCENES, seed=5, **settings)
    claimed, right = rows[:, 0], rows[:, 1]
    se = np.sqrt((claimed * (1 - claimed)).sum()) / SCENES
    assert abs(claimed.mean() - right.mean()) < TARGET + 2.6 * se
    sure = claimed > 0.97
    assert sure.sum() > SCENES / 4
    assert right[sure].mean() > 0.92
