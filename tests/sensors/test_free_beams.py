"""Free-space rays move with the errors that readings share: against what is measured when these are there."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.factors import as_contact_points, as_free_rays
from tanteo.geometry import SE3
from tanteo.sensors import Readings, Rig, RigSensor, measure

N, STEP = 6, 1e-5
T_UNIT = SE3.exp(np.array([0.01, 0.02, 0.05, 0.1, -0.2, 0.3]))
T_ZONE = SE3.exp(np.array([0.0, 0, 0, 0.2, -0.1, 0]))
MOUNT = np.diag(np.repeat([2e-3, 0.02], 3) ** 2)
FREE = np.arange(N) % 2 == 1


def eye(T_hand_unit=T_UNIT, **changes):
    """Return a zone of a sensor whose beam is off the axis of its device."""
    values = {
        "preset": None, "sd": 1e-3, "beam_half_angle": 0.05, "max_range": 1.0, "bias_sd": 1e-3, "scale_sd": 0.01,
        "cov_mount": MOUNT, "unit": "head", "T_hand_unit": T_hand_unit, "T_hand_sensor": T_hand_unit @ T_ZONE,
    }  # fmt: skip
    return RigSensor("eye", **(values | changes))


def hands():
    return SE3.exp(np.random.default_rng(3).normal(size=(N, 6)) * [0.3, 0.3, 0.3, 1, 1, 1])


def ranged(Ts, free=FREE):
    ranges = np.where(free, np.nan, np.linspace(0.2, 0.6, N))
    return Readings.from_columns(ranges=ranges, sensors=["eye"] * N, Ts_world_hand=Ts, is_free=free)


def touched(Ts, free=FREE):
    """Points and ways of a tip, 0.1 m in front of the hand."""
    return Readings.from_columns(
        Ts[:, :3, 3] + 0.1 * Ts[:, :3, 2], directions=Ts[:, :3, 2], sds=np.full(N, 1e-4), Ts_world_hand=Ts,
        is_free=free, max_ranges=np.where(free, 0.3, np.nan),
    )  # fmt: skip


def differences(measured_with, d):
    """Return how origins and directions of free-space rays change, one column for each error."""
    beams = [[measured_with(way * STEP * e).free for way in (1, -1)] for e in np.eye(d)]
    return (
        np.stack([(getattr(a, name) - getattr(b, name)) / (2 * STEP) for a, b in beams], axis=-1)
        for name in ("origins", "directions")
    )


@pytest.mark.parametrize("scaled", [False, True])
def test_the_mounting_moves_free_space_rays_as_the_rig_does(scaled):
    cov_scale = {"cov_scale": np.full(6, 1e-7)} if scaled else {}
    m = measure(ranged(hands()), rig=Rig((eye(**cov_scale),)))
    k = [error.name for error in m.shared].index("mounting and scale of head" if scaled else "mounting of head")
    J, turns = m.free.jacobians[k], m.free.turns[k]
    origins, directions = differences(
        lambda e: measure(ranged(hands()), rig=Rig((eye(T_UNIT @ SE3.exp(e), **cov_scale),))), 6
    )
    np.testing.assert_allclose(J[..., :6], origins, atol=1e-8)
    np.testing.assert_allclose(turns[..., :6], directions, atol=1e-8)
    assert not J[..., 6:].any()
    assert not turns[..., 6:].any()


@pytest.mark.parametrize("readings", [ranged, touched])
def test_the_base_moves_free_beams_as_hands_do_that_are_there(readings):
    rig = Rig((eye(),)) if readings is ranged else None
    m = measure(readings(hands()), rig=rig, robot="ur_ros_nominal_dh")
    origins, directions = differences(lambda e: measure(readings(SE3.exp(e) @ hands()), rig=rig), 6)
    assert m.shared[0].name == "robot base"
    np.testing.assert_allclose(m.free.jacobians[0], origins, atol=1e-8)
    np.testing.assert_allclose(m.free.turns[0], directions, atol=1e-8)


def test_the_tip_shifts_the_paths_of_touches_without_rotation():
    m = measure(touched(hands()), tip_sd=[1e-3, 1e-3, 1e-4])
    np.testing.assert_allclose(m.free.jacobians[0], hands()[FREE, :3, :3])
    assert not m.free.turns[0].any()
    nowhere = hands()
    nowhere[5] = np.nan
    with pytest.raises(InputError, match="expected the hand's pose beside every reading"):
        measure(Readings.from_columns(
            np.zeros((N, 3)), directions=np.eye(3)[[0] * N], sds=np.full(N, 1e-4), Ts_world_hand=nowhere,
            is_free=FREE, max_ranges=np.where(FREE, 0.3, np.nan),
        ), tip_sd=[1e-3, 1e-3, 1e-4])  # fmt: skip


def test_bias_and_scale_do_not_move_free_beams():
    m = measure(ranged(hands()), rig=Rig((eye(),)))
    assert [error.name for error in m.shared] == ["bias of head", "scale of head", "mounting of head"]
    for J, turns in list(zip(m.free.jacobians, m.free.turns, strict=True))[:2]:
        assert not J.any()
        assert not turns.any()


def test_a_sensor_without_hits_keeps_its_mounting():
    m = measure(ranged(hands(), np.full(N, True)), rig=Rig((eye(),)))
    assert [error.name for error in m.shared] == ["mounting of head"]
    assert as_contact_points(m).shared_jacobian.shape == (0, 3, 6)
    assert as_free_rays(m, 0.0).shared_jacobian.shape == (N, 3, 6)


def test_rays_and_points_move_equally_with_whitened_errors():
    Ts = np.repeat(hands()[::2], 2, axis=0)
    m = measure(touched(Ts), robot="ur_ros_nominal_dh", tip_sd=[1e-3, 0.0, 1e-4])
    touches, free, z = as_contact_points(m), as_free_rays(m, 0.0), np.random.default_rng(1).normal(size=9)
    origins, directions = free.at(z[None])
    np.testing.assert_allclose(origins[0], touches.points + touches.shared_jacobian @ z, atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(directions[0], axis=1), 1.0)
    turned = directions[0] - free.directions
    np.testing.assert_allclose(turned, free.turns @ z, atol=1e-4)  # it stays a unit vector
    assert np.abs(turned).max() > 1e-3
    assert as_free_rays(measure(touched(Ts)), 0.0).at(np.zeros((1, 0)))[0].shape == (3, 3)
