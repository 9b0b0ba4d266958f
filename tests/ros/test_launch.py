"""The launch file of the page on ROS starts the command with options that it has."""

from __future__ import annotations

import re
import sys
import types
from pathlib import Path

from tanteo.cli import main

PAGE = Path(__file__).parents[2] / "docs" / "ros.md"


def test_the_launch_file_of_the_page_starts_the_node(monkeypatch, capsys):
    launch, actions = types.ModuleType("launch"), types.ModuleType("launch.actions")
    launch.LaunchDescription = list
    actions.ExecuteProcess = lambda cmd, output: cmd
    monkeypatch.setitem(sys.modules, "launch", launch)
    monkeypatch.setitem(sys.modules, "launch.actions", actions)
    names = {}
    exec(re.search(r"```python\n(from launch.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[1], names)
    [words] = names["generate_launch_description"]()
    assert words[:2] == ["tanteo", "ros"]
    try:
        main(["ros", "--help"])
    except SystemExit:
        shown = capsys.readouterr().out
    own = words[: words.index("--ros-args")]
    assert [word for word in own if word.startswith("--") and word not in shown] == []
