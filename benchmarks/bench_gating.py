"""Gating one sensed constraint against many values in the model: (25)."""

from __future__ import annotations

import numpy as np
from common import Table, seconds

from tanteo.features import gate

COMBINATIONS = 100_000

TEXT = f"""\
`constraints.gate` on one sensed value against {COMBINATIONS:,} values in the models, and on 100 sensed values against
1,000 each; both return the squared distances and the decision for every combination."""


def measure() -> Table:
    rng = np.random.default_rng(25)
    models = rng.uniform(0, 0.2, size=COMBINATIONS)
    sensed, variances = rng.uniform(0, 0.2, size=(100, 1)), rng.uniform(1e-8, 1e-6, size=(100, 1))
    cases = {
        f"1 value, {COMBINATIONS:,} in the models": lambda: gate(0.1, 1e-7, models, 0.05),
        "100 values, 1,000 in the models": lambda: gate(sensed, variances, models[:1000], 0.05),
    }
    rows = []
    for name, work in cases.items():
        assert work().accept.size == COMBINATIONS
        assert 0 < np.count_nonzero(work().accept) < COMBINATIONS
        time = seconds(work)
        rows.append((name, f"{time * 1e3:.3g}", f"{time / COMBINATIONS * 1e9:.3g}"))
    return Table(f"Gating {COMBINATIONS:,} combinations", TEXT, ("", "milliseconds", "nanoseconds each"), rows)
