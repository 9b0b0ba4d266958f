"""Laws of the touched region: which densities it changes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import tanteo
from tanteo.factors import FreeRays, as_contact_points
from tanteo.posterior import Problem, prepare
from tanteo.posterior.details import details_at
from tanteo.posterior.part_search import start_search
from tanteo.sensors import measure

PARTS = Path(__file__).parents[2] / "examples" / "parts"


def test_a_hole_centre_has_no_density_per_length():
    """A centre is on one of the holes with the fraction of that hole, wherever others are sensed."""
    part = prepare(tanteo.read_part(PARTS / "flange.step"))
    top = [[0.05 + 1e-3 * k, 1e-3 * (k % 2), 0.0] for k in range(4)]
    edge = [[0.052 + 1e-3 * k, 2e-3, 0.0] for k in range(4)]
    centres = [[0.052, 0.034, 0.0], [-0.052, 0.034, 0.0]]
    kinds = ["point"] * 4 + ["edge"] * 4 + ["centre"] * 2
    features = [""] * 4 + ["e"] * 4 + ["", ""]
    readings = tanteo.Readings.from_columns(
        np.array([*top, *edge, *centres]), kinds=kinds, features=features, sds=np.full(10, 1e-4)
    )
    problem = Problem(as_contact_points(measure(readings)), FreeRays.none(), tanteo.Priors(radius=0.2))
    objective = start_search(problem, part, np.random.default_rng(0)).objective
    found = details_at(objective, np.eye(4)[None], np.zeros((1, problem.states)))
    scales = found.region_scales
    assert scales[:4].min() > 0
    assert scales[4:8].min() > 0
    np.testing.assert_array_equal(scales[8:], 0.0)
