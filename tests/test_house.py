"""The order of the house, as far as the import linter does not see it."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SRC = ROOT / "src" / "tanteo"
TESTS = sorted((ROOT / "tests").rglob("*.py"))
INSIDE = {"tests": 154, "benchmarks": 19, "examples": 0, "docs": 0}
"""Imports past a door that are left, folder by folder: the numbers may fall."""


def past_doors(folder: Path) -> list[str]:
    """Imports of a module inside a room from outside it."""
    found = []
    for path in sorted(folder.rglob("*.py")):
        own = path.relative_to(SRC).parts[0].removesuffix(".py") if path.is_relative_to(SRC) else ""
        for node in ast.walk(ast.parse(path.read_text())):
            module = (node.module or "") if isinstance(node, ast.ImportFrom) else ""
            if module.startswith("tanteo.") and module.count(".") > 1 and module.split(".")[1] != own:
                found.append(f"{path.relative_to(ROOT)}:{node.lineno} {module}")
    return found


def test_no_room_reaches_past_the_door_of_another():
    assert past_doors(SRC) == []


@pytest.mark.parametrize("folder", INSIDE)
def test_fewer_and_fewer_imports_reach_inside(folder):
    assert len(past_doors(ROOT / folder)) <= INSIDE[folder]


@pytest.mark.parametrize("path", TESTS, ids=lambda p: p.stem)
def test_names_of_tests_are_short(path):
    names = re.findall(r"def (test_\w+)", path.read_text())
    assert [name for name in names if len(name) > 60] == []


def test_no_folder_inside_a_room():
    assert [p for p in SRC.glob("*/*/*.py") if p.parent.parent != SRC] == []
