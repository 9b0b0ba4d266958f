"""Calibration on known targets and at known distances: NEES of the beam over simulated logs, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

import tanteo
from tanteo.errors import InputError, ReadingsError
from tanteo.geometry import SE3, SO3
from tanteo.io import read_rig, write_rig
from tanteo.io.poses import parse_target
from tanteo.sensors import Readings, calibrate
from tanteo.sensors.calibration import calibrated_rig

RIG = """[sensors.eye]
sd_mm = 0.3
beam_half_angle_deg = 0.1
position_mm = [20, -10, 60]
quaternion_wxyz = [1, 0, 0, 0]
mount_sd_mm = 3
mount_turn_sd_deg = 2
"""
SD, SCALE_SD = 3e-4, 5e-3
BRACKET = Path(__file__).parents[3] / "examples" / "parts" / "bracket_left.step"
CENTRE = np.array([0.4, 0.2, 0.05])


@pytest.fixture
def rig(tmp_path):
    (tmp_path / "rig.toml").write_text(RIG)
    return read_rig(tmp_path / "rig.toml")


def hands_at(rng, aim, rig, count, spread, turn=0.5):
    """Poses of the hand from which the nominal beam meets a point within a spread, from 80 to 250 mm away."""
    out = []
    for _ in range(count):
        view = SO3.exp(turn * np.r_[rng.normal(size=2), 0]) @ np.array([0, 0, -1.0])
        at = aim + spread * rng.normal(size=3) - rng.uniform(0.08, 0.25) * view
        R = SO3.frame_from_axis(view, 2) @ SO3.exp(np.array([0, 0, rng.uniform(-3, 3)]))
        out.append(SE3.from_parts(R, at) @ SE3.inverse(rig.sensors[0].T_hand_sensor))
    return np.array(out)


def drawn_beam(rng, rig):
    turned = SE3.exp(rng.normal(size=6) * np.repeat([3e-3, np.radians(2)], 3))
    return rig.sensors[0].T_hand_sensor @ turned, SCALE_SD * rng.normal()


def log_of(rng, T_hand_beam, scale, hands, surface, T_target):
    """Ranges to a target at a pose; hands whose beam passes it are dropped."""
    T = SE3.inverse(T_target) @ hands @ T_hand_beam
    d = surface.cast(T[:, :3, 3], T[:, :3, 2])[0]
    hit = np.isfinite(d) & (d > 0)
    ranges = (1 + scale) * d[hit] + SD * rng.normal(size=hit.sum())
    return Readings.from_columns(ranges=ranges, sensors=["eye"] * int(hit.sum()), Ts_world_hand=hands[hit])


def chi_square(beam, T_true, scale):
    """Error of origin, direction and scale in the metric of the fit's covariance, over six numbers."""
    R = beam.T_hand_beam[:3, :3]
    aim = R.T @ T_true[:3, 2]
    e = np.r_[R.T @ (T_true[:3, 3] - beam.T_hand_beam[:3, 3]), -aim[1], aim[0], scale - beam.scale]
    return e @ np.linalg.solve(beam.cov[:6, :6], e)


def nees(rig, target, sd, turn_sd, spread, seeds):
    values = []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        T_beam, scale = drawn_beam(rng, rig)
        off = np.r_[sd * rng.normal(size=3), turn_sd * rng.normal(size=3)]
        hands = hands_at(rng, target.T_world_target[:3, 3], rig, 60, spread)
        log = log_of(rng, T_beam, scale, hands, target.surface, target.T_world_target @ SE3.exp(off))
        found = calibrate(log, rig=rig, target=target)
        assert found.status == "calibrated", found.message
        values.append(chi_square(found.beams[0], T_beam, scale))
    return values


def holds(values, dof=6, slack=1.15):
    """Mean chi-square in its 99.9 % interval; the noise is estimated, too, which widens it."""
    low, high = chi2.ppf([5e-4, 1 - 5e-4], dof * len(values)) / len(values)
    return low / slack < np.mean(values) < high * slack


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "sd", "turn_sd", "spread"),
    [
        ("plane 400,200,50mm 0,0,30deg +- 0.2mm 0.1deg", 2e-4, np.radians(0.1), 0.05),
        ("ball 25mm@400,200,50mm +- 0.2mm", 2e-4, 0.0, 0.01),
        ("part PART@400,200,50mm 0,0,30deg +- 0.2mm 0.1deg", 2e-4, np.radians(0.1), 0.03),
    ],
)
def test_beams_of_known_targets_keep_their_covariance(rig, text, sd, turn_sd, spread):
    target = parse_target(text.replace("PART", str(BRACKET)))
    assert holds(nees(rig, target, sd, turn_sd, spread, 8))


def aimed_log(rng, T_hand_beam, scale, count, aim_sd):
    """Ranges of a point at which every beam was aimed to within ``aim_sd``, and the poses of the hand."""
    hands, ranges = [], []
    for _ in range(count):
        view = SO3.exp(0.5 * np.r_[rng.normal(size=2), 0]) @ np.array([0, 0, -1.0])
        R = SO3.frame_from_axis(view, 2) @ SO3.exp(np.array([0, 0, rng.uniform(-3, 3)]))
        d = rng.uniform(0.08, 0.25)
        at = CENTRE + R @ np.r_[aim_sd * rng.normal(size=2), -d]
        hands.append(SE3.from_parts(R, at) @ SE3.inverse(T_hand_beam))
        ranges.append((1 + scale) * d + SD * rng.normal())
    return Readings.from_columns(ranges=ranges, sensors=["eye"] * count, Ts_world_hand=np.array(hands))


@pytest.mark.slow
@pytest.mark.parametrize(
    "text", [pytest.param("point 400,200,50mm +- 0.01mm 0.2mm", marks=pytest.mark.slow), "point +- 0.2mm"]
)
def test_a_divot_determines_the_six_unknowns_of_a_ranger(rig, text):
    values = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        T_beam, scale = drawn_beam(rng, rig)
        found = calibrate(aimed_log(rng, T_beam, scale, 40, 2e-4), rig=rig, target=parse_target(text))
        assert found.status == "calibrated"
        assert np.sqrt(np.diag(found.beams[0].cov))[:3].max() < 1e-3
        assert not found.devices[0].undetermined
        values.append(chi_square(found.beams[0], T_beam, scale))
    assert holds(values)


@pytest.mark.slow
def test_known_distances_determine_offset_and_scale(rig, tmp_path):
    errors = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        true, scale, offset = np.linspace(0.04, 0.4, 15), SCALE_SD * rng.normal(), -0.018
        ranges = (1 + scale) * true + offset + SD * rng.normal(size=15)
        found = calibrate(Readings.from_columns(ranges=ranges, true_distances=true, sensors=["eye"] * 15), rig=rig)
        assert found.status == "calibrated"
        e, rows = found.devices[0].values[:2] - [offset, scale], [6, 7]
        errors.append(e @ np.linalg.solve(found.devices[0].cov[np.ix_(rows, rows)], e))
    assert holds(errors, dof=2)
    made = calibrated_rig(found, rig=rig)
    write_rig(made, tmp_path / "out.toml")
    again = read_rig(tmp_path / "out.toml").sensors[0]
    assert np.all(np.diag(again.cov_mount) > 0.99 * np.diag(rig.sensors[0].cov_mount))
    down = Readings.from_columns(ranges=[0.1 * (1 + scale) + offset], sensors=["eye"], Ts_world_hand=np.eye(4)[None])
    point = tanteo.sensors.measure(down, rig=read_rig(tmp_path / "out.toml")).points[0]
    np.testing.assert_allclose(point, rig.sensors[0].T_hand_sensor[:3, 3] + [0, 0, 0.1], atol=1e-3)


def test_one_known_distance_is_not_enough_for_scale(rig):
    true = np.full(6, 0.2) + 1e-4 * np.arange(6)
    ranges = true - 0.01 + SD * np.random.default_rng(0).normal(size=6)
    found = calibrate(Readings.from_columns(ranges=ranges, true_distances=true, sensors=["eye"] * 6), rig=rig)
    names = [name for one in found.devices[0].undetermined for name in one.parameters]
    assert "scale" in names
    assert "distances that differ more" in found.message


def test_known_distances_with_no_target_rows_are_fitted(rig, tmp_path):
    rows = [f"{int(1e3 * (d - 0.01))},{1e3 * d:.1f},eye" for d in np.linspace(0.05, 0.3, 12)]
    (tmp_path / "known.csv").write_text("\n".join(["range_mm,true_distance_mm,sensor", "inf,20,eye", *rows]) + "\n")
    found = calibrate(tanteo.read_readings(tmp_path / "known.csv"), rig=rig)
    assert found.status == "calibrated"


def test_known_distances_do_not_place_a_rig_of_their_own():
    found = calibrate(Readings.from_columns(ranges=[0.1, 0.2, 0.3, 0.4], true_distances=[0.11, 0.21, 0.31, 0.41], n=4))
    with pytest.raises(InputError, match="--rig"):
        calibrated_rig(found)


def test_distances_beside_poses_are_refused(rig):
    both = Readings.from_columns(ranges=[0.1], true_distances=[0.1], sensors=["eye"], Ts_world_hand=np.eye(4)[None])
    with pytest.raises(ReadingsError, match="mixture"):
        calibrate(both, rig=rig)


@pytest.mark.parametrize("text", ["cube 3", "ball -2mm", "ball 3mm@1,2mm +- 1mm", "point 1,2,3mm", "plane 0,0,0mm"])
def test_targets_of_another_form_are_refused(text):
    with pytest.raises(InputError, match=r"target|\+-"):
        parse_target(text)


def test_a_ball_needs_a_rig_to_start_from(rig):
    rng = np.random.default_rng(0)
    T_beam, scale = drawn_beam(rng, rig)
    with pytest.raises(InputError, match="--rig"):
        calibrate(aimed_log(rng, T_beam, scale, 10, 1e-4), target=parse_target("point +- 0.1mm"))
