"""Many mutated files for every reader: ``python -m fuzz [count] [seed] [kind ...]`` in ``tests``, or ``make fuzz``.

An input is read, or refused by one of tanteo's own errors. Anything else is kept in ``build/fuzz`` with its seed and
fails: another exception, the end of the process, no end within 20 s, a gigabyte more than the whole files needed.
Input ``k`` of a seed is always the same.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from fuzz.mutate import mutated, shortened
from fuzz.targets import READERS, SHARES, seeds
from fuzz.worker import serve

HANG, MEMORY = 20.0, 1_000_000_000
KEPT = Path(__file__).parents[2] / "build" / "fuzz"


def kind_of(k, seed, kinds):
    """Return the kind of file of input ``k``; slow kinds are rarer unless kinds were named."""
    shares = np.array([SHARES.get(kind, 1.0) if len(kinds) == len(READERS) else 1.0 for kind in kinds])
    return str(np.random.default_rng((seed, k, 1)).choice(kinds, p=shares / shares.sum()))


def spoiled(k, seed, kind, files):
    """Name and content of input ``k``."""
    rng = np.random.default_rng((seed, k))
    path = files[kind][int(rng.integers(len(files[kind])))]
    content = path.read_bytes()
    return path.name, shortened(content, rng) if kind == "cut" else mutated(content, rng)


def busy():
    """Return how many times longer a process takes because others wait for the same processors, at least 1."""
    return max(os.getloadavg()[0] / (os.cpu_count() or 1), 1.0)


@dataclass
class Worker:
    """A process and what it is at."""

    folder: Path
    job: tuple | None = None
    since: float = 0.0
    base: int = 0
    done: list = field(default_factory=list)

    def __post_init__(self):
        context = get_context("spawn")
        self.pipe, other = context.Pipe()
        self.process = context.Process(target=serve, args=(other, self.folder), daemon=True)
        self.process.start()
        other.close()

    def give(self, job):
        """Send the next input."""
        self.job, self.since = job, time.monotonic()
        self.pipe.send(job[1:])

    def measure_memory(self, kind, path):
        """Measure the memory that a whole file needs."""
        self.pipe.send((kind, path.name, path.read_bytes()))
        word, trace, memory, _ = self.pipe.recv()
        assert word == "read", f"{path}: {word} {trace}"
        self.base = max(self.base, memory)

    def result(self):
        """Return the outcome of an input once its process has ended."""
        try:
            if self.pipe.poll(0.005):
                word, trace, memory, seconds = self.pipe.recv()
                return ("memory" if memory > self.base + MEMORY else word), trace, seconds
        except (EOFError, ConnectionError):
            return "process ended", f"exit code {self.process.exitcode}", 0.0
        if time.monotonic() - self.since > HANG * busy():
            return "hang", "", HANG
        return None

    def end(self):
        """Stop it."""
        self.process.kill()
        self.process.join()


def begun(folder, files, kinds):
    """Return a worker that has read every undamaged file."""
    worker = Worker(folder)
    for kind in kinds:
        for path in files[kind]:
            worker.measure_memory(kind, path)
    return worker


def run(count, seed, kinds, workers=2):
    """Outcomes by kind, slowest by kind, and what was kept."""
    KEPT.mkdir(parents=True, exist_ok=True)
    table, slowest, bad = defaultdict(Counter), Counter(), []
    with tempfile.TemporaryDirectory() as where:
        folder = Path(where)
        os.environ["TANTEO_CACHE"] = str(folder / "cache")
        files, todo = seeds(folder), iter(range(count))
        crew = [begun(folder, files, kinds) for _ in range(workers)]
        while crew:
            for worker in list(crew):
                if worker.job is None:
                    k = next(todo, None)
                    if k is None:
                        worker.end()
                        crew.remove(worker)
                        continue
                    kind = kind_of(k, seed, kinds)
                    worker.give((k, kind, *spoiled(k, seed, kind, files)))
                elif (outcome := worker.result()) is not None:
                    k, kind, name, content = worker.job
                    word, trace, seconds = outcome
                    table[kind][word] += 1
                    slowest[kind] = max(slowest[kind], seconds)
                    worker.job = None
                    if word not in ("read", "refused"):
                        bad.append((k, kind, name, word))
                        (KEPT / f"{seed}-{k}-{name}").write_bytes(content)
                        (KEPT / f"{seed}-{k}-{name}.txt").write_text(f"{kind}: {word}\n{trace}")
                    if word in ("hang", "memory", "process ended"):
                        worker.end()
                        crew[crew.index(worker)] = begun(folder, files, kinds)
    return table, slowest, bad


def main():
    """Fuzz, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=10_000)
    parser.add_argument("seed", nargs="?", type=int, default=1)
    parser.add_argument("kinds", nargs="*", default=list(READERS))
    given = parser.parse_args()
    table, slowest, bad = run(given.count, given.seed, given.kinds)
    print("| file | inputs | read | refused | anything else | slowest |\n| --- | --- | --- | --- | --- | --- |")
    for kind in given.kinds:
        row = table[kind]
        n, fine = row.total(), row["read"] + row["refused"]
        print(f"| {kind} | {n} | {row['read']} | {row['refused']} | {n - fine} | {slowest[kind]:.1f} s |")
    for k, kind, name, word in bad:
        print(f"input {k}, {kind}: {word}; kept as {KEPT}/{given.seed}-{k}-{name}", file=sys.stderr)
    return bool(bad)


if __name__ == "__main__":
    sys.exit(main())
