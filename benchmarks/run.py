"""Runs the benchmarks and prints them as markdown: ``python benchmarks/run.py [subject ...]``.

A subject is a file ``bench_<subject>.py`` here with a function ``measure() -> Table``; adding one is adding a file.
Everything runs on one core: thread pools are set to one before anything is imported, and where the system allows it
the process is pinned.
"""

from __future__ import annotations

import importlib
import os
import sys
import time
from pathlib import Path

from common import machine

HERE = Path(__file__).parent


def use_one_core() -> None:
    """Before the first import of NumPy or JAX, which read these once."""
    for pool in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS"):
        os.environ[pool] = "1"
    os.environ["JAX_PLATFORMS"] = "cpu"
    os.environ["JAX_ENABLE_X64"] = "1"
    os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def main(names: list[str]) -> int:
    known = sorted(path.stem.removeprefix("bench_") for path in HERE.glob("bench_*.py"))
    wrong = [name for name in names if name not in known]
    if wrong:
        print(f"subject: expected some of {', '.join(known)}, got {', '.join(wrong)}.", file=sys.stderr)
        return 2
    use_one_core()
    print(f"<!-- python benchmarks/run.py {' '.join(names)}".rstrip() + f" ({time.strftime('%Y-%m-%d')}) -->\n")
    print(machine())
    for name in names or known:
        print(f"\n{importlib.import_module(f'bench_{name}').measure().markdown()}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
