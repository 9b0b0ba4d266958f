"""Rules of the layout that the import linter does not check."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import re
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import exports

ROOT = Path(__file__).parents[1]
SRC = ROOT / "src" / "tanteo"
BENCHMARKS = [p for p in sorted((ROOT / "benchmarks").glob("*.py")) if p.stem != "against_worker"]
"""But for the one that speaks to older commits."""

TESTS = sorted((ROOT / "tests").rglob("*.py"))

EXPORTS = exports.Exports(ROOT)


def private_imports(folder: Path) -> list[str]:
    """Return the uses of names that are not in a public API, from outside of their packages."""
    found = []
    for path in sorted(folder.rglob("*.py")):
        own = path.relative_to(SRC).parts[0].removesuffix(".py") if path.is_relative_to(SRC) else ""
        for line, module, name in EXPORTS.uses(path):
            if not f"{module}.".startswith(f"tanteo.{own}.") and not EXPORTS.exports(module, name):
                found.append(f"{path.relative_to(ROOT)}:{line} {module}.{name}")
    return found


def test_packages_import_public_names_only():
    assert private_imports(SRC) == []


@pytest.mark.parametrize("folder", ["tests", "benchmarks", "examples", "docs"])
def test_programs_use_public_names_only(folder):
    assert private_imports(ROOT / folder) == []


@pytest.mark.parametrize("path", BENCHMARKS, ids=lambda p: p.stem)
def test_a_benchmark_imports_what_there_is(path):
    """Most run for minutes and in no test: a name that was changed would be found out too late."""
    missing = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "tanteo":
            package = importlib.import_module(node.module)
            missing += [
                f"{node.module}.{a.name}"
                for a in node.names
                if not hasattr(package, a.name) and not is_module(package, a.name)
            ]
    assert missing == []


def is_module(package, name: str) -> bool:
    """Return whether a name is a module of a package."""
    return hasattr(package, "__path__") and importlib.util.find_spec(f"{package.__name__}.{name}") is not None


@pytest.mark.parametrize("path", TESTS, ids=lambda p: p.stem)
def test_names_of_tests_are_short(path):
    names = re.findall(r"def (test_\w+)", path.read_text())
    assert [name for name in names if len(name) > 60] == []
