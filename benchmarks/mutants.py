"""Measure how many small changes of the code make a test fail: ``python benchmarks/mutants.py [N seed] [--keep FILE]``.

Needs ``pip install cosmic-ray``, whose operators make the changes (a sign, a comparison, a number, a loop that does not
run). N places (300 if not given) are drawn with the seed out of all places of ``geometry``, ``features`` and
``factors`` that can be changed, and at each place one change. Each is made alone in a copy of the project, and the fast
tests of its package run until the first fails; if none fails, the tests of the packages that build on it run too.
Changes of annotations, of text and of ``if TYPE_CHECKING`` blocks are excluded, because no program runs them. Operators
on bits, ``%`` and ``//`` replace no arithmetic operator, because arrays of floats refuse them at once.

Printed: the number of changes that a test found, by package, and every change that no test found, as a diff. With
``--keep FILE`` the results are written as JSON lines, and a second run continues where the first stopped.
"""

from __future__ import annotations

import ast
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from pathlib import Path

from campaign import options

ROOT = Path(__file__).parents[1]
TESTS = {
    "geometry": ("tests/geometry tests/test_special.py", "tests/features", "tests/test_frozen.py"),
    "features": ("tests/features", "tests/test_frozen.py tests/paper tests/test_vectors.py", "tests/fitting"),
    "factors": (
        "tests/factors",
        "tests/test_frozen.py tests/posterior/test_labels.py tests/posterior/test_pose_prior.py",
        "tests/posterior/test_tori.py",
    ),
}
"""Package: folders of tests, the first for every change, the others for those that pass it."""

SECONDS = 200
"""Limit of processor time of one run of tests [s]; a run that needs more counts as failed (an endless loop)."""

PATIENCE = 3600
"""Limit of the duration of one run of tests [s], for a change that waits without computing."""

EASY = ("BitAnd", "BitOr", "BitXor", "LShift", "RShift", "FloorDiv", "Mod", "Invert")
"""Operators that no change puts in place of another."""


def places_not_run(source: str) -> set[tuple[int, int]]:
    """Return the places (line, column) of annotations, docstrings and blocks that only type checkers read."""
    spans: list[ast.AST] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            arguments = (
                *node.args.posonlyargs,
                *node.args.args,
                *node.args.kwonlyargs,
                node.args.vararg,
                node.args.kwarg,
            )
            spans += [argument.annotation for argument in arguments if argument and argument.annotation]
            spans += [node.returns] if node.returns else []
        elif isinstance(node, ast.AnnAssign):
            spans.append(node.annotation)
        elif isinstance(node, ast.If):
            spans += [node] if ast.unparse(node.test) == "TYPE_CHECKING" else []
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            spans.append(node)
    places = set()
    for span in spans:
        for line in range(span.lineno, span.end_lineno + 1):
            first = span.col_offset if line == span.lineno else 0
            last = span.end_col_offset if line == span.end_lineno else 400
            places |= {(line, column) for column in range(first, last + 1)}
    return places


def changes_of(package: str) -> dict[tuple[str, tuple[int, int]], list[tuple[str, str, int, int]]]:
    """Return the changes of a package by place: file, operator, its number in the file, line."""
    from cosmic_ray.ast import ast_nodes, get_ast_from_path
    from cosmic_ray.plugins import get_operator, operator_names

    changes: dict[tuple[str, tuple[int, int]], list[tuple[str, str, int, int]]] = defaultdict(list)
    for path in sorted((ROOT / "src" / "tanteo" / package).rglob("*.py")):
        file = str(path.relative_to(ROOT))
        nodes = list(ast_nodes(get_ast_from_path(path)))
        skipped = places_not_run(path.read_text())
        for name in sorted(operator_names()):
            operator = get_operator(name)
            if operator.arguments() or name.endswith(EASY):
                continue
            positions = [place for node in nodes for place in operator().mutation_positions(node)]
            for k, (start, _end) in enumerate(positions):
                if start not in skipped:
                    changes[file, start].append((file, name, k, start[0]))
    return changes


def survives(folder: Path, change: tuple[str, str, int, int], package: str) -> dict[str, object]:
    """Make one change in the copy, run the tests, restore the file, and return the row of the result."""
    from cosmic_ray.mutating import apply_mutation
    from cosmic_ray.plugins import get_operator

    file, name, k, line = change
    path = folder / file
    original = path.read_text()
    row: dict[str, object] = {"file": file, "operator": name, "number": k, "line": line, "package": package}
    try:
        _, changed = apply_mutation(path, get_operator(name)(), k)
        if changed is None:
            raise RuntimeError(f"{name} {k} changes nothing in {file}: the list of changes is not of this file")
        row["diff"] = _diff(original, changed)
        row["found"] = any(_fails(folder, tests) for tests in TESTS[package])
    finally:
        path.write_text(original)
    return row


def _diff(original: str, changed: str) -> list[str]:
    pairs = zip(original.splitlines(), changed.splitlines(), strict=False)
    return next(([f"- {old.strip()}", f"+ {new.strip()}"] for old, new in pairs if old != new), [])


def _fails(folder: Path, tests: str) -> bool:
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not slow", "-p", "no:cacheprovider", *tests.split()]
    environment = {**os.environ, "PYTHONPATH": str(folder / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, timeout=PATIENCE, preexec_fn=_limited
        )
    except subprocess.TimeoutExpired:
        return True
    if done.returncode not in (0, 1, 2, 4, -signal.SIGXCPU):  # 4: the tests cannot be imported
        raise RuntimeError(done.stdout.decode()[-2000:] + done.stderr.decode()[-2000:])
    return done.returncode != 0


_ONLY_THE_COPY = """import sys
sys.meta_path = [one for one in sys.meta_path if not type(one).__name__.startswith("ScikitBuild")]
"""
"""Module that Python imports at its start: an editable installation would import the unchanged project instead."""


def _import_the_copy(folder: Path) -> None:
    """Make programs in the copy import it, with the compiled core of this environment, and check that they do."""
    from tanteo._core import native

    shutil.copy(native.__file__, folder / "src" / "tanteo" / "_core")
    (folder / "src" / "sitecustomize.py").write_text(_ONLY_THE_COPY)
    command = [sys.executable, "-c", "import tanteo; print(tanteo.__file__)"]
    environment = {**os.environ, "PYTHONPATH": str(folder / "src")}
    found = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.strip()
    if not found.startswith(str(folder)):
        raise RuntimeError(
            f"tests would import {found} instead of the changed copy in {folder}: remove it from the path"
        )


def _limited() -> None:
    """Limit the processor time of the process, so that a busy machine changes no result."""
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 5))


def run(count: int, seed: int, keep: Path | None) -> list[dict[str, object]]:
    """Draw the changes, try each that the file of results lacks, and return all rows."""
    rng = random.Random(seed)
    places = [(package, changes) for package in TESTS for changes in changes_of(package).values()]
    drawn = [(package, rng.choice(changes)) for package, changes in rng.sample(places, count)]
    rows = [json.loads(line) for line in keep.read_text().splitlines()] if keep and keep.exists() else []
    known = {(row["file"], row["operator"], row["number"]) for row in rows}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for entry in ("src", "tests", "examples", "benchmarks", "docs"):
            shutil.copytree(ROOT / entry, folder / entry, ignore=shutil.ignore_patterns("__pycache__"))
        for entry in ("pyproject.toml", "README.md"):
            shutil.copy(ROOT / entry, folder / entry)
        _import_the_copy(folder)
        for package in TESTS:
            for tests in TESTS[package]:
                if _fails(folder, tests):
                    raise RuntimeError(f"{tests} fails without any change: repair it first")
        for package, change in drawn:
            if change[:3] not in known:
                rows.append(survives(folder, change, package))
                if keep:
                    with keep.open("a") as file:
                        file.write(json.dumps(rows[-1]) + "\n")
    return rows


def main() -> None:
    """Run the sample and print what the tests found."""
    arguments, keep, _ = options(sys.argv[1:])
    count, seed = (int(value) for value in [*arguments, *("300", "1991")[len(arguments) :]])
    rows = run(count, seed, keep)
    of, found = Counter(row["package"] for row in rows), Counter(row["package"] for row in rows if row["found"])
    print("| package | changes | found |\n|---|---|---|")
    for package in TESTS:
        print(f"| {package} | {of[package]} | {found[package]} |")
    print(f"| all | {len(rows)} | {sum(found.values())} ({100 * sum(found.values()) / len(rows):.0f} %) |")
    for row in rows:
        if not row["found"]:
            print(f"\n{row['file']}:{row['line']} ({row['operator']})", *row["diff"], sep="\n    ")


if __name__ == "__main__":
    main()
