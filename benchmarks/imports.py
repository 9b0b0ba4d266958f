"""Time to import readers of typed documents: the figures of decision 64.

    python benchmarks/imports.py

Each is imported in its own process, best of nine; a library that is not installed is skipped.
"""

from __future__ import annotations

import subprocess
import sys

STATEMENTS = {"msgspec": "import msgspec", "cattrs": "import cattrs", "pydantic": "from pydantic import BaseModel"}


def milliseconds(statement: str) -> float | None:
    code = f"import time; a = time.perf_counter(); {statement}; print(1e3 * (time.perf_counter() - a))"
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True) for _ in range(9)]
    return min(float(run.stdout) for run in runs) if runs[0].returncode == 0 else None


if __name__ == "__main__":
    print("| library | import [ms] |\n|---|---|")
    for name, statement in STATEMENTS.items():
        if (best := milliseconds(statement)) is not None:
            print(f"| {name} | {best:.0f} |")
