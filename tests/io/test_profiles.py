"""Profiles of a laser line scanner on the hand: the same points from a row each, a row a profile, and a track."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.io import read_readings, read_rig

RIG = """[sensors.line]
sd_mm = 0.02
beam_half_angle_deg = 0.05
position_mm = [0, 0, 50]
quaternion_wxyz = [1, 0, 0, 0]
"""
X = np.linspace(-9, 9, 10)
POSE = "hand_x_mm,hand_y_mm,hand_z_mm,hand_roll_deg,hand_pitch_deg,hand_yaw_deg"
HANDS = [f"400,{100 + 3 * k},300,180,0,0" for k in range(5)]
DEPTH = 210 + np.abs(X)


def read(tmp_path, lines, name="scan.csv", **options):
    (tmp_path / "rig.toml").write_text(RIG)
    (tmp_path / name).write_text("\n".join(lines) + "\n")
    return read_readings(tmp_path / name, rig=read_rig(tmp_path / "rig.toml"), **options)


def long(hands):
    return [f"{k},{x:g},{z:g}{hand}" for k, hand in enumerate(hands) for x, z in zip(X, DEPTH, strict=True)]


def expect(readings):
    p = readings.points[:].reshape(5, 10, 3)
    np.testing.assert_allclose(p[:, :, 0], np.broadcast_to(0.4 + 1e-3 * X, (5, 10)), atol=1e-9)
    np.testing.assert_allclose(p[:, 0, 1], 0.1 + 3e-3 * np.arange(5), atol=1e-9)
    np.testing.assert_allclose(p[0, :, 2], 0.25 - 1e-3 * DEPTH, atol=1e-9)
    np.testing.assert_allclose(readings.directions[:], np.broadcast_to([0, 0, -1], (50, 3)), atol=1e-9)
    np.testing.assert_allclose(readings.sds[:], 2e-5)
    assert len(set(readings.groups)) == 5


def test_profiles_are_placed_by_hand_and_rig(tmp_path):
    expect(read(tmp_path, [f"profile,x_mm,z_mm,{POSE}", *long([f",{hand}" for hand in HANDS])]))
    cells = [f"{axis}{k}" for axis in "xz" for k in range(10)]
    rows = [f"{','.join(f'{v:g}' for v in (*X, *DEPTH))},{hand}" for hand in HANDS]
    expect(read(tmp_path, [f"{','.join(cells)},{POSE}", *rows], unit="mm"))
    track = tmp_path / "hands.csv"
    track.write_text("time_s,x_mm,y_mm,z_mm,rx_rad,ry_rad,rz_rad\n"
                     + "".join(f"{k},400,{100 + 3 * k},300,3.141592653589793,0,0\n" for k in range(5)))  # fmt: skip
    expect(read(tmp_path, ["time_s,x_mm,z_mm,profile", *(f"{row},{row[0]}" for row in long([""] * 5))], hand=track))


def test_points_are_spread_and_gaps_excluded(tmp_path):
    rows = long([f",{hand}" for hand in HANDS])
    rows[3] = rows[3].replace(f"{DEPTH[3]:g}", "NaN")
    few = read(tmp_path, [f"profile,x_mm,z_mm,{POSE}", *rows], max_points=20)
    assert 10 <= len(few) <= 20
    assert np.ptp(few.points[:][:, 0]) > 0.015
    assert len(read(tmp_path, [f"profile,x_mm,z_mm,{POSE}", *rows])) == 49


def test_profiles_need_the_pose_of_the_hand(tmp_path):
    with pytest.raises(InputError, match="expected the pose of the hand with profiles"):
        read(tmp_path, ["profile,x_mm,z_mm", *long([""] * 5)])
