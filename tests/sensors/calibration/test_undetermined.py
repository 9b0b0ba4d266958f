"""Parameters that a log does not determine are named and keep their prior uncertainty; bad logs are refused."""

from dataclasses import replace

import numpy as np
import pytest

from plane_scenes import joined, random_hands, simulated_log
from tanteo.errors import InputError, ReadingsError
from tanteo.geometry import SE3
from tanteo.sensors import Readings, Rig, RigSensor, calibrate
from tanteo.sensors.calibration import calibrated_rig, plane_angle
from tanteo.sensors.presets import sensor_preset
from tanteo.words.findings import OffRig

PLANE = SE3.exp(np.array([0.1, 0.2, 0.3, 0.4, 0.1, 0.2]))
T = SE3.exp(np.array([0.01, -0.02, 0.05, 0.1, -0.1, 0.3]))


def rig_of(mount=(1e-3, 0.01), **changes):
    cov = np.diag(np.repeat(mount, 3) ** 2.0)
    values = {
        "name": "eye", "T_hand_sensor": T, "preset": None, "sd": 1e-3, "beam_half_angle": 0.02, "max_range": 1.0,
        "bias_sd": 0.0, "cov_mount": cov,
    }  # fmt: skip
    return Rig((RigSensor(**(values | changes)),))


def unturned(rng, n=30):
    """Hands that move but never turn."""
    first = random_hands(rng, 1, PLANE, T, tilt=0.4)[0]
    hands = np.repeat(first[None], n, axis=0)
    hands[:, :3, 3] += rng.uniform(-0.1, 0.1, (n, 3)) @ PLANE[:3, :2] @ PLANE[:3, :2].T
    hands[:, :3, 3] += rng.uniform(0, 0.2, (n, 1)) * PLANE[:3, 2]
    return hands


@pytest.mark.slow
def test_without_rotation_offset_and_plane_are_confounded():
    rng = np.random.default_rng(0)
    found = calibrate(simulated_log(rng, T, PLANE, unturned(rng)))
    assert found.status == "insufficient"
    names = {name for one in found.devices[0].undetermined for name in one.parameters}
    assert {"offset", "x"} <= names
    assert "Turn the hand about two axes" in found.message
    # nothing is made up: an undetermined parameter is as wide as before
    assert np.sqrt(found.beams[0].cov[0, 0]) > 0.1
    with pytest.raises(InputError, match="expected a calibration that determines the beams"):
        calibrated_rig(found)


@pytest.mark.slow
def test_undetermined_parameters_keep_the_rig_s_uncertainty():
    rng = np.random.default_rng(1)
    found = calibrate(simulated_log(rng, T, PLANE, unturned(rng)), rig=rig_of())
    assert found.status == "calibrated"
    assert "adds little on" in found.message
    assert any("offset" in one.parameters for one in found.devices[0].undetermined)
    sds = np.sqrt(np.diag(found.beams[0].cov))
    assert (sds[:3] < 1.001e-3).all()
    assert (sds[:3] > 0.7e-3).any()
    assert np.linalg.norm(found.beams[0].T_hand_beam[:3, 3] - T[:3, 3]) < 4e-3


@pytest.mark.slow
def test_ranges_of_one_length_do_not_determine_the_scale():
    rng = np.random.default_rng(2)
    hands = random_hands(rng, 40, PLANE, T, near=0.299, far=0.301)
    found = calibrate(simulated_log(rng, T, PLANE, hands))
    assert any("scale" in one.parameters for one in found.devices[0].undetermined)


def test_a_good_log_determines_all():
    rng = np.random.default_rng(3)
    found = calibrate(simulated_log(rng, T, PLANE, random_hands(rng, 40, PLANE, T)), rig=rig_of((5e-3, 0.05)))
    assert (found.status, found.message, found.devices[0].undetermined) == ("calibrated", "Calibrated eye.", ())


@pytest.mark.slow
def test_a_rig_that_is_far_off_makes_no_outliers():
    """The log is also searched without it."""
    rng = np.random.default_rng(4)
    log = simulated_log(rng, T, PLANE, random_hands(rng, 40, PLANE, T))
    wrong = rig_of(T_hand_sensor=T @ SE3.exp(np.array([0, 0, 0, 1.2, 0.8, 0])), cov_mount=np.zeros((6, 6)))
    found = calibrate(log, rig=wrong)
    assert found.beams[0].T_hand_beam[:3, 2] @ T[:3, 2] > np.cos(0.03)


def test_no_repeats_leave_one_noise():
    rng = np.random.default_rng(5)
    found = calibrate(simulated_log(rng, T, PLANE, random_hands(rng, 40, PLANE, T), repeats=1))
    assert found.beams[0].repeats.dof == 0
    assert float(found.beams[0].repeats.law.const) == 0
    assert found.beams[0].place_sds.max() > 0


def test_readings_without_noise_are_fitted_exactly():
    rng = np.random.default_rng(6)
    log = simulated_log(rng, T, PLANE, random_hands(rng, 40, PLANE, T), repeats=1, place=(0, 0, 0), repeat=(0, 0))
    found = calibrate(log)
    assert np.linalg.norm(found.beams[0].T_hand_beam[:3, 3] - T[:3, 3]) < 1e-5
    assert found.outliers == ()


@pytest.mark.slow
def test_distance_along_the_axis_is_turned_into_range_along_beam():
    rng = np.random.default_rng(7)
    log = simulated_log(rng, T, PLANE, random_hands(rng, 40, PLANE, T))
    along = Readings.from_columns(ranges=0.8 * log.ranges[:], sensors=log.sensors, Ts_world_hand=log.Ts_world_hand)
    rig = rig_of((5e-3, 0.05), axis_cosine=0.8)
    assert abs(calibrate(along, rig=rig).beams[0].scale) < 0.01
    assert calibrated_rig(calibrate(along, rig=rig), rig=rig).sensors[0].axis_cosine == 0.8


def test_sensors_that_the_log_does_not_have_stay_as_they_were():
    rng = np.random.default_rng(8)
    both = Rig((*rig_of().sensors, *rig_of(name="other").sensors))
    found = calibrate(simulated_log(rng, T, PLANE, random_hands(rng, 40, PLANE, T)), rig=both)
    made = calibrated_rig(found, rig=both)
    assert [s.name for s in made.sensors] == ["eye", "other"]
    assert made.sensors[1] is both.sensors[1]
    assert made.sensors[0].max_range == 1.0


def test_a_preset_gives_the_limits_of_a_sensor_without_rig():
    rng = np.random.default_rng(9)
    found = calibrate(simulated_log(rng, T, PLANE, random_hands(rng, 40, PLANE, T)), sensor="vl53l4cd")
    assert calibrated_rig(found, sensor=sensor_preset("vl53l4cd")).sensors[0].max_range == 1.2


@pytest.mark.parametrize("seed", [13, 14, *(pytest.param(k, marks=pytest.mark.slow) for k in (15, 16, 17))])
def test_readings_that_are_no_planes_are_not_explained_away(seed):
    """Ranges drawn at random: the answer is not a calibration of those few that happen to fit."""
    rng = np.random.default_rng(seed)
    log = simulated_log(rng, T, PLANE, random_hands(rng, 40, PLANE, T), repeats=1)
    noise = Readings.from_columns(
        ranges=rng.uniform(0.1, 0.5, len(log)), sensors=log.sensors, Ts_world_hand=log.Ts_world_hand
    )
    found = calibrate(noise)
    assert found.status == "insufficient"
    assert "better than chance" in found.message


@pytest.mark.slow
def test_few_places_on_each_of_many_planes():
    """Five planes with five places each share one beam."""
    rng = np.random.default_rng(14)
    logs = []
    for k in range(5):
        plane = SE3.exp(rng.normal(size=6) * [0.3, 0.3, 0.3, 2, 2, 2])
        logs.append(simulated_log(rng, T, plane, random_hands(rng, 5, plane, T), label=f"p{k}"))
    found = calibrate(joined(*logs))
    assert found.status == "calibrated"
    beam = found.beams[0]
    aim = beam.T_hand_beam[:3, :3].T @ T[:3, 2]
    assert np.hypot(aim[0], aim[1]) < 4 * np.sqrt(beam.cov[3, 3] + beam.cov[4, 4])
    origin = beam.T_hand_beam[:3, :3].T @ (T[:3, 3] - beam.T_hand_beam[:3, 3])
    assert (np.abs(origin) < 4.5 * np.sqrt(np.diag(beam.cov)[:3])).all()


GOOD = simulated_log(np.random.default_rng(10), T, PLANE, random_hands(np.random.default_rng(11), 6, PLANE, T))
POINTS = Readings.from_columns(np.zeros((5, 3)))


@pytest.mark.parametrize(
    ("readings", "options", "message"),
    [
        (POINTS, {}, "reading '1': expected a range with its sensor and the hand's pose"),
        (GOOD.take(range(8)), {}, "from 4 poses of the hand or more, got 2"),
        (GOOD, {"rig": rig_of(name="eya")}, "Did you mean 'eya'"),
        (GOOD, {"sensor": "vl53"}, "sensor: expected one of"),
        (GOOD, {"robot": "xam"}, "Did you mean 'xarm'"),
        (
            Readings.from_columns(
                ranges=GOOD.ranges, sensors=GOOD.sensors, Ts_world_hand=GOOD.Ts_world_hand,
                features=["rim"] * len(GOOD), kinds=["edge"] * len(GOOD),
            ),
            {},
            "kind of reading '1': expected plane, got edge",
        ),
        (
            Readings.from_columns(sensors=["eye"], Ts_world_hand=np.eye(4)[None], is_free=[True], n=1),
            {},
            "expected ranges of a plane, got none",
        ),
    ],
)  # fmt: skip
def test_refusals(readings, options, message):
    with pytest.raises(InputError) as caught:
        calibrate(readings, **options)
    assert message in str(caught.value)
    assert issubclass(ReadingsError, InputError)


def test_an_unknown_plane_is_named():
    rng = np.random.default_rng(12)
    hands = random_hands(rng, 20, PLANE, T)
    found = calibrate(joined(simulated_log(rng, T, PLANE, hands, label="floor")))
    with pytest.raises(InputError, match="expected one of floor, got 'wall'"):
        plane_angle(found, "floor", found, "wall")


@pytest.mark.slow
def test_two_planes_taken_for_one_are_not_calibrated_with():
    """A third of the places would be excluded, and the beam of the rest would be arbitrary."""
    rng, logs = np.random.default_rng(3), []
    wall = PLANE @ SE3.exp(np.array([0, 0, 0, 1.2, 0, 0]))
    for plane, label in ((PLANE, "table"), (wall, "wall")):
        logs.append(simulated_log(rng, T, plane, random_hands(rng, 30, plane, T, tilt=0.6), label=label))
    log = joined(*logs)
    assert calibrate(log).status == "calibrated"
    found = calibrate(replace(log, features=("",) * len(log), kinds=("point",) * len(log)))
    assert found.status == "insufficient"
    assert "Check" in found.message


@pytest.mark.slow
def test_a_beam_off_its_pose_in_the_rig_is_reported():
    rng = np.random.default_rng(4)
    log = simulated_log(rng, T, PLANE, random_hands(rng, 40, PLANE, T, tilt=0.6))
    assert len(calibrate(log, rig=rig_of()).findings) == 1
    found = calibrate(log, rig=rig_of(T_hand_sensor=T @ SE3.exp(np.array([0.02, 0, 0, 0, 0, 0]))))
    assert found.status == "calibrated"
    assert "'eye' is " in found.message
    assert isinstance(found.findings[-1], OffRig)


@pytest.mark.slow
def test_places_that_scatter_more_than_readings_are_reported():
    rng = np.random.default_rng(5)
    hands = random_hands(rng, 40, PLANE, T, tilt=0.6)
    assert "scatters" not in calibrate(simulated_log(rng, T, PLANE, hands)).message
    assert "'eye' scatters " in calibrate(simulated_log(rng, T, PLANE, hands, place=(0.03, 0.0, 0.0))).message
