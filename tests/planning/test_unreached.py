"""Limits of the probe that are named where it reaches no place."""

from __future__ import annotations

import numpy as np

from tanteo.hand import Workspace
from tanteo.planning import plan, probe_of
from tanteo.planning.start import at_pose
from tanteo.posterior import prepare


def test_a_quarter_of_the_clearance_is_tried(parts):
    """Three millimetres are free above a laser that cannot come nearer: between a quarter and half of 10 mm."""
    start = at_pose(prepare(parts["block"]), np.eye(4), np.diag([1e-5] * 6) ** 2)
    top = float(parts["block"].vertices[:, 2].max())
    bounds = Workspace(np.array([-9.0, -9.0, -9.0]), np.array([9.0, 9.0, top + 0.054]))
    law = {"min_range": 0.05, "max_range": 0.06, "standoff": 0.05, "clearance": 0.01, "retreat": 0.001}
    probe = probe_of(1e-4, approach=np.array([0, 0, -1.0]), cone=0.1, workspace=bounds, **law)
    assert "--clearance 2.5mm" in plan(start, probe, 1e-3).message
