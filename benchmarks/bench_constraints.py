"""All pairwise constraints of eight sensed features, with their covariances."""

from __future__ import annotations

import numpy as np
from common import Table, seconds

from tanteo.features import Feature, relate_all
from tanteo.features.kinds import EDGE, PLANE, VERTEX
from tanteo.geometry import SE3

TEXT = """\
`constraints.relate_all`: every constraint that the pairs of features have, each with value, covariance, bias and what
to be careful about. The features lie at random in a cube of 10 cm, so that no pair is parallel."""


def features(planes: int, edges: int, vertices: int) -> list[Feature]:
    rng = np.random.default_rng(8)
    made = []
    for kind, count in ((PLANE, planes), (EDGE, edges), (VERTEX, vertices)):
        for k in range(count):
            sd = np.where(np.array(kind.rows) < 3, 2e-4, 2e-3)
            T = SE3.exp(np.concatenate([rng.uniform(-0.05, 0.05, size=3), rng.normal(size=3)]))
            made.append(Feature(kind, T, np.diag(sd**2), label=f"{kind.name} {k}"))
    return made


def measure() -> Table:
    rows = []
    for planes, edges, vertices in ((3, 3, 2), (8, 0, 0), (4, 4, 0), (20, 20, 10)):
        found = features(planes, edges, vertices)
        table = relate_all(found)
        assert all(np.all(np.isfinite(c.covariance[c.present])) for c in table.columns)
        time = seconds(lambda found=found: relate_all(found))
        name = f"{planes} planes, {edges} edges, {vertices} vertices"
        rows.append((name, str(len(table)), f"{time * 1e3:.3g}", f"{time / len(table) * 1e6:.3g}"))
    return Table(
        "The constraints of a set of features", TEXT, ("", "constraints", "milliseconds", "microseconds each"), rows
    )
