"""The node and another process on the loopback: frames of a hand and ranges; poses, and the next plan."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from tanteo.geometry import SE3, SO3, from_ros_covariance
from tanteo.io import pose_from_brand
from tanteo.parts import Surface, read_part

HERE = Path(__file__).parent
PARTS = HERE.parents[1] / "examples" / "parts"
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
def network(tmp_path):
    if python_of_ros() is None:
        pytest.skip("no rclpy with tf2_msgs: neither is ROS 2 sourced, nor was 'make ros' run")
    domain = str(os.getpid() % 100 + 1)
    return {
        **os.environ, "ROS_DOMAIN_ID": domain, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1", "ROS_LOG_DIR": str(tmp_path),
    }  # fmt: skip


@pytest.fixture(scope="module")
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
    return {"static": T_HAND_SENSOR.tolist(), "steps": steps}


def test_two_processes_agree_where_the_part_is(network, plan, tmp_path):
    (tmp_path / "plan.json").write_text(json.dumps(plan))
    python = python_of_ros()
    words = ["ros", "--parts", str(PARTS), "--sd", "0.1mm", "--every", "0s", "--json"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "env": network}
    with subprocess.Popen([python, "-m", "tanteo", *words], **pipes) as node:
        try:
            talker = subprocess.run(
                [python, HERE / "talker.py", tmp_path / "plan.json"], timeout=90, check=True, **pipes
            )
        finally:
            node.send_signal(signal.SIGINT)
            out, err = node.communicate(timeout=20)
    published, answer = json.loads(talker.stdout), json.loads(out)
    assert published["heard"], err
    assert published["enough"], published["state"]
    assert published["frame"] == "base"
    assert published["markers"] >= 3
    frame = from_ros_covariance(pose_from_brand("ros", published["pose"]), np.array(published["covariance"]))
    xi = SE3.log(SE3.inverse(frame.T) @ T_WORLD_PART)
    assert xi @ np.linalg.solve(frame.C, xi) < 22.5  # 99.9 %
    assert answer["hypotheses"][0]["part"] == "bracket_left"
    document = json.loads(published["next"]["message"])
    assert document["schema"] == "tanteo.next/1"
    assert published["next"]["success"] == (document["status"] == "ask")
    assert published["reset"]["success"]
    assert node.returncode in (0, 3)
    assert "/range" in err
    assert "Traceback" not in err
