"""How many readings the demo needs, planned and at random: ``python benchmarks/demo.py [tries]``.

Writes the figures that ``tanteo demo`` compares itself with, one row a try: the same camera image, other noise.
"""

from __future__ import annotations

import csv
import sys
from concurrent.futures import ProcessPoolExecutor
from importlib import resources

import numpy as np

from tanteo.bench.demo import NEEDED, needed, try_it

WORKERS = 2


def counts(policy, tries):
    """Return the number of readings for every seed, in order."""
    with ProcessPoolExecutor(WORKERS) as pool:
        halves = np.array_split(np.arange(tries), WORKERS)
        return np.concatenate(list(pool.map(try_it, [policy] * WORKERS, [half.tolist() for half in halves])))


def main():
    """Count, write, and say what the demo will say."""
    tries = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    rows = zip(range(tries), counts("information", tries), counts("random", tries), strict=True)
    with resources.as_file(resources.files("tanteo.bench.demo").joinpath(NEEDED)) as path, path.open("w") as file:
        file.write(f"# readings that the demo needs: python benchmarks/demo.py {tries}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("seed", "planned", "random"))
        writer.writerows(rows)
    planned, random = needed()
    print(f"In {planned.tries} tries the plan needed {planned}, random places {random}.")


if __name__ == "__main__":
    main()
