"""Long campaigns: cases run side by side, their rows kept in a file, so that a campaign that was stopped goes on.

Every campaign takes ``--keep FILE`` (JSON lines, one row a case; cases that are in it are not run again) and
``--processes N``. Rows are plain values that say everything that the summary needs.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Hashable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

import numpy as np


def options(arguments: list[str]) -> tuple[list[str], Path | None, int]:
    """The arguments without ``--keep FILE`` and ``--processes N``, and what these said."""
    rest, keep, processes = list(arguments), None, 1
    if "--keep" in rest:
        k = rest.index("--keep")
        keep, rest = Path(rest[k + 1]), rest[:k] + rest[k + 2 :]
    if "--processes" in rest:
        k = rest.index("--processes")
        processes, rest = int(rest[k + 1]), rest[:k] + rest[k + 2 :]
    return rest, keep, processes


def run_cases(
    run: Callable[..., object], cases: Iterable[tuple[Hashable, ...]], keep: Path | None = None, processes: int = 1
) -> list:
    """What ``run(*case)`` gave for each case, in their order; those that ``keep`` holds are read from there.

    ``run`` is a function of a module (processes find it by name) and each case a tuple of numbers and texts that
    decides everything, seed included. A warning on the error stream says when the kept rows are of other sources.
    """
    cases = list(cases)
    revision, kept = _revision(), _read(keep)
    others = {r for r, _ in kept.values()} - {revision}
    if others:
        print(f"{keep}: rows of other sources ({', '.join(sorted(others))}) beside {revision}", file=sys.stderr)
    done = {case: row for case, (_, row) in kept.items()}
    for case, row in _fresh(run, [c for c in cases if c not in done], processes):
        done[case] = row
        if keep is not None:
            with keep.open("a") as file:
                line = {"case": case, "revision": revision, "row": row}
                file.write(json.dumps(line, default=_plain) + "\n")
    return [done[case] for case in cases]


def _fresh(run, cases, processes):
    """Cases with their rows, in the order in which they are ready."""
    if processes <= 1:
        for case in cases:
            yield case, run(*case)
        return
    with ProcessPoolExecutor(processes) as pool:
        tasks = {pool.submit(run, *case): case for case in cases}
        for task in as_completed(tasks):
            yield tasks[task], task.result()


def _read(keep):
    """Revision and row of every case in the file."""
    if keep is None or not keep.exists():
        return {}
    lines = [json.loads(line) for line in keep.read_text().splitlines() if line.strip()]
    return {tuple(line["case"]): (line["revision"], line["row"]) for line in lines}


def _revision():
    """Name of the sources, with a mark if they were changed."""
    command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def _plain(value):
    """A number or array of numpy as JSON has it."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"{value!r} cannot be kept: rows are made of numbers, texts, lists and dictionaries")
