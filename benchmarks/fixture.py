"""Real touches of one fixture by two people: seconds, memory, what limits the pose. ``python benchmarks/fixture.py``.

Reads ``fixture_touches`` of the folder of real measurements beside the checkout.
"""

from __future__ import annotations

import resource
import sys
import time
from pathlib import Path

from common import Table

import tanteo
from tanteo.matching.verdict import corner_sd
from tanteo.sensors import measure
from tanteo.surface_search import FreePaths, as_touches, identify_touches, prepare_target

FOLDER = Path(__file__).resolve().parents[2] / "shared" / "data" / "fixture_touches"
SD, TIP = 0.3e-3, (1.5e-3, 1.5e-3, 0.3e-3)


def row(name, target):
    """Figures of one set: median of seven runs on one core."""
    measured = measure(tanteo.read_readings(FOLDER / f"{name}.csv"), sd=SD, tip_sd=TIP)
    touches, times = as_touches(measured), []
    for _ in range(7):
        start = time.process_time()
        answer = identify_touches(touches, FreePaths.none(), [target], shared=measured.shared)
        times.append(time.process_time() - start)
    best = answer.hypotheses[0]
    total, known = (corner_sd(target.part, C) for C in (best.covariance, best.covariance_same_robot))
    return (
        name, f"{len(touches)}", answer.status, f"{sorted(times)[3]:.2f} s", f"{best.p_value:.2f}",
        f"{1e3 * total:.2f} mm", f"{1e3 * known:.2f} mm",
    )  # fmt: skip


def main():
    if not FOLDER.is_dir():
        sys.exit(f"no data at {FOLDER}")
    start = time.process_time()
    target = prepare_target(tanteo.read_part(FOLDER / "fixture.stl", unit="mm"))
    prepared = time.process_time() - start
    rows = [row(name, target) for name in ("novice", "expert")]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    text = f"The part is prepared once, in {prepared:.2f} s. Peak memory of the whole process {peak:.0f} MB."
    columns = ("set", "touches", "status", "processor time", "p", "worst corner (1 sd)", "tip known")
    print(Table("Fixture", text, columns, rows).markdown())


if __name__ == "__main__":
    main()
