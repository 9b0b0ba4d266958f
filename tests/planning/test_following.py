"""The next reading after an answer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tanteo
from log_of_touches import SD, made, six_touches, with_the_seventh
from tanteo.planning.following import NextReading, next_reading
from tanteo.render.text import next_lines
from tanteo.sensors import concatenate
from tanteo.words.findings import GoalReached

PARTS = Path(__file__).parents[2] / "examples" / "parts"


@pytest.fixture(scope="module")
def undecided():
    pytest.importorskip("OCP", reason="reading STEP needs tanteo[step]")
    part = tanteo.read_part(PARTS / "bracket_left.step")
    T, readings = six_touches(part, np.random.default_rng((7, 1)))
    answer = tanteo.locate(readings, part, top=100)
    assert answer.status == "ambiguous"
    return part, T, readings, answer


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["bracket_left", *(pytest.param(name, marks=pytest.mark.slow) for name in ("clamp", "housing"))]
)
def test_the_seventh_touch_decides_a_321_log(name):
    pytest.importorskip("OCP", reason="reading STEP needs tanteo[step]")
    part = tanteo.read_part(PARTS / f"{name}.step")
    decided = 0
    for seed in range(6):
        decided += with_the_seventh(part, np.random.default_rng((11, seed)))[1].status == "recognized"
    assert decided >= 4  # with 90 % each, fewer come with a probability of 1.6 %


def test_hypotheses_expect_different_readings(undecided):
    part, _, _, answer = undecided
    found = next_reading(answer, [part], tanteo.probe_of(SD, contact=True))
    first, second = found.finding.expected[:2]
    assert abs(first.distance - second.distance) > 5 * first.sd
    assert found.finding.gain > 0.5
    assert found.finding.message.startswith("Sense ")


def test_the_approach_keeps_to_its_limits(undecided):
    part, _, readings, answer = undecided
    floor = float(readings.points[:, 2].min()) - 0.005
    probe = tanteo.probe_of(
        SD, contact=True, approach=np.array([0, 0, -1.0]), cone=np.pi / 2, axis_parallel=True,
        workspace=tanteo.hand.Workspace.above(floor),
    )  # fmt: skip
    found = next_reading(answer, [part], probe)
    assert np.abs(found.action.direction).max() == pytest.approx(1.0)
    assert found.action.direction[2] <= 1e-9
    assert found.action.origin[2] > floor + probe.clearance


def test_a_reached_goal_needs_no_reading(undecided):
    part, T, readings, answer = undecided
    rng = np.random.default_rng(3)
    seventh = made(next_reading(answer, [part], tanteo.probe_of(SD, contact=True)).action, part, T, rng)
    decided = tanteo.locate(concatenate([readings, seventh]), part)
    assert decided.status == "recognized"
    assert isinstance(next_reading(decided, [part], tanteo.probe_of(SD, contact=True), goal=0.1), GoalReached)
    assert isinstance(next_reading(decided, [part], tanteo.probe_of(SD, contact=True), goal=1e-5), NextReading)


def test_a_free_rotation_has_a_next_reading(undecided):
    part, _, _, answer = undecided
    turning = np.diag([1e-4] * 3 + [4.0, 0.01, 0.01]) ** 2
    free = replace(answer, hypotheses=tuple(replace(h, covariance_relative=turning) for h in answer.hypotheses))
    assert isinstance(next_reading(free, [part], tanteo.probe_of(SD, contact=True)), NextReading)


def test_an_unknown_object_has_no_next_reading(undecided):
    part, _, _, answer = undecided
    assert next_reading(replace(answer, status="unknown"), [part], tanteo.probe_of(SD)) is None


def test_a_goal_must_be_a_length(undecided):
    part, _, _, answer = undecided
    with pytest.raises(tanteo.InputError, match="goal"):
        next_reading(answer, [part], tanteo.probe_of(SD), goal=-1.0)


def test_a_possible_miss_names_how_to_record_it(undecided):
    """A log of contacts alone would lose the miss, and the same place would be named again."""
    part, _, _, answer = undecided
    found = next_reading(answer, [part], tanteo.probe_of(SD, contact=True))
    others = [one for one in found.finding.expected if one.face]
    missed = replace(found.finding, expected=(replace(others[0], face=""), *others))
    for finding, may_miss in ((missed, True), (replace(missed, expected=tuple(others)), False)):
        text = "\n".join(next_lines(answer, replace(found, finding=finding)))
        assert ("status none" in text) == may_miss
