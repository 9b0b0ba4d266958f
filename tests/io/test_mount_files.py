"""Poses of sensors in files of ROS and of calibration programs, and the conventions that they use."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.io import read_rig

URDF = """<?xml version="1.0"?><robot name="arm">
<link name="wrist"/><link name="tool0"/><link name="plate"/><link name="tof"/><link name="eye_optical"/>
<joint name="w" type="revolute"><parent link="base"/><child link="wrist"/><origin xyz="9 9 9"/></joint>
<joint name="f" type="fixed"><parent link="wrist"/><child link="tool0"/><origin xyz="0 0 0.1" rpy="0 0 1.5707963267948966"/></joint>
<joint name="p" type="fixed"><parent link="tool0"/><child link="plate"/><origin xyz="0 0 0.01"/></joint>
<joint name="s" type="fixed"><parent link="plate"/><child link="tof"/><origin xyz="0.012 -0.041 0.053" rpy="0 -1.5707963267948966 0"/></joint>
<joint name="e" type="fixed"><parent link="tool0"/><child link="eye_optical"/><origin xyz="0.05 0 0"/></joint>
</robot>"""  # noqa: E501
HANDEYE = """parameters:
  eye_on_hand: {on}
  robot_effector_frame: tool0
  tracking_base_frame: laser
transformation: {{x: 0.012, y: -0.041, z: 0.063, qw: 0.70710678, qx: 0.0, qy: -0.70710678, qz: 0.0}}
"""
HANDEYE2 = """parameters:
  calibration_type: eye_in_hand
  robot_effector_frame: tool0
  tracking_base_frame: laser
transform:
  translation: {x: 0.012, y: -0.041, z: 0.063}
  rotation: {x: 0.0, y: -0.70710678, z: 0.0, w: 0.70710678}
"""
STAMPED = """header: {frame_id: tool0}
child_frame_id: laser
transform:
  translation: {x: 0.012, y: -0.041, z: 0.063}
  rotation: {x: 0.0, y: -0.70710678, z: 0.0, w: 0.70710678}
"""
LAUNCH = """<launch><node pkg="tf2_ros" type="static_transform_publisher" name="a"
 args="0.012 -0.041 0.063 0 -0.70710678 0 0.70710678 tool0 laser"/></launch>"""
LAUNCH_PY = """Node(package="tf2_ros", executable="static_transform_publisher", arguments=[
 "--frame-id", "tool0", "--child-frame-id", "laser", "--x", "0.012", "--y", "-0.041", "--z", "0.063",
 "--qx", "0", "--qy", "-0.70710678", "--qz", "0", "--qw", "0.70710678"])"""
LAUNCH_LIST = """Node(executable='static_transform_publisher',
 arguments=['0.012', '-0.041', '0.063', '0', '-1.57079633', '0', 'tool0', 'laser'])"""
URDF_QUATERNION = URDF.replace('rpy="0 -1.5707963267948966 0"', 'quat_xyzw="0 -0.70710678 0 0.70710678"')
POSE = "position: {x: 0.012, y: -0.041, z: 0.063}\norientation: {x: 0, y: -0.70710678, z: 0, w: 0.70710678}\n"
FILES = {
    "a.urdf#tof": URDF, "b.yaml": HANDEYE.format(on="true"), "c.calib": HANDEYE2, "d.yaml": STAMPED, "e.launch": LAUNCH,
    "f.launch.py": LAUNCH_PY, "g.launch.py": LAUNCH_LIST, "h.urdf#tof": URDF_QUATERNION, "i.yaml": POSE,
}  # fmt: skip


def rig(tmp_path, name, text, **figures):
    (tmp_path / name.partition("#")[0]).write_text(text)
    return read_rig(f"{tmp_path}/{name}", **(figures or {"sd": 1e-3}))


@pytest.mark.parametrize("name", FILES)
def test_a_beam_along_x_of_its_frame_in_any_file(tmp_path, name):
    found = rig(tmp_path, name, FILES[name])
    T = found.sensors[0].T_hand_sensor
    np.testing.assert_allclose(T[:3, 3], [0.012, -0.041, 0.063], atol=1e-9)
    np.testing.assert_allclose(T[:3, 2], [0, 0, 1], atol=1e-7)
    assert ("'tool0'" if "tool0" in FILES[name] else "'hand'") in found.notes[0]
    assert "along x of" in found.notes[0]


def test_links_hands_and_axes_are_chosen(tmp_path):
    np.testing.assert_allclose(
        rig(tmp_path, "a.urdf#wrist/eye_optical", URDF).sensors[0].T_hand_sensor,
        SE3.from_parts(SO3.axis_rotation(2, np.pi / 2), [0, 0.05, 0.1]), atol=1e-9,
    )  # fmt: skip
    np.testing.assert_allclose(
        rig(tmp_path, "a.urdf#tof:-z", URDF).sensors[0].T_hand_sensor[:3, 2], [1, 0, 0], atol=1e-9
    )
    two = read_rig(f"near={tmp_path}/a.urdf#tof,far={tmp_path}/a.urdf#eye_optical", sensor="vl53l4cd")
    assert [sensor.name for sensor in two.sensors] == ["near", "far"]
    for fragment, message in (
        ("", "expected the link of the sensor"),
        ("#nose", "expected a link"),
        ("#base/tof", "revolute"),
    ):
        with pytest.raises(InputError, match=message):
            read_rig(f"{tmp_path}/a.urdf{fragment}", sd=1e-3)


def test_zones_of_a_preset_are_on_the_link(tmp_path):
    found = rig(tmp_path, "a.urdf#tof", URDF, sensor="vl53l5cx_zone8x8")
    assert len(found.sensors) == 64
    np.testing.assert_allclose(sum(s.T_hand_sensor[:3, 2] for s in found.sensors)[:2], 0, atol=1e-9)


def test_a_chain_of_kalibr_is_inverted(tmp_path):
    T_cam_hand = SE3.from_parts(SO3.exp(np.array([0.1, 0.2, 0.3])), [0.01, 0.02, 0.03])
    T_next = SE3.from_parts(np.eye(3), [-0.1, 0, 0])
    text = f"cam0: {{T_cam_imu: {T_cam_hand.tolist()}}}\ncam1: {{T_cn_cnm1: {T_next.tolist()}}}\n"
    found = rig(tmp_path, "chain.yaml#cam1", text)
    np.testing.assert_allclose(found.sensors[0].T_hand_sensor, SE3.inverse(T_next @ T_cam_hand), atol=1e-12)
    with pytest.raises(InputError, match="relates cameras to each other only"):
        rig(tmp_path, "pair.yaml#cam1", f"cam0: {{}}\ncam1: {{T_cn_cnm1: {T_next.tolist()}}}\n")


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.yaml", HANDEYE.format(on="false"), "got a result of eye-on-base"),
        ("a.yaml", "shoulder_joint: 0.01\nhead_x: 0.2\n", "offsets of joints as robot_calibration"),
        ("a.yaml", HANDEYE2.replace("w: 0.70710678", "w: 3"), "unit quaternion"),
        ("a.yaml", HANDEYE2.replace("y: -0.041,", ""), "a transform with x, y, z"),
        ("a.yaml", "[1, 2", "expected YAML"),
        ("a.yaml", "x: 1", "expected a hand-eye result"),
        ("a.urdf", "<robot", "expected URDF"),
        ("a.urdf", URDF.replace("0 0 0.01", "0 0 zero"), "three numbers in xyz"),
        ("a.launch", "<launch/>", "expected"),
    ],
)
def test_what_is_no_pose_of_a_sensor_is_refused(tmp_path, name, text, message):
    with pytest.raises(InputError, match=message):
        rig(tmp_path, name + ("#tof" if name.endswith("urdf") else ""), text)


def test_a_pose_without_figures_states_the_lines_of_a_rig(tmp_path):
    (tmp_path / "a.yaml").write_text(HANDEYE2)
    with pytest.raises(InputError, match=r"--sensor or --sd.*position_mm = \[ ?12"):
        read_rig(tmp_path / "a.yaml")


def test_xacro_is_expanded(tmp_path):
    pytest.importorskip("xacro")
    text = URDF.replace('<robot name="arm">', '<robot name="arm" xmlns:xacro="http://ros.org/wiki/xacro">'
                        '<xacro:property name="up" value="${0.05 + 0.003}"/>').replace("0.053", "${up}")  # fmt: skip
    np.testing.assert_allclose(rig(tmp_path, "a.xacro#tof", text).sensors[0].T_hand_sensor[2, 3], 0.063)


@pytest.mark.parametrize(
    "text",
    [
        "T_flange_sensor: [[1,0,0,0.012],[0,1,0,-0.041],[0,0,1,0.063],[0,0,0,1]]\n",
        "T_cam_gripper: [[1,0,0,-0.012],[0,1,0,0.041],[0,0,1,-0.063],[0,0,0,1]]\n",
        "%YAML:1.0\n---\nR_cam2gripper: !!opencv-matrix\n  {rows: 3, cols: 3, dt: d, data: [1,0,0,0,1,0,0,0,1]}\n"
        "t_cam2gripper: !!opencv-matrix\n  {rows: 3, cols: 1, dt: d, data: [0.012,-0.041,0.063]}\n",
    ],
)
def test_a_matrix_is_read_by_what_its_name_maps(tmp_path, text):
    T = rig(tmp_path, "m.yaml", text).sensors[0].T_hand_sensor
    np.testing.assert_allclose(T[:3], [[1, 0, 0, 0.012], [0, 1, 0, -0.041], [0, 0, 1, 0.063]], atol=1e-9)


def test_a_sensor_metres_from_the_hand_is_a_wrong_unit(tmp_path):
    with pytest.raises(InputError, match=r"within 3 m .* in millimetres"):
        rig(tmp_path, "m.yaml", HANDEYE.format(on="true").replace("0.012", "12").replace("-0.041", "-41"))
