"""A node with a lifecycle: what each transition does, as a manager on its network notices it."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

HERE = Path(__file__).parent
PARTS = HERE.parents[1] / "examples" / "parts"


@pytest.fixture
def noticed(python, network, plan, tmp_path):
    """Return what the manager noticed, and the exit code and messages of the node."""
    (tmp_path / "plan.json").write_text(json.dumps({**plan, "parts": str(PARTS)}))
    words = ["ros", "--lifecycle", "--parts", "/nowhere", "--sd", "3mm", "--every", "0s"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "env": network}
    with subprocess.Popen([python, "-m", "tanteo", *words], **pipes) as node:
        try:
            manager = subprocess.run([python, HERE / "manager.py", tmp_path / "plan.json"], timeout=150, **pipes)
            _, err = node.communicate(timeout=20)
        finally:
            node.kill()
    assert manager.returncode == 0, manager.stderr + err
    return json.loads(manager.stdout), node.returncode, err


@pytest.mark.slow
def test_transitions_do_what_a_manager_expects(noticed):
    found, code, err = noticed
    assert found["early"] == [False, "unconfigured"]
    assert found["refused"] == [False, "unconfigured"], err
    assert "/nowhere" in err
    assert found["nowhere"]
    assert found["parts"]
    assert found["sd"]
    assert found["configured"] == [True, "inactive"], err
    assert not found["heard_inactive"]
    assert not found["next_inactive"]
    assert found["activated"] == [True, "active"]
    assert found["heard_active"]
    assert found["next_active"]
    assert found["enough"], err
    assert found["answered"]
    assert found["frame"] == "base"
    assert found["deactivated"] == [True, "inactive"]
    assert found["silent"]
    assert found["diagnostics_inactive"] == 0
    assert found["again"] == [True, "active"]
    assert found["kept"] == found["used"] > 0
    assert found["cleaned"] == [True, "unconfigured"]
    assert found["reconfigured"] == [True, "inactive"]
    assert found["fresh"] == 0
    assert found["shutdown"] == [True, "finalized"]
    assert code in (0, 3)
    assert "Traceback" not in err
