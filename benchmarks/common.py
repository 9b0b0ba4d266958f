"""What the subjects share: a table, a stopwatch, and the facts of the machine."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

PACKAGES = ("tanteo", "numpy", "scipy", "pytransform3d", "gtsam", "pin", "jax", "jaxlie")


@dataclass(frozen=True)
class Table:
    """One subject's result: a title, what was done, and rows under columns."""

    title: str
    text: str
    columns: tuple[str, ...]
    rows: list[tuple[str, ...]]

    def markdown(self) -> str:
        lines = [f"## {self.title}", "", self.text, ""]
        lines.append("| " + " | ".join(self.columns) + " |")
        lines.append("|" + " --- |" * len(self.columns))
        lines += ["| " + " | ".join(row) + " |" for row in self.rows]
        return "\n".join(lines)


def seconds(work: Callable[[], object], *, repeats: int = 9, at_least: float = 0.02) -> float:
    """Time of one call: the best of ``repeats`` rounds, each long enough for the clock; the first call is thrown away.

    The best round is the one that other processes disturbed least; every competitor is timed in the same way.
    """
    work()
    start = time.perf_counter()
    work()
    calls = max(1, round(at_least / max(time.perf_counter() - start, 1e-9)))
    best = float("inf")
    for _ in range(repeats):
        start = time.perf_counter()
        for _ in range(calls):
            work()
        best = min(best, (time.perf_counter() - start) / calls)
    return best


def machine() -> str:
    """Processor, cores, Python and versions, as markdown."""
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [
            line.split(":", 1)[1].strip() for line in info.read_text().splitlines() if line.startswith("model name")
        ]
        cpu = names[0] if names else cpu
    versions = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    return (
        f"{cpu}, {os.cpu_count()} cores, of which one is used; {platform.system()}, Python {platform.python_version()};"
        f" {versions}."
    )


def version(package: str) -> str:
    """Installed version, or a dash."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "-"
