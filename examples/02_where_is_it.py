"""Locate a part and convert its pose and covariance for ROS and GTSAM.

``T_world_part`` maps points of the part to the world. The covariance describes a small motion in the part's own frame,
``T = T_mean exp(xi)``, ``xi = x y z rx ry rz`` in metres and radians. ROS and GTSAM use another order or frame, so use
the named conversions instead of the matrix itself.

    python examples/02_where_is_it.py
"""

from pathlib import Path

import numpy as np

import tanteo
from tanteo.geometry import UncertainFrame, as_ros_covariance
from tanteo.geometry.named import as_gtsam_covariance
from tanteo.io import pose_as_brand

HERE = Path(__file__).parent
part = tanteo.read_part(HERE / "parts" / "bracket_left.step")
readings = tanteo.read_readings(HERE / "readings" / "bracket_left.csv")
(best, *_) = tanteo.locate(readings, part).hypotheses

frame = UncertainFrame(best.T_world_part, best.covariance)
sd = np.sqrt(np.diag(best.covariance))
print("T_world_part [m]\n", np.array2string(best.T_world_part, precision=5, suppress_small=True))
print("sd in the part's frame [mm, mrad]", np.round(1e3 * sd, 3))
print(f"largest corner sd: {1e3 * best.corner_sd:.3f} mm; excluded readings: {', '.join(best.outliers)}")

x, y, z, qx, qy, qz, qw = pose_as_brand("ros", best.T_world_part)
print(f"ROS pose: position {x:.5f} {y:.5f} {z:.5f}, orientation (x y z w) {qx:.5f} {qy:.5f} {qz:.5f} {qw:.5f}")
ros = as_ros_covariance(frame)  # 36 numbers, axes of the world, for PoseWithCovariance.covariance
print("ROS sd [mm, mrad]", np.round(1e3 * np.sqrt(ros.reshape(6, 6).diagonal()), 3))
gtsam = as_gtsam_covariance(frame)  # rotation first, for a Pose3
print("GTSAM sd [mrad, mm]", np.round(1e3 * np.sqrt(gtsam.diagonal()), 3))

hole = np.array([0.090, 0.040, 0.012])  # point on the part to which the robot moves
at, R = (best.T_world_part @ [*hole, 1.0])[:3], best.T_world_part[:3, :3]
arm = np.array([[0, hole[2], -hole[1]], [-hole[2], 0, hole[0]], [hole[1], -hole[0], 0]])  # d point = v + w x hole
J = R @ np.hstack([np.eye(3), arm])
print("move to [mm]", np.round(1e3 * at, 2), "sd [mm]", np.round(1e3 * np.sqrt(np.diag(J @ best.covariance @ J.T)), 3))
