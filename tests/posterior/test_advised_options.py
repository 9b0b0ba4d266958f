"""Options that the findings advise, on scenes where their cause is absent: the covariance stays calibrated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import beams, inside, nees
from tanteo.geometry import SE3, SO3
from tanteo.posterior import prepare
from tanteo.sensors.error_states import (
    Backlash,
    Drift,
    Form,
    Lobes,
    Offset,
    OffsetByAxes,
    Scale,
    Stock,
    TriggerDrift,
)

PARTS = Path(__file__).parents[2] / "examples" / "parts"
SD = 5e-5
T = SE3.from_parts(SO3.axis_rotation(2, 0.4), np.array([0.3, 0.15, 0.02]))
NEAR = tanteo.PosePrior(T_world_part=T, covariance=np.diag(np.repeat([5e-3, 0.05], 3)) ** 2)
ADVISED = {
    "--bias-sd": {"shared_errors": (Offset(3e-4),)},
    "--bias-sd xy, z": {"shared_errors": (OffsetByAxes(3e-4, "xy"), OffsetByAxes(3e-4, "z"))},
    "--bias-sd backlash, lobes": {"shared_errors": (Backlash(3e-4), Lobes(2e-4))},
    "--scale-sd": {"shared_errors": (Scale(1e-3),)},
    "--drift-sd": {"shared_errors": (Drift(3e-4), TriggerDrift(3e-4))},
    "--warp-sd": {"shared_errors": (Form(3e-4),)},
    "--stock": {"shared_errors": (Stock(3e-3),)},
    "--outlier-rate": {"priors": tanteo.Priors(outlier_rate=0.2, pose=NEAR)},
    "--noise-factor": {"priors": tanteo.Priors(noise_factor=5.0, pose=NEAR)},
    "--form-sd": {"tolerance": 1e-4},
    "a larger --sd": {"sd": 4 * SD},
    "no --sd": {"sd": None},
}


@pytest.fixture(scope="module")
def part():
    return prepare(tanteo.read_part(PARTS / "bracket_left.step"))


@pytest.mark.quick_sets(12)
@pytest.mark.parametrize("option", ADVISED)
@pytest.mark.parametrize("seed", [1, 2])
def test_an_advised_option_does_no_harm(part, option, seed):
    """The true pose stays inside the 99.9 % region and no other pose is recognized."""
    p, d = beams(part, 24, np.random.default_rng(seed), tilt=0.1)
    points = SE3.apply(T, p) + SD * np.random.default_rng(seed + 50).normal(size=p.shape)
    readings = tanteo.Readings.from_columns(points, directions=d @ T[:3, :3].T)
    words = {"sd": SD, "priors": tanteo.Priors(pose=NEAR)} | ADVISED[option]
    answer = tanteo.locate(readings, part, conventions=False, **words)
    value, dof = nees(part.part, answer.best.T_world_part, answer.best.covariance, T)
    assert answer.status in ("recognized", "ambiguous", "insufficient")
    assert inside(value, dof, 0.999)
    assert answer.unknown_probability < 0.1
