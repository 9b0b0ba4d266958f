"""Laws of the touched region: which densities it changes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import tanteo
from tanteo.factors import FreeRays, as_contact_points
from tanteo.posterior import Problem, prepare
from tanteo.posterior.details import details_at
from tanteo.posterior.near_variants import log_density_of_design
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
    scales = found.design_scales[1, 0]
    assert scales[:4].min() > 0
    assert scales[4:8].min() > 0
    np.testing.assert_array_equal(scales[8:], 0.0)


def touches_of_the_top(tried, count):
    """Return touches of the top of a block, evaluated at the true pose, and the fraction of its area."""
    part = prepare(tanteo.read_part(PARTS / "block.step"))
    low, size = part.part.box[0], np.ptp(part.part.box, axis=0)
    top = low[:2] + size[:2] * np.random.default_rng(1).uniform(0.05, 0.95, (tried, 2))
    top = np.c_[top, np.full(tried, part.part.box[1, 2])]
    top = top[np.abs(part.surface.closest(top).distances) < 1e-9][:count]
    readings = tanteo.Readings.from_columns(top, sds=np.full(count, 1e-5))
    problem = Problem(as_contact_points(measure(readings)), FreeRays.none(), tanteo.Priors(radius=0.2))
    objective = start_search(problem, part, np.random.default_rng(0)).objective
    found = details_at(objective, np.eye(4)[None], np.zeros((1, problem.states)))
    return found, part.part.faces[found.faces[0, 0]].area / part.part.area


def test_touched_faces_have_one_factor_of_their_area_each():
    """The touched face of area A_f has the prior A_f / (2 A) and the density 1 / A_f of each touch."""
    found, fraction = touches_of_the_top(60, 8)
    odds = np.log(found.designs[-1, 0] / found.designs[0, 0])
    assert np.isclose(odds, np.log(0.25 / 0.5 * fraction / 2) - 8 * np.log(fraction), atol=0.02)
    np.testing.assert_allclose(np.exp(found.design_scales[-1, 0]), 1 / fraction, rtol=1e-6)


def test_places_of_a_scan_are_worth_fifty_on_touched_faces():
    """One point of a scan at a border then does not outweigh the fit of all others."""
    found, fraction = touches_of_the_top(900, 200)
    np.testing.assert_allclose(np.exp(found.design_scales[-1, 0]), (1 / fraction) ** (50 / 200), rtol=1e-6)


def box(low, high):
    """Return the part and the touches of its lowest and highest face, evaluated at the true pose."""
    corners = np.array([[x, y, z] for x in (0, 0.09) for y in (0, 0.07) for z in (low, high)])
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [(f[0], f[i], f[i + 1]) for f in faces for i in (1, 2)]
    part = prepare(tanteo.part_from_mesh(corners, triangles, unit="m", name="box"))
    rng = np.random.default_rng(1)
    points = np.c_[rng.uniform([0.01, 0.01], [0.08, 0.06], (12, 2)), np.where(np.arange(12) < 8, 0.02, -0.005)]
    readings = tanteo.Readings.from_columns(points, sds=np.full(12, 1e-4))
    problem = Problem(as_contact_points(measure(readings)), FreeRays.none(), tanteo.Priors(radius=0.2))
    objective = start_search(problem, part, np.random.default_rng(0)).objective
    return part.part, details_at(objective, np.eye(4)[None], np.zeros((1, problem.states)))


def test_a_displaced_face_is_one_of_the_touched_faces():
    """A box with a displaced bottom has the density of the taller box, with the priors of the face and its offset."""
    mean = tanteo.Priors(radius=0.2).outlier_rate
    (part, at), (taller, there) = box(0.0, 0.02), box(-0.005, 0.02)
    variant = log_density_of_design(at.of_design(-1 + len(at.log_designs)), part, mean)[0] + at.log_designs[-1, 0]
    real = there.of_design(-1 + len(there.log_designs))
    on, off = np.log1p(-mean) + real.log_hit[0], np.log(mean) + real.log_outlier[0]
    expected = np.logaddexp(on, off).sum() + there.log_designs[-1, 0] + 2 * np.log(taller.area / part.area)
    spread, known = (0.1 * part.diagonal) ** 2, 4 / 1e-4**2
    expected += np.log(0.5 / 6) - 0.5 * 0.005**2 / spread - 0.5 * np.log1p(spread * known)
    assert np.isclose(variant, expected, atol=0.05)
