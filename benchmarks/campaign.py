"""Long campaigns: cases run side by side, their rows kept in a file, so that a campaign that was stopped goes on.

Every campaign takes ``--keep FILE`` (JSON lines, one row a case; cases that are in it are not run again) and
``--processes``: a number, or the address of a Dask scheduler whose workers run the cases (``tcp://HOST:PORT``,
``local:N``), with the same rows. Rows are plain values that say everything that the summary needs.
"""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
from collections.abc import Callable, Hashable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

import numpy as np

from tanteo.catalogue.cluster import run_tasks


def options(arguments: list[str]) -> tuple[list[str], Path | None, int | str]:
    """Return the arguments without ``--keep FILE`` and ``--processes N``, and the values of these two.

    With ``--help`` the docstring of the program is printed, and the program ends.
    """
    if "--help" in arguments:
        print(sys.modules["__main__"].__doc__)
        sys.exit()
    rest, keep, processes = list(arguments), None, 1
    if "--keep" in rest:
        k = rest.index("--keep")
        keep, rest = Path(rest[k + 1]), rest[:k] + rest[k + 2 :]
    if "--processes" in rest:
        k = rest.index("--processes")
        number, rest = rest[k + 1], rest[:k] + rest[k + 2 :]
        processes = int(number) if number.isdecimal() else number
    return rest, keep, processes


def run_cases(
    run: Callable[..., object],
    cases: Iterable[tuple[Hashable, ...]],
    keep: Path | None = None,
    processes: int | str = 1,
) -> list:
    """Return the result of ``run(*case)`` for each case in order; cases in the file ``keep`` are read from there.

    ``run`` is a function of a module (processes find it by name) and each case a tuple of numbers and texts that
    decides everything, seed included. A warning on the error stream names kept rows of other sources.
    """
    cases = list(cases)
    revision, kept = _revision(), _read(keep)
    others = {r for r, _ in kept.values()} - {revision}
    if others:
        print(f"{keep}: rows of other sources ({', '.join(sorted(others))}) beside {revision}", file=sys.stderr)
    done = {case: row for case, (_, row) in kept.items()}

    def record(case, row):
        done[case] = row
        if keep is not None:
            with keep.open("a") as file:
                line = {"case": case, "revision": revision, "row": row}
                file.write(json.dumps(line, default=_plain) + "\n")

    _run(run, [c for c in cases if c not in done], processes, record)
    return [done[case] for case in cases]


def _run(run, cases, processes, record):
    """Record each case when its result is ready."""
    if isinstance(processes, str):
        source = Path(sys.modules[run.__module__].__file__)  # a program is a module, too, for a worker
        tasks = {k: (source.stem, run.__name__, case) for k, case in enumerate(cases)}
        run_tasks(processes, one_case, tasks, lambda k, row: record(cases[k], row), modules=str(Path(__file__).parent))
        return
    if processes <= 1:
        for case in cases:
            record(case, run(*case))
        return
    with ProcessPoolExecutor(processes) as pool:
        tasks = {pool.submit(run, *case): case for case in cases}
        for task in as_completed(tasks):
            record(tasks[task], task.result())


def one_case(task):
    """Return the row of a case, which names a module and its function."""
    module, name, case = task
    return getattr(importlib.import_module(module), name)(*case)


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
    """Return a number or array of NumPy as a JSON type."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"{value!r} cannot be kept: rows are made of numbers, texts, lists and dictionaries")
