"""Brand poses: the golden column of the published table, and round trips everywhere, gimbal lock included."""

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.io import BRANDS, pose_as_brand, pose_from_brand

R, P, Y = np.deg2rad([10.0, 20.0, 30.0])
GOLDEN_ROTATION = SO3.axis_rotation(2, Y) @ SO3.axis_rotation(1, P) @ SO3.axis_rotation(0, R)

GOLDEN = {
    "paper": list(np.deg2rad([10, 20, 30])),
    "fanuc": [10, 20, 30],
    "kuka": [30, 20, 10],
    "yaskawa": [10, 20, 30],
    "mitsubishi": [10, 20, 30],
    "kawasaki": [2.726830, 22.268744, 25.505550],
    "abb": [0.951549, 0.038135, 0.189308, 0.239298],
    "ur": [0.077525, 0.384852, 0.486479],
    "ros": [0.038135, 0.189308, 0.239298, 0.951549],
    "staubli": [-1.116055, 22.242181, 28.451775],
}
GOLDEN |= dict.fromkeys(("comau", "doosan", "omron"), GOLDEN["kawasaki"])
GOLDEN |= dict.fromkeys(("techman", "ufactory"), GOLDEN["fanuc"])


@pytest.mark.parametrize("name", GOLDEN)
def test_golden(name):
    """The rotation roll 10, pitch 20, yaw 30 degrees as every brand writes it, to the digits of the table."""
    T = SE3.from_parts(GOLDEN_ROTATION, np.array([0.1, 0.2, 0.3]))
    position = np.array([0.1, 0.2, 0.3]) / BRANDS[name].metre
    values = np.concatenate([position, GOLDEN[name]])
    np.testing.assert_allclose(pose_as_brand(name, T), values, atol=6e-7, rtol=1e-12)
    np.testing.assert_allclose(pose_from_brand(name, values), T, atol=2e-6)


def test_every_verified_brand_has_a_golden_value():
    assert {name for name, b in BRANDS.items() if b.verified} == set(GOLDEN)
    assert all("confirm" in b.source for b in BRANDS.values() if not b.verified)


@pytest.mark.parametrize("name", BRANDS)
@pytest.mark.parametrize("batch", [(), (200,), (3, 5)])
def test_round_trip(name, batch):
    rng = np.random.default_rng(0)
    T = SE3.exp(rng.normal(size=(*batch, 6)) * 2)
    np.testing.assert_allclose(pose_from_brand(name, pose_as_brand(name, T)), T, atol=1e-12)


@pytest.mark.parametrize("name", BRANDS)
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("quarter", [0, 1, 2, -1])
@pytest.mark.parametrize("spin", [0.0, 0.7, -2.5])
def test_round_trip_where_angles_degenerate(name, axis, quarter, spin):
    """Quarter turns about every axis, alone and after a spin: where Euler angles lock."""
    for other in range(3):
        turn = SO3.axis_rotation(other, spin) @ SO3.axis_rotation(axis, quarter * np.pi / 2)
        T = SE3.from_parts(turn, np.zeros(3))
        np.testing.assert_allclose(pose_from_brand(name, pose_as_brand(name, T)), T, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("funac", [0] * 6, "Did you mean 'fanuc'"),
        ("fanuc", [0] * 7, "expected 6 finite numbers (X Y Z W P R)"),
        ("fanuc", [0, 0, 0, 0, 0, np.nan], "expected 6 finite numbers"),
        ("abb", [0] * 7, "quaternion: expected a length of 1, got 0, 0, 0, 0"),
        (
            "abb",
            [0, 0, 0, 0.7, 0.7, 0.7, 0],
            "quaternion: expected a length of 1, got 0.7, 0.7, 0.7, 0, of length 1.212",
        ),
        ("ros", [0, 0, 0, 0, 0, 90, 1], "are these angles?"),
    ],
)
def test_refusals(name, values, message):
    with pytest.raises(InputError) as caught:
        pose_from_brand(name, np.array(values, dtype=float))
    assert message in str(caught.value)
