"""A network of ROS processes on the loopback, and beams that locate a part."""

from __future__ import annotations

import os
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from tanteo.geometry import SE3, SO3
from tanteo.parts import Surface, read_part

PARTS = Path(__file__).parents[2] / "examples" / "parts"
T_HAND_SENSOR = SE3.from_parts(SO3.axis_rotation(1, np.pi / 2), np.array([0.01, 0.02, 0.03]))
T_WORLD_PART = SE3.from_parts(SO3.axis_rotation(2, 0.6), np.array([0.42, -0.13, 0.035]))
SD = 1e-4


def python_of_ros() -> str | None:
    """Return a Python that has rclpy: this one if ROS 2 is sourced, or that of ``make ros``."""
    if find_spec("rclpy") is not None and find_spec("tf2_msgs") is not None:
        return sys.executable
    made = Path(sys.prefix) / "ros" / "bin" / "python"
    return str(made) if (made.parents[1] / "share" / "tf2_msgs").exists() else None


@pytest.fixture
def python():
    """Return a Python that has rclpy; skip the test without one."""
    found = python_of_ros()
    if found is None:
        pytest.skip("no rclpy with tf2_msgs: neither is ROS 2 sourced, nor was 'make ros' run")
    return found


@pytest.fixture
def network(tmp_path):
    """Return the environment of ROS processes that reach only each other."""
    domain = str(os.getpid() % 100 + 1)
    return {
        **os.environ, "ROS_DOMAIN_ID": domain, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1", "ROS_LOG_DIR": str(tmp_path),
    }  # fmt: skip


@pytest.fixture(scope="session")
def plan():
    """Beams that hit a part from about 6 cm, on all sides except from below."""
    pytest.importorskip("OCP", reason="reading STEP needs tanteo[step]")
    part, rng = read_part(PARTS / "bracket_left.step"), np.random.default_rng(3)
    surface = Surface(part.vertices, part.triangles)
    corners = part.vertices[part.triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    normals = surface.normals
    steps = []
    while len(steps) < 30:
        k = rng.choice(len(areas), p=areas / areas.sum())
        if normals[k, 2] < -0.5:
            continue
        place = rng.dirichlet(np.ones(3)) @ corners[k]
        origin = place + 0.06 * normals[k]
        hit = float(surface.cast(origin[None], -normals[k][None]).distances[0])
        if not 0.02 < hit < 0.1:
            continue
        T = T_WORLD_PART @ SE3.from_parts(SO3.frame_from_axis(-normals[k], 0), origin)
        steps.append(((T @ SE3.inverse(T_HAND_SENSOR)).tolist(), hit + SD * rng.normal()))
    return {"static": T_HAND_SENSOR.tolist(), "steps": steps, "part": T_WORLD_PART.tolist()}
