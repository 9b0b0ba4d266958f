"""The size and the order of the house: files, lines, imports past doors, names.

    python benchmarks/house.py [CHECKOUT]

Lines are those that are neither blank nor a comment alone; docstrings count.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parents[1])
SRC = ROOT / "src" / "tanteo"


def lines(paths: Iterator[Path]) -> int:
    return sum(
        bool(line.strip()) and not line.lstrip().startswith("#")
        for path in paths
        for line in path.read_text().splitlines()
    )


def past_doors(folder: Path) -> int:
    """Imports that name a module inside a room from outside it."""
    count = 0
    for path in folder.rglob("*.py"):
        own = path.relative_to(SRC).parts[0].removesuffix(".py") if path.is_relative_to(SRC) else ""
        for node in ast.walk(ast.parse(path.read_text())):
            module = (node.module or "") if isinstance(node, ast.ImportFrom) else ""
            room = module.split(".")[1:2]
            count += module.startswith("tanteo.") and module.count(".") > 1 and room != [own]
    return count


def deferred() -> int:
    """Imports inside functions."""
    return sum(
        isinstance(inner, ast.Import | ast.ImportFrom)
        for path in SRC.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.FunctionDef)
        for inner in ast.walk(node)
    )


def main() -> None:
    names = [n for p in (ROOT / "tests").rglob("*.py") for n in re.findall(r"def (test_\w+)", p.read_text())]
    rooms = sorted(p for p in SRC.iterdir() if (p / "__init__.py").exists())
    rows = {
        "Python files in src": len(list(SRC.rglob("*.py"))),
        "lines of Python in src": lines(SRC.rglob("*.py")),
        "lines of C++": lines(p for p in SRC.rglob("*") if p.suffix in (".cpp", ".hpp")),
        "cli: files": len(list((SRC / "cli").glob("*.py"))),
        "cli: lines": lines((SRC / "cli").glob("*.py")),
        "io: files": len(list((SRC / "io").glob("*.py"))),
        "io: lines": lines((SRC / "io").glob("*.py")),
        "files over 250 lines": sum(len(p.read_text().splitlines()) > 250 for p in SRC.rglob("*.py")),
        "files under 60 lines": sum(
            len(p.read_text().splitlines()) < 60 for p in SRC.rglob("*.py") if p.name != "__init__.py"
        ),
        "imports past a door, src": past_doors(SRC),
        "imports past a door, tests": past_doors(ROOT / "tests"),
        "imports past a door, benchmarks": past_doors(ROOT / "benchmarks"),
        "imports inside functions": deferred(),
        "test functions": len(names),
        "test names over 60 characters": sum(len(n) > 60 for n in names),
        "benchmarks: files": len(list((ROOT / "benchmarks").glob("*.py"))),
        "docs without decisions: lines": sum(len(p.read_text().splitlines()) for p in (ROOT / "docs").glob("*.md")),
        "CHANGELOG: lines": len((ROOT / "CHANGELOG.md").read_text().splitlines()),
        "rooms": len(rooms),
    }
    print("| what | figure |\n|---|---|")
    for what, figure in rows.items():
        print(f"| {what} | {figure} |")
    print("\n| room | files | lines |\n|---|---|---|")
    for room in rooms:
        print(f"| {room.name} | {len(list(room.glob('*.py')))} | {lines(room.glob('*.py'))} |")


if __name__ == "__main__":
    main()
