"""The node and another process on the loopback: frames of a hand and ranges; poses, and the next plan."""

from __future__ import annotations

import json
import signal
import subprocess
from pathlib import Path

import numpy as np

from tanteo.geometry import SE3, from_ros_covariance
from tanteo.io import pose_from_brand

HERE = Path(__file__).parent
PARTS = HERE.parents[1] / "examples" / "parts"


def test_two_processes_agree_where_the_part_is(python, network, plan, tmp_path):
    (tmp_path / "plan.json").write_text(json.dumps(plan))
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
    xi = SE3.log(SE3.inverse(frame.T) @ np.array(plan["part"]))
    assert xi @ np.linalg.solve(frame.C, xi) < 22.5  # 99.9 %
    assert answer["hypotheses"][0]["part"] == "bracket_left"
    document = json.loads(published["next"]["message"])
    assert document["schema"] == "tanteo.next/1"
    assert published["next"]["success"] == (document["status"] == "ask")
    assert published["reset"]["success"]
    assert node.returncode in (0, 3)
    assert "/range" in err
    assert "Traceback" not in err
