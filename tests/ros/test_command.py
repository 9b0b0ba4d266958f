"""The command of the node without ROS, and the options that it refuses before it imports ROS."""

from __future__ import annotations

from importlib.util import find_spec

import pytest

from tanteo.cli import main


def printed(capsys, *words):
    with pytest.raises(SystemExit) as end:
        main(["ros", "--parts", "parts", *words])
    return end.value.code, capsys.readouterr().err


@pytest.mark.skipif(find_spec("rclpy") is not None, reason="ROS 2 is here")
def test_without_ros_it_explains_the_installation(capsys):
    code, err = printed(capsys, "--sd", "0.3mm")
    assert code == 1
    assert "pip install -e '.[ros]'" in err
    assert "setup.bash" in err


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ((), "--sensor, --sd: expected one of the two, got neither"),
        (("--sd", "0.3mm", "--sensor", "keyence_il300"), "expected one of the two, got both"),
        (("--sd", "0.3mm", "--node", "a b"), "--node: expected letters"),
        (("--sd", "0.3mm", "--every", "soon"), "--every: expected a time from 0"),
    ],
)
def test_misuse_is_reported_first(words, expected, capsys):
    code, err = printed(capsys, *words)
    assert code == 2
    assert expected in err


def test_arguments_of_a_launch_file_are_options(capsys, tmp_path):
    code, err = printed(capsys, "--ros-args", "-r", "__ns:=/cell1", "-p", "sd:=0.001", "-p", "every:=soon")
    assert code == 2
    assert "--every: expected a time from 0" in err
    parameters = tmp_path / "launch.yaml"
    parameters.write_text(
        "/**:\n  ros__parameters:\n    use_sim_time: false\n    node: a b\n    sd: 0.001\n    every: 1 h\n"
    )
    code, err = printed(capsys, "--ros-args", "--params-file", str(parameters))
    assert code == 2
    assert "--every: expected a time from 0" in err
    code, err = printed(capsys, "--ros-args", "--params-file", str(tmp_path / "none.yaml"))
    assert code == 2
    assert "--params-file: expected parameters" in err
    code, err = printed(capsys, "--sd", "1mm", "--table", "0+-1mm", "--pose-prior", "0,0,0mm 0,0,0deg +- 1mm 1deg")
    assert "drop one" in err.lower() or "rclpy" in err
