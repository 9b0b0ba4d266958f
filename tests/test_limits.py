"""Lengths that cannot be are refused with their value, wherever they come in; nothing overflows."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tanteo import Readings, identify, read_part
from tanteo.errors import InputError
from tanteo.geometry.limits import LARGEST, LEAST_SD, check_length, check_places, check_spreads
from tanteo.planning import Probe, Sensing
from tanteo.planning.start import at_pose
from tanteo.posterior import PosePrior, Priors, Table
from tanteo.sensors.presets import NoiseLaw

POSE = np.eye(4), 1e-4 * np.eye(6)


def far(away):
    """Return a pose at a given distance."""
    T = np.eye(4)
    T[0, 3] = away
    return T


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e-9, 2e6])
def test_a_length_that_cannot_be_is_named(value):
    with pytest.raises(InputError, match=f"width: expected a length .* got {re.escape(f'{value:g}')} m"):
        check_length("width", value)


def test_bounds_belong_to_what_can_be():
    check_length("width", 0.0)
    check_length("width", LARGEST)
    check_length("sd", LEAST_SD, LEAST_SD)
    check_places("place", np.array([[-LARGEST, 0.0, LARGEST]]))
    check_spreads("pose", np.diag(np.repeat([LEAST_SD, LARGEST], 3)) ** 2)


@pytest.mark.parametrize(
    ("make", "value"),
    [
        (lambda: Sensing(tolerance=1e197), "1e\\+197"),
        (lambda: Priors(radius=1e300), "1e\\+300"),
        (lambda: PosePrior(far(1e297), POSE[1]), "1e\\+297"),
        (lambda: PosePrior(POSE[0], 1e194 * np.eye(6)), "1e\\+97"),
        (lambda: PosePrior(POSE[0], 1e-30 * np.eye(6)), "1e-15"),
        (lambda: PosePrior(box=np.array([[-1e297] * 3, [1.0] * 3])), "1e\\+297"),
        (lambda: PosePrior(table=Table(far(1e297)[:3, 3], np.array([0.0, 0, 1]), 1e-3)), "1e\\+297"),
        (lambda: PosePrior(table=Table(np.zeros(3), np.array([0.0, 0, 1]), 1e-15)), "1e-15"),
        (lambda: Probe("fine", NoiseLaw.of(1e-12)), "1e-12"),
    ],
)  # fmt: skip
def test_what_is_known_or_sensed_is_within_them(make, value):
    with pytest.raises(InputError, match=f"got {value}"):
        make()


def test_a_tolerance_and_a_start_are(tmp_path):
    (tmp_path / "p.off").write_text("OFF 4 4 0\n0 0 0\n50 0 0\n0 40 0\n0 0 30\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n")
    part = read_part(tmp_path / "p.off", unit="mm")
    readings = Readings.from_columns(np.eye(3), sds=np.full(3, 1e-3))
    with pytest.raises(InputError, match=r"tolerance: .* got 1e\+197 m"):
        identify(readings, [], tolerance=1e197)
    with pytest.raises(InputError, match=r"got 1e\+297 m"):
        at_pose(part, far(1e297), POSE[1])
    with pytest.raises(InputError, match=r"got 1e\+97"):
        at_pose(part, POSE[0], 1e194 * np.eye(6))


@pytest.mark.parametrize("length", [1e-200, 1e200])
def test_the_length_of_a_direction_is_nothing(length):
    probe = Probe("any", NoiseLaw.of(1e-3), approach=np.array([0.0, 0.0, -length]))
    np.testing.assert_allclose(probe.approach, [0, 0, -1])
