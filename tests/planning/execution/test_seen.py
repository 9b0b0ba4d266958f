"""An image starts the session: open questions of the image come first, and where it is wrong the prior pose counts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sensing_scenes import LASER, true_range
from tanteo.errors import InputError
from tanteo.factors import PythonFactor
from tanteo.geometry import SE3
from tanteo.io import read_camera, read_image, read_marks, read_record, write_record
from tanteo.parts import read_part
from tanteo.planning import Action, Sensing, Session, Stop, at_place, begin
from tanteo.planning.execution import part_seen, seen_start
from tanteo.posterior import Priors, identify_points, prepare
from tanteo.vision import find_edges, see_table
from tanteo.vision.regions import find_regions
from tanteo.vision.table import fit_camera

pytest.importorskip("cv2")

EXAMPLES = Path(__file__).parents[3] / "examples"
NARROW, WIDE = np.diag(np.repeat([0.01, 0.1], 3) ** 2), np.diag(np.repeat([0.02, 0.2], 3) ** 2)


def camera():
    unplaced = read_camera(EXAMPLES / "images" / "camera.yaml")
    placed = fit_camera(unplaced, *read_marks(EXAMPLES / "images" / "marks.csv"))
    return replace(unplaced, T_world_camera=placed.T_world_camera, covariance=placed.covariance)


@pytest.fixture(scope="module")
def steps():
    return [prepare(read_part(EXAMPLES / "parts" / f"step_{n}mm.step")) for n in (12, 15)]


@pytest.fixture(scope="module")
def twins(steps):
    """An image of a part whose silhouette equals its twin's: the step between them is hardly visible from above."""
    image = read_image(EXAMPLES / "images" / "twins.png")
    return see_table(image, camera(), [target.part for target in steps], top=20)


def best_of(seen, name):
    return next(h for h in seen.answer.hypotheses if h.part == name)


@pytest.mark.slow
def test_the_first_reading_is_the_one_that_the_image_cannot_make(twins, steps):
    seen = part_seen(twins)
    assert {h.part for h in seen.answer.hypotheses[:2]} == {"step_12mm", "step_15mm"}
    assert 0.5 < seen.answer.hypotheses[0].probability < 0.8
    probe = replace(LASER, approach=np.array([0.0, 0.0, -1.0]), cone=np.radians(80.0))
    sd = float(probe.law.const)
    start = replace(seen_start(seen, steps), priors=Priors(unknown=0.02))
    session = Session(start, probe, Sensing(sd=sd))
    action = session.ask()
    ranges = [true_range(target, best_of(seen, target.part.name).T_world_part, action) for target in steps]
    assert abs(ranges[0] - ranges[1]) > 2e-3  # of the 3 mm by which the steps differ
    session.tell(action.read(ranges[0]))
    assert session.state.of_parts()[0] > 0.99
    assert session.ask().reached


def test_where_the_image_is_wrong_the_rough_place_holds(twins, steps):
    seen = part_seen(twins)
    rough = at_place(steps, np.eye(4), NARROW)
    start = seen_start(seen, steps, rough)
    n = len(start) - len(rough)
    np.testing.assert_array_equal(start.Ts[n:], rough.Ts)
    np.testing.assert_allclose(start.weights.sum(), 1.0)
    wrong = max(seen.answer.unknown_probability, 0.02)
    np.testing.assert_allclose(start.weights[n:].sum(), wrong)
    h = [h for h in seen.answer.hypotheses if h.probability > 1e-4]
    shares = np.array([x.probability for x in h])
    np.testing.assert_allclose(start.weights[:n], (1 - wrong) * shares / shares.sum())
    np.testing.assert_array_equal(start.Ts[0], h[0].T_world_part)
    alone = seen_start(seen, steps)
    assert len(alone) == n
    assert alone.factors == seen.factors
    assert alone.priors.unknown == Priors().unknown


def test_the_first_belief_is_that_of_the_image(twins, steps):
    seen = part_seen(twins)
    by_part = [sum(h.probability for h in seen.answer.hypotheses if h.part == s.part.name) for s in steps]
    for rough in (None, at_place(steps, best_of(seen, "step_12mm").T_world_part, NARROW)):
        state = begin(seen_start(seen, steps, rough))
        np.testing.assert_allclose(state.of_parts(), by_part, atol=0.08)  # masses by some hundred samples
        assert state.unknown < 0.01


@pytest.mark.parametrize("with_place", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_session_and_batch_give_the_same_answer(twins, steps, with_place):
    """Touches of an image's part, one after the other, or all of them at once: one posterior."""
    seen = part_seen(twins)
    T = best_of(seen, "step_12mm").T_world_part
    place = T @ SE3.from_parts(np.eye(3), steps[0].part.centroid)
    start = seen_start(seen, steps, at_place(steps, place, NARROW) if with_place else None)
    probe = replace(LASER, approach=np.array([0.0, 0.0, -1.0]), cone=np.radians(80.0))
    sd, rng = float(probe.law.const), np.random.default_rng(3)
    session = Session(start, probe, Sensing(sd=sd), stop=Stop(probability=0.99999))
    for _ in range(3):
        action = session.ask()
        session.tell(action.read(true_range(steps[0], T, action) + sd * rng.normal()))
        problem = session.state.posterior.problem
        batch = identify_points(problem.points, problem.rays, steps, priors=start.priors, factors=start.factors, top=20)
        total = [sum(h.probability for h in batch.hypotheses if h.part == s.part.name) for s in steps]
        np.testing.assert_allclose(session.state.of_parts(), total, atol=0.01)
        one, other = session.answer().hypotheses[0], batch.hypotheses[0]
        gap = SE3.log(SE3.inverse(other.T_world_part) @ one.T_world_part)
        assert gap @ np.linalg.solve(other.covariance, gap) < 0.5  # means of some hundred samples
        assert 0.75 < one.corner_sd / other.corner_sd < 1.33


@pytest.mark.slow
@pytest.mark.parametrize(("tolerance", "off"), [(8e-3, 8e-3), (1e-3, 3e-3)])
def test_touches_beside_an_image_of_something_else_find_the_part(twins, steps, tolerance, off):
    """The part lies 25 mm from where the image shows one; its prior pose allows that, and readings say it."""
    seen = part_seen(twins)
    best = best_of(seen, "step_12mm").T_world_part
    T = SE3.from_parts(np.eye(3), np.array([0.025, 0.01, 0.0])) @ best
    place = T @ SE3.from_parts(np.eye(3), steps[0].part.centroid)
    start = seen_start(seen, steps, at_place(steps, place, WIDE))
    probe = replace(LASER, approach=np.array([0.0, 0.0, -1.0]), cone=np.radians(80.0))
    sd, rng = float(probe.law.const), np.random.default_rng(4)
    session = Session(start, probe, Sensing(sd=sd), stop=Stop(tolerance=tolerance))
    for _ in range(12):
        action = session.ask()
        if not isinstance(action, Action):
            break
        distance = true_range(steps[0], T, action)
        session.tell(action.read(distance + sd * rng.normal() if np.isfinite(distance) else np.inf))
    assert session.state.target(0).part.name == "step_12mm"
    assert np.linalg.norm(session.state.poses[0][:3, 3] - T[:3, 3]) < off


@pytest.mark.parametrize("with_place", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_a_session_from_an_image_is_the_same_from_its_record(twins, steps, tmp_path, with_place):
    seen = part_seen(twins)
    T = best_of(seen, "step_12mm").T_world_part
    place = T @ SE3.from_parts(np.eye(3), steps[0].part.centroid)
    probe = replace(LASER, approach=np.array([0.0, 0.0, -1.0]), cone=np.radians(80.0))
    rough = at_place(steps, place, NARROW) if with_place else None
    session = Session(seen_start(seen, steps, rough), probe, Sensing(sd=3e-4))
    action = session.ask()
    session.tell(action.read(true_range(steps[0], T, action)))
    file = tmp_path / "session.json"
    write_record(session, file)
    again = read_record(file, steps)
    assert again.state.unknown == session.state.unknown
    np.testing.assert_array_equal(again.state.poses, session.state.poses)
    np.testing.assert_array_equal(again.state.weights, session.state.weights)


def test_factors_that_no_record_holds_are_refused(twins, steps, tmp_path):
    own = PythonFactor(name="gauge", log_density=lambda Ts, part: np.zeros(len(Ts)))
    start = replace(seen_start(part_seen(twins), steps), factors=(own,))
    with pytest.raises(InputError, match="A record stores only these"):
        write_record(Session(start, LASER, Sensing(sd=3e-4)), tmp_path / "session.json")


def test_nothing_seen_is_rough_place_and_without_one_an_error(steps):
    rough = at_place(steps, np.eye(4), NARROW, Priors(unknown=0.2))
    assert seen_start(None, steps, rough) is rough
    with pytest.raises(InputError, match="expected a known part on the table"):
        seen_start(None, steps)


@pytest.mark.slow
def test_the_object_is_one_at_prior_and_never_known_furniture(steps):
    """Three parts lie there; one is known and excluded, and the prior pose selects one of the others."""
    image = read_image(EXAMPLES / "images" / "three_parts.png")
    regions = find_regions(image, find_edges(image))
    left = see_table(image, camera(), [steps[0].part], ignore=regions[0].mask)
    assert len(left.objects) == len(regions) - 1 == 2
    assert all(not (seen.region.mask & regions[0].mask).any() for seen in left.objects)
    assert part_seen(left) is left.objects[0]
    for seen in left.objects:
        place = seen.answer.hypotheses[0].T_world_part
        middle = SE3.apply(place, seen.modes[0].model.part.centroid)
        rough = at_place(steps[:1], SE3.from_parts(np.eye(3), middle + np.array([0.01, -0.01, 0.03])), WIDE)
        assert part_seen(left, rough) is seen
    assert part_seen(replace(left, objects=())) is None
