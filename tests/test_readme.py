"""The README is correct: its commands exist, its code runs, and its output is the program's.

``python tests/test_readme.py`` writes the output of today into the README and the first steps.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tomllib
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
FIRST_STEPS = ROOT / "docs" / "first_steps.md"
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
NUMBER = re.compile(r"-?\d+\.?\d*(?:e-?\d+)?")
BLOCKS = BLOCK.findall(README.read_text(encoding="utf-8"))
CONSOLE = [body for language, body in BLOCKS if language == "console"]
SHOWN = [
    *CONSOLE,
    *(body for _, body in BLOCK.findall(FIRST_STEPS.read_text(encoding="utf-8")) if body.startswith("$ ")),
]
PYTHON = [body for language, body in BLOCKS if language == "python"]
PLAIN = [line for language, body in BLOCKS if not language for line in body.splitlines()]


def tanteo(command, cache):
    """Return the output of ``tanteo ...``, run in the folder of the README."""
    program, *arguments = command.split()
    assert program == "tanteo"
    code = [sys.executable, "-c", "from tanteo.cli import main; main()", *arguments]
    environment = {**os.environ, "TANTEO_CACHE": str(cache), "NO_COLOR": "1", "PYTHONIOENCODING": "utf-8"}
    done = subprocess.run(code, cwd=ROOT, env=environment, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode in (0, 3), done.stderr
    return done.stdout


def equal_but_rounding(shown, real):
    """Return whether two texts have equal words, and numbers that differ by rounding only."""
    if NUMBER.sub("#", " ".join(shown.split())) != NUMBER.sub("#", " ".join(real.split())):
        return False
    pairs = zip(NUMBER.findall(shown), NUMBER.findall(real), strict=True)
    return all(abs(float(a) - float(b)) <= max(0.02 * abs(float(a)), 0.011) for a, b in pairs)


@pytest.fixture
def cache(cache):
    pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")
    return cache


@pytest.mark.parametrize("block", SHOWN, ids=lambda block: block.split("\n")[0].removeprefix("$ tanteo ")[:30])
def test_output_is_that_of_the_program(block, cache):
    command, shown = block.split("\n", 1)
    real = tanteo(command.removeprefix("$ "), cache)
    assert equal_but_rounding(shown, real), f"the page shows\n{shown}\nand the program prints\n{real}"


@pytest.mark.parametrize("block", PYTHON)
def test_code_runs(block, cache):
    assert len([line for line in block.splitlines() if line and not line.startswith("#")]) <= 10
    environment = {**os.environ, "TANTEO_CACHE": str(cache)}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", block],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("recognized bracket_left")


def test_plain_commands_are_known():
    known = {"make demo", "make test"}
    for line in PLAIN:
        assert line in known or line.startswith(("python -m pip install", "tanteo "))
    assert known <= set(PLAIN)


def test_the_command_of_the_demo_is_the_one_shown():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    (command,) = re.findall(r"^\t\$\(BIN\)/(tanteo .*)$", makefile, re.MULTILINE)
    assert command in PLAIN
    assert CONSOLE[0].startswith(f"$ {command}\n")


def test_the_demo_that_is_shown_ends_well():
    (shown,) = (block for block in CONSOLE if block.startswith("$ tanteo demo"))
    assert "It was step_12mm" in shown
    assert "\nstep_12mm, located to" in shown
    assert float(re.search(r"corner farthest off is ([\d.]+) mm", shown)[1]) < 1.0
    planned, others = map(int, re.search(r"the plan needed (\d+) .*, random places (\d+) ", shown).groups())
    assert planned < others
    text = resources.files("tanteo.bench.demo").joinpath("readings_needed.csv").read_text(encoding="utf-8")
    needed = np.array([row.split(",")[1:] for row in text.splitlines()[2:]], dtype=float)
    assert 1.5 * needed[:, 0].mean() < needed[:, 1].mean()
    fewer = needed[:, 1] - needed[:, 0]
    assert fewer.mean() > 5 * fewer.std() / np.sqrt(len(fewer))


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
@pytest.mark.parametrize("target", ["demo", "test"])
def test_make_has_the_targets(target, tmp_path):
    done = subprocess.run(
        ["make", "-n", target, f"VENV={tmp_path / 'venv'}"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "--require-hashes" in done.stdout


def test_ci_runs_the_test_command():
    assert "make test" in (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()


def test_the_two_lines_of_pip_name_what_there_is():
    (install,) = [line for line in PLAIN if line.startswith("python -m pip")]
    assert "-c constraints.txt" in install
    (extras,) = re.findall(r"\[(.*?)\]", install)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert set(extras.split(",")) <= set(project["optional-dependencies"])
    assert project["scripts"]["tanteo"]


def test_constraints_pin_versions_and_name_no_host():
    for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("#"):
            assert re.fullmatch(
                r'[\w.-]+==[\w.]+( ; python_version [<>=]+ "3\.\d+"( and python_version [<>=]+ "3\.\d+")?)?', line
            ), line


def test_the_package_is_typed_and_has_its_presets():
    files = {file.name for package in ("tanteo", "tanteo.sensors") for file in resources.files(package).iterdir()}
    assert {"py.typed", "sensor_presets.csv", "robot_error_presets.csv", "paper-gripper.toml"} <= files


def test_unlike_output_is_noticed():
    assert equal_but_rounding("at x 1.00 mm", "at  x 1.01 mm")
    assert not equal_but_rounding("at x 1.00 mm", "at x 1.10 mm")
    assert not equal_but_rounding("at x 1.00 mm", "at y 1.00 mm")


def update():
    """Write the program's output into the pages."""
    for page in (README, FIRST_STEPS):
        text = page.read_text(encoding="utf-8")
        for language, block in BLOCK.findall(text):
            if language == "console":
                command = block.split("\n", 1)[0]
                real = tanteo(command.removeprefix("$ "), ROOT / ".pytest_cache" / "tanteo")
                text = text.replace(f"```console\n{block}```", f"```console\n{command}\n{real}```")
        page.write_text(text, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    update()
