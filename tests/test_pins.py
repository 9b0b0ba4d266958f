"""What CI installs has an exact version and a hash, and the versions are those of ``constraints.txt``."""

from __future__ import annotations

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
FILES = sorted((ROOT / "requirements").glob("*.txt"))
CI = ["wheel-test", "oracles", "ros", "test", "docs"]

DIRECT = {
    "build": [*PROJECT["build-system"]["requires"], "cmake", "ninja", "build"],
    "core": [],
    "test": ["step", "vision", "viewer", "test", "docs"],
    "ros": ["ros"],
    "oracles": ["gtsam", "rapidchecker"],
    "zig": ["ziglang"],
}
"""What each environment is for: extras of the project, or names of packages."""


def entries(file):
    """Return the requirements of a file with their hashes."""
    text = file.read_text(encoding="utf-8").replace("\\\n", " ")
    lines = [line.split("--hash=") for line in text.splitlines() if line.strip() and not line.startswith("#")]
    return [(Requirement(first.strip()), [word.strip() for word in hashes]) for first, *hashes in lines]


def pins(lines):
    """Return the pinned versions by canonical name."""
    found = {}
    for one in lines:
        found.setdefault(canonicalize_name(one.name), set()).add(str(one.specifier))
    return found


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_each_requirement_has_one_version_and_hashes(file):
    for requirement, hashes in entries(file):
        assert re.fullmatch(r"==[\w.]+", str(requirement.specifier)), requirement
        assert hashes, requirement
        assert all(re.fullmatch(r"sha256:[0-9a-f]{64}", one) for one in hashes), requirement


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_pins_with_hashes_are_those_of_constraints(file):
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    stated = pins(Requirement(line) for line in lines if line and not line.startswith("#"))
    for name, versions in pins(requirement for requirement, _ in entries(file)).items():
        assert versions <= stated.get(name, versions), name


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_an_environment_has_all_that_it_is_for(file):
    there = pins(requirement for requirement, _ in entries(file))
    extras, names = PROJECT["project"]["optional-dependencies"], []
    for word in DIRECT[file.stem]:
        names += extras.get(word, [word])
    if file.stem not in ("build", "oracles", "zig"):
        names += PROJECT["project"]["dependencies"]
    for requirement in map(Requirement, names):
        for version in there[canonicalize_name(requirement.name)]:
            assert requirement.specifier.contains(version.removeprefix("=="), prereleases=True), requirement


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
@pytest.mark.parametrize("target", CI)
def test_ci_installs_only_packages_with_hashes(target, tmp_path):
    assert re.search(rf"^make\b.* {target}\b", (ROOT / ".ci" / "run").read_text(), re.MULTILINE)
    command = ["make", "-n", target, f"VENV={tmp_path / 'venv'}"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    installs = [
        line for line in done.stdout.replace("\\\n", " ").splitlines() if re.search(r"\bpip\b.*\binstall\b", line)
    ]
    assert installs
    for line in installs:
        for call in re.findall(r"-m pip [^&]*install[^&]*", line):
            assert "--require-hashes" in call or "--no-deps" in call, call
