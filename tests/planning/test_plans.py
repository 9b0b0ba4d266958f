"""Plans keep what they promise."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

from cli.conftest import prism, stl
from sensing_scenes import FLIGHT, LASER, as_rows, beam_hits, carried_out, located, new_session, of_plan, sense
from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.parts import read_part
from tanteo.planning import Probe, begin, discriminate, plan, probe_of
from tanteo.planning.candidates import propose
from tanteo.planning.start import Start, at_pose
from tanteo.posterior import Priors, prepare
from tanteo.posterior.answers import corner_moves, corner_sd
from tanteo.sensors.presets import NoiseLaw, sensor_preset
from tanteo.words.findings import PriorTooWide, SystematicErrorLimits

PARTS = Path(__file__).parents[2] / "examples" / "parts"
TOUCH = Probe("touch", NoiseLaw.of(3e-4), contact=True, standoff=0.03)
FARTHER = replace(TOUCH, standoff=0.06)  # clear of every pose of a large part
C = np.diag(np.repeat([5e-3, 0.05], 3) ** 2)
UP = np.array([0.0, 0.0, 1.0])


@pytest.mark.slow
def test_a_prior_too_wide_for_any_plan_is_named(bracket):
    """10 mm and 5 degrees: touches of its narrow faces may miss, and the others say nothing of one direction."""
    rough, fine = np.diag(np.repeat([0.01, np.radians(5)], 3)) ** 2, replace(TOUCH, law=NoiseLaw.of(1e-5))
    found = plan(at_pose(bracket, np.eye(4), rough), fine, 0.5e-3, max_measurements=8)
    assert not found.reached
    assert "The prior pose is too uncertain" in found.message
    enough = next(n for n, one in enumerate(found.readings, 1) if one.within_if_hit >= 0.95)
    assert f"{enough} suffice where all hit" in found.message
    assert plan(at_pose(bracket, np.eye(4), rough / 100), fine, 0.5e-3).reached


@pytest.fixture(scope="module")
def block(tmp_path_factory):
    path = tmp_path_factory.mktemp("block") / "block.stl"
    path.write_text(stl(prism([(0, 0), (200, 0), (200, 150), (0, 150)], 80)))
    return prepare(read_part(path, unit="mm"))


def test_the_least_goal_counts_faces_that_are_often_missed(tmp_path):
    """The sides of a plate are lower than the prior is wide, but some placements allow their touch."""
    path = tmp_path / "plate.stl"
    path.write_text(stl(prism([(0, 0), (200, 0), (200, 150), (0, 150)], 8)))
    start = at_pose(prepare(read_part(path, unit="mm")), np.eye(4), np.diag([4e-3, 4e-3, 4e-3, 1e-3, 1e-3, 0.02]) ** 2)
    found = plan(start, replace(TOUCH, base_sds=(5e-4, 1e-4)), 5e-4)
    assert not found.readings
    assert isinstance(found.findings[0], SystematicErrorLimits | PriorTooWide)
    assert getattr(found.findings[0], "least", 0.0) < 2e-3


@pytest.fixture(scope="module")
def bracket():
    return prepare(read_part(PARTS / "bracket_left.step"))


@pytest.fixture(scope="module")
def planned(bracket):
    """A plan that brings all corners within 1.2 mm at 90 %."""
    return plan(at_pose(bracket, np.eye(4), C), FARTHER, 1.2e-3, 0.9)


def test_six_planned_touches_of_a_block(block):
    found = plan(at_pose(block, np.eye(4), C), FARTHER, 1e-5, max_measurements=6)
    assert not found.reached
    assert len(found.readings) == 6
    assert found.readings[-1].corner_sd <= 0.65e-3


@pytest.mark.slow
def test_a_plan_promises_what_least_squares_gives(bracket, planned):
    """Simulated readings of the plan, estimated about the expected pose: corner errors against the promised chance."""
    found, tolerance = planned, 1.2e-3
    assert found.reached
    assert 0.9 <= found.readings[-1].within <= found.readings[-1].within_if_hit < 0.99
    within = [r.within_if_hit for r in found.readings]
    assert np.diff(within).min() > -0.005  # the chance is counted over 2,048 draws
    (G, R), rng = as_rows(bracket, *of_plan(found), FARTHER), np.random.default_rng(1)
    xi = rng.normal(size=(4000, 6)) @ np.linalg.cholesky(C).T
    y = xi @ G.T + np.sqrt(R) * rng.normal(size=(4000, len(R)))
    gain = C @ G.T @ np.linalg.inv(G @ C @ G.T + np.diag(R))
    off = np.linalg.norm(np.einsum("cij,sj->sci", corner_moves(bracket.part), xi - y @ gain.T), axis=-1).max(axis=1)
    assert np.mean(off <= tolerance) == pytest.approx(found.readings[-1].within_if_hit, abs=0.02)


@pytest.mark.slow
def test_two_readings_fewer_would_not_do(block):
    """Every plan of two readings less, among other places than those of the plan itself too, misses the confidence."""
    start = at_pose(block, np.eye(4), C)
    found = plan(start, FARTHER, 1.4e-3, 0.95)
    n = len(found.readings)
    fewer = [plan(start, FARTHER, 1.4e-3, 0.95, max_measurements=n - 2, seed=seed) for seed in range(4)]
    assert found.reached
    assert not any(other.reached for other in fewer)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "n"),
    [
        ("housing", 6),
        pytest.param("wedge", 5, marks=pytest.mark.slow),
        pytest.param("housing", 5, marks=pytest.mark.slow),
    ],
)
def test_the_worst_corner_is_as_good_as_in_best_of_many_plans(name, n):
    """Thousands of sets drawn at random, the best of them improved by single exchanges."""
    target = prepare(read_part(PARTS / f"{name}.step"))
    start, rng = at_pose(target, np.eye(4), C), np.random.default_rng(3)
    touches = propose(begin(start), TOUCH, 800, anywhere=False)
    Ts = SE3.exp(rng.normal(size=(200, 6)) @ np.linalg.cholesky(C).T)
    faces = beam_hits(target, Ts, touches.origins, touches.directions)[2]
    touches = touches.take(np.mean(faces == touches.face[:, None], axis=1) > 0.95)  # those that a plan may count on
    assert len(touches) > 100
    rows, variances = as_rows(target, touches.origins, touches.directions, TOUCH)
    best = corner_errors(target, plan(start, TOUCH, 1e-5, max_measurements=n).readings[-1].covariance[None])[0]

    def worst(chosen):
        G = rows[chosen]
        after = np.linalg.inv(np.linalg.inv(C) + np.swapaxes(G, -1, -2) @ (G / variances[chosen][..., None]))
        return corner_errors(target, after)

    sets = rng.integers(len(rows), size=(5000, n))
    for chosen in sets[np.argsort(worst(sets))[:5]]:
        for k in np.tile(np.arange(n), 3):
            others = np.tile(chosen, (len(rows), 1))
            others[:, k] = np.arange(len(rows))
            chosen = others[np.argmin(worst(others))]
        assert best < 1.05 * worst(chosen[None])[0]


def corner_errors(target, covariances):
    """Root mean square error at the worst corner of the part's box ``(k,)``."""
    corners = np.stack(np.meshgrid(*target.part.box.T), axis=-1).reshape(8, 3)
    J = np.stack([np.concatenate([np.eye(3), -SO3.hat(x)], axis=1) for x in corners])
    return np.sqrt(np.einsum("cij,kjl,cil->kc", J, covariances, J).max(axis=1))


@pytest.mark.slow
def test_a_robot_that_is_off_moves_its_readings_alone(bracket):
    """Place and turn of its base, the turn about the world's origin, far from which the part lies: one more draw."""
    T = SE3.from_parts(SO3.exp(np.array([0.3, 0.2, 1.0])), np.array([0.8, -0.5, 0.2]))
    sds, start = (2e-4, 3e-4), at_pose(bracket, T, C)
    found = plan(start, replace(TOUCH, base_sds=sds), 2e-3, max_measurements=1)
    base = SE3.adjoint_inverse(T) @ np.diag(np.repeat(np.square(sds), 3)) @ SE3.adjoint_inverse(T).T
    (reading,) = found.readings
    ranges, cosines, _, g = beam_hits(bracket, T[None], reading.origin[None], reading.direction[None])
    g, r = g[0, 0], TOUCH.own_variance(ranges, cosines)[0, 0]
    expected = C - np.outer(C @ g, C @ g) / (g @ (C + base) @ g + r)
    np.testing.assert_allclose(reading.covariance, expected, atol=1e-6 * np.abs(C).max())
    assert found.before == pytest.approx(corner_sd(bracket.part, C), rel=1e-6)


def test_what_is_known_better_than_the_robot_stays_so(bracket):
    known = 1e-10 * np.eye(6)
    found = plan(at_pose(bracket, np.eye(4), known), replace(TOUCH, base_sds=(1e-3, 1e-3)), 5e-6, max_measurements=3)
    assert found.before == pytest.approx(corner_sd(bracket.part, known), rel=1e-6)
    assert all(r.corner_sd <= found.before for r in found.readings)
    assert plan(at_pose(bracket, np.eye(4), known), replace(TOUCH, base_sds=(1e-3, 1e-3)), 1e-3).readings == ()


@pytest.mark.slow
def test_planned_readings_meet_their_faces_wherever_part_may_be(bracket):
    rough_C = np.diag(np.repeat([8e-3, 0.1], 3) ** 2)
    found, rng = plan(at_pose(bracket, np.eye(4), rough_C), FARTHER, 1e-5, max_measurements=5), np.random.default_rng(4)
    Ts = SE3.exp(rng.normal(size=(300, 6)) @ np.linalg.cholesky(rough_C).T)
    origins, directions = of_plan(found)
    faces = beam_hits(bracket, Ts, origins, directions)[2]
    names = np.array([[bracket.part.faces[f].name if f >= 0 else "" for f in row] for row in faces])
    on_face = names == np.array([r.face for r in found.readings])[:, None]
    assert on_face.mean(axis=1).min() > 0.8


def test_a_bias_does_not_average_out(bracket):
    """Straight from above, touches never place the part's height better than the bias that they share."""
    biased = replace(TOUCH, law=NoiseLaw.of(1e-5), shared_sd=5e-4, approach=np.array([0, 0, -1.0]), cone=1e-6)
    start = at_pose(bracket, np.eye(4), np.diag([1e-6, 1e-6, 5e-3, 1e-6, 1e-6, 1e-6]) ** 2)
    limit = plan(start, biased, 5e-4).findings[0]
    assert limit.source == "bias"
    assert limit.sd == pytest.approx(5e-4, rel=0.02)
    assert limit.least == pytest.approx(1.96 * 5e-4, rel=0.05)
    kept = plan(start, biased, 1.1 * limit.least)
    assert kept.reached
    assert kept.readings[-1].covariance[2, 2] ** 0.5 > 0.99 * 5e-4


@pytest.mark.slow
def test_the_largest_shared_error_is_what_limits_a_plan(bracket):
    """Also beside others, and a reach that leaves directions free is not blamed on an error."""
    start = at_pose(bracket, np.eye(4), C)
    both = replace(TOUCH, form_sd=2e-5, base_sds=(2e-4, 0.0))
    assert plan(start, both, 2e-4).findings[0].source == "robot"
    assert plan(start, replace(both, form_sd=1e-3), 2e-4).findings[0].source == "form"
    above = plan(start, replace(both, approach=-UP, cone=0.5), 1e-3)
    assert above.findings[0].kind == "reach_limits"
    assert above.readings == ()


@pytest.mark.slow
def test_a_robot_that_is_off_is_what_limits_the_plan(bracket):
    off = replace(TOUCH, base_sds=(1e-3, 1e-3))
    found = plan(at_pose(bracket, np.eye(4), C), off, 0.5e-3)
    assert not found.reached
    assert "error of robot and tip" in found.message
    fewer = plan(
        at_pose(bracket, np.eye(4), C), off, 4e-3, 0.3, max_measurements=1
    )  # the message proposes more readings
    assert not fewer.reached
    assert "Allow more readings" in fewer.message


@pytest.mark.slow
def test_a_robot_that_is_off_limits_a_high_confidence_too(bracket):
    off = replace(TOUCH, base_sds=(1e-3, 1e-3))
    assert "error of robot and tip" in plan(at_pose(bracket, np.eye(4), C), off, 2e-3, 0.999).message


@pytest.fixture(scope="module")
def disc(tmp_path_factory):
    """A disc of 360 facets, which is round as far as anybody can feel."""
    path = tmp_path_factory.mktemp("disc") / "disc.stl"
    angles = np.arange(360) * np.pi / 180
    path.write_text(stl(prism([(40 * np.cos(a), 40 * np.sin(a)) for a in angles], 25)))
    target = prepare(read_part(path, unit="mm"))
    assert target.part.symmetry.continuous
    return target


@pytest.mark.slow
def test_the_spin_of_a_round_part_needs_no_reading(disc):
    found = plan(at_pose(disc, np.eye(4), C), TOUCH, 1.5e-3)
    assert found.reached
    assert len(found.readings) <= 8
    session = new_session(at_pose(disc, np.eye(4), C), tolerance=1.5e-3, max_measurements=12)
    end = sense(session, disc, SE3.exp(np.array([2e-3, -1e-3, 1e-3, 0.02, 0.01, 0.03])), np.random.default_rng(1))
    assert end.reached
    assert session.steps[-1].corner_sd < 1e-3


def test_out_of_reach_is_reported(bracket):
    from tanteo.hand import Workspace

    away = replace(TOUCH, workspace=Workspace.above(3.0))
    found = plan(at_pose(bracket, np.eye(4), C), away, 1e-3)
    assert found.readings == ()
    assert "outside the workspace" in found.message


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        (
            {"standoff": 0.1, "approach": np.array([0.0, 0.0, -1.0]), "cone": 0.1, "stylus": UP},
            r"before the surface.*--standoff",
        ),
        ({"approach": UP, "cone": 0.1, "stylus": UP}, "--approach"),
    ],
)
def test_the_limit_that_prevents_every_touch_is_named(bracket, limits, words):
    """A ceiling of 0.12 m above a part of 0.06 m is too low for a long stand-off."""
    from tanteo.hand import Workspace

    low = replace(TOUCH, workspace=Workspace(np.array([-1, -1, -0.1]), np.array([1, 1, 0.12])), **limits)
    found = plan(at_pose(bracket, np.eye(4), C), low, 1e-3)
    assert found.readings == ()
    assert re.search(words, found.message), found.message


@pytest.mark.parametrize(
    ("tolerance", "confidence", "max_measurements"), [(0.0, 0.9, 5), (np.nan, 0.9, 5), (1e-3, 1.0, 5), (1e-3, 0.9, 0)]
)
def test_a_plan_that_cannot_be_meant_is_refused(bracket, tolerance, confidence, max_measurements):
    with pytest.raises(InputError, match="plan"):
        plan(at_pose(bracket, np.eye(4), C), TOUCH, tolerance, confidence, max_measurements)


@pytest.mark.slow
@pytest.mark.parametrize("names", [("bracket_left", "bracket_right"), ("step_12mm", "step_15mm")])
def test_one_reading_distinguishes_twins(names):
    pair = [prepare(read_part(PARTS / f"{name}.step")) for name in names]
    found = discriminate(*pair, LASER)
    assert found.parts == names
    assert found.information > 0.6
    assert abs(found.ranges[0] - found.ranges[1]) > 5 * found.sds.max()
    assert "discriminate" in found.message
    right = 0
    for seed in range(4):
        rng = np.random.default_rng(seed)
        k = seed % 2
        poses = found.T_first_second[None] if k == 0 else SE3.inverse(found.T_first_second)[None]
        start = Start(
            tuple(pair), np.array([k] + [1 - k] * len(poses)), np.concatenate([np.eye(4)[None], poses]),
            np.stack([located(pair[k], 2e-4)] + [located(pair[1 - k], 2e-4)] * len(poses)),
            np.r_[0.5, np.full(len(poses), 0.5 / len(poses))], Priors(),
        )  # fmt: skip
        session = new_session(start, max_measurements=1, probability=0.999)
        sense(session, pair[k], SE3.exp(np.linalg.cholesky(start.covariances[0]) @ rng.normal(size=6)), rng)
        right += session.state.of_parts()[k] > 0.9
    assert right == 4


def test_a_step_is_discriminated_from_its_twin():
    """The 3 mm are then all in one place; spread over the part, a beam beside the foot would seem to decide it."""
    pair = [prepare(read_part(PARTS / f"step_{n}mm.step")) for n in (15, 12)]
    found = discriminate(*pair, LASER)
    for T in (np.eye(4), found.T_first_second):  # the files have one frame
        to = SE3.inverse(T)
        reads = pair[1].surface.cast(SE3.apply(to, found.origin), to[:3, :3] @ found.direction).distances
        assert not abs(reads - found.ranges[0]) < 1e-3


def test_the_stated_spread_is_that_of_place_and_noise():
    """Both parts are drawn from their located poses: the spread of the reading, against the stated one."""
    names, rng, sd = ("step_12mm", "step_15mm"), np.random.default_rng(2), 1e-3
    pair = [prepare(read_part(PARTS / f"{name}.step")) for name in names]
    found = discriminate(*pair, LASER, sd)
    xi = np.linalg.cholesky(located(pair[0], sd)) @ rng.normal(size=(4000, 6, 1))
    ranges = beam_hits(pair[0], SE3.exp(xi[..., 0]), found.origin[None], found.direction[None])[0][0]
    ranges = ranges[np.abs(ranges - found.ranges[0]) < 6 * found.sds[0]]
    spread = np.hypot(np.std(ranges), float(LASER.law.const))
    assert len(ranges) > 3000
    assert found.sds[0] == pytest.approx(spread, rel=0.1)


def test_indistinguishable_parts_are_reported():
    same = prepare(read_part(PARTS / "wedge.step"))
    found = discriminate(same, same, FLIGHT)
    assert found.information < 0.05
    assert "No single reading" in found.message


def test_what_is_known_well_enough_needs_no_reading(block):
    found = plan(at_pose(block, np.eye(4), C), TOUCH, 1.0)
    assert (found.reached, found.readings) == (True, ())
    assert found.message.startswith("No reading is needed: the prior pose has all corners of block within 1000 mm")


@pytest.mark.slow
def test_a_part_that_may_be_anywhere_is_not_planned_for(block):
    """A linear plan would promise what readings that meet nothing cannot keep."""
    found = plan(at_pose(block, np.eye(4), np.diag(np.repeat([10.0, 0.05], 3) ** 2)), TOUCH, 1e-3)
    assert not found.reached
    assert "would hit its face at" in found.message


def test_what_a_probe_cannot_be_names_the_value():
    with pytest.raises(InputError, match=r"standoff: expected a positive number up to 1e\+06, got 0\."):
        Probe("p", NoiseLaw.of(1e-4), standoff=0.0)
    with pytest.raises(InputError, match=r"standoff: expected at most 300 mm, .*, got 1000 mm\. Start nearer"):
        Probe("p", NoiseLaw.of(1e-4), standoff=1.0, max_range=0.3)


@pytest.mark.slow
def test_what_a_plan_promises_is_kept_wherever_the_part_lies():
    """The plan of the docs for one edge: 40 placements from the stated start, misses and all."""
    wedge, tolerance, sd = prepare(read_part(PARTS / "wedge.step")), 3e-4, 1e-4
    J = SE3.adjoint(SE3.from_parts(np.eye(3), wedge.part.centroid))
    start = at_pose(wedge, np.eye(4), J @ np.diag(np.repeat([5e-3, np.radians(3)], 3) ** 2) @ J.T)
    found = plan(start, Probe("laser", NoiseLaw.of(sd)), tolerance, feature="edge 7")
    promised = found.readings[-1].within
    assert found.reached
    assert 0.95 <= promised <= found.readings[-1].within_if_hit
    rng = np.random.default_rng(27)
    kept = sum(carried_out(found, wedge, start, sd, rng) <= tolerance for _ in range(40))
    assert binom.cdf(kept, 40, promised) > 0.005


@pytest.mark.slow
def test_a_plan_states_how_many_readings_a_session_needs(planned):
    """Readings that replace misses are none of a session, which aims again."""
    (found,) = planned.findings
    enough = next(n for n, one in enumerate(planned.readings, 1) if one.within_if_hit >= 0.9)
    assert 6 <= enough < len(planned.readings)
    assert found.in_session == enough
    assert f"{enough} suffice where all hit; the others replace misses. A session" in planned.message


@pytest.mark.slow
def test_the_share_of_placements_where_all_meet_is_as_counted(bracket, planned):
    found, rng = planned, np.random.default_rng(5)
    Ts = SE3.exp(rng.normal(size=(3000, 6)) @ np.linalg.cholesky(C).T)
    origins, directions = of_plan(found)
    _, cosines, faces, _ = beam_hits(bracket, Ts, origins, directions)
    names = np.array([r.face for r in found.readings])
    of = np.array([face.name for face in bracket.part.faces])
    on_face = (faces >= 0) & (of[faces] == names[:, None])
    on_face &= cosines >= np.cos(TOUCH.max_incidence)
    assert found.all_meet == pytest.approx(on_face.all(axis=0).mean(), abs=0.04)


@pytest.mark.slow
def test_a_start_in_contact_with_the_part_is_reported():
    """8 mm before a part that is known to 5 mm: in some placements the probe would start in it."""
    step = prepare(read_part(PARTS / "step_12mm.step"))
    start = at_pose(step, np.eye(4), np.diag(np.repeat([5e-3, np.radians(3)], 3) ** 2))
    close = replace(TOUCH, standoff=8e-3, clearance=4e-3)
    found = plan(start, close, 0.7e-3, max_measurements=5)
    assert not found.reached
    assert found.all_clear < 0.5
    assert "within 4 mm of the part, or inside it" in found.message
    assert "--standoff" in found.message
    roomy = plan(start, FARTHER, 1.5e-3)
    assert roomy.reached
    assert roomy.all_clear > 0.95


def test_a_probe_without_enough_clearance_gets_its_value(bracket):
    start = at_pose(bracket, np.eye(4), C)
    found = plan(start, probe_of(sensor_preset("inductive_analog_m18")), 1e-3)
    assert found.readings == ()
    assert "It needs 10 mm of clearance" in found.message
    assert "--clearance 5mm" in found.message
    nearer = plan(start, probe_of(sensor_preset("inductive_analog_m18"), clearance=5e-3), 1e-3)
    assert "reaches no place" not in nearer.message


@pytest.mark.slow
def test_a_wide_cone_misses_more_than_its_axis_does(bracket):
    """At an edge of a face some of its rays pass by: what is promised counts that."""
    start = at_pose(bracket, np.eye(4), C)
    probes = (Probe("p", NoiseLaw.of(3e-3), beam_half_angle=np.radians(a), standoff=0.1) for a in (0.1, 15))
    thin, wide = (plan(start, probe, 1e-5, max_measurements=6) for probe in probes)
    assert np.mean([r.meets for r in wide.readings]) < np.mean([r.meets for r in thin.readings]) - 0.02
    assert wide.all_meet < thin.all_meet - 0.1


@pytest.mark.slow
@pytest.mark.parametrize("placements", [20, 40])
def test_a_plan_counts_the_errors_that_locate_assumes(placements):
    pytest.importorskip("OCP", reason="reading STEP needs tanteo[step]")
    block = prepare(read_part(PARTS / "block.step"))
    J = SE3.adjoint(SE3.from_parts(np.eye(3), block.part.centroid))
    start = at_pose(block, np.eye(4), J @ np.diag(np.repeat([3e-3, np.radians(2)], 3) ** 2) @ J.T)
    found = plan(start, Probe("touch", NoiseLaw.of(1.5e-4), contact=True, standoff=0.03), 4e-4)
    assert "State smaller ones with --scale-sd" in found.message
    stated, rng = found.findings[0].within_assumed, np.random.default_rng(53)
    kept = sum(carried_out(found, block, start, 1.5e-4, rng, assumed=True) <= 4e-4 for _ in range(placements))
    assert binom.ppf(1e-3, placements, stated) <= kept <= binom.ppf(0.999, placements, stated)
    assert kept < binom.ppf(0.02, placements, found.readings[-1].within)
