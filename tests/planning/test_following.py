"""The next reading after an answer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tanteo
from tanteo.geometry import SE3, SO3
from tanteo.parts import Surface
from tanteo.planning.following import NextReading, next_reading
from tanteo.sensors import Readings, concatenate
from tanteo.words.findings import GoalReached

PARTS = Path(__file__).parents[2] / "examples" / "parts"
SD = 5e-5


def six_touches(part, rng):
    """Return the pose of a part at a random yaw, and touches of the 3-2-1 rule at random places."""
    T = SE3.from_parts(SO3.exp(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)])), rng.uniform(-0.2, 0.2, 3))
    surface, (low, high) = Surface(part.vertices, part.triangles), part.box
    points, directions = [], []
    for d, count in (((0, 0, -1.0), 3), ((0, 1.0, 0), 2), ((1.0, 0, 0), 1)):
        d, found = np.array(d), 0
        while found < count:
            origin = rng.uniform(low, high) - 2 * part.diagonal * d
            distance = surface.cast(origin[None], d[None]).distances[0]
            if np.isfinite(distance):
                points.append(origin + distance * d)
                directions.append(d)
                found += 1
    p = SE3.apply(T, np.array(points)) + rng.normal(0, SD, (6, 3))
    return T, Readings.from_columns(p, directions=np.array(directions) @ T[:3, :3].T, sds=np.full(6, SD))


def made(action, part, T, rng):
    """Return the reading that results from an action."""
    surface, d = Surface(part.vertices, part.triangles), action.direction @ T[:3, :3]
    distance = surface.cast(SE3.apply(SE3.inverse(T), action.origin)[None], d[None]).distances[0]
    return action.read(distance + rng.normal(0, SD) if np.isfinite(distance) else np.inf, SD, name="seventh")


@pytest.fixture(scope="module")
def undecided():
    pytest.importorskip("OCP", reason="reading STEP needs tanteo[step]")
    part = tanteo.read_part(PARTS / "bracket_left.step")
    T, readings = six_touches(part, np.random.default_rng((7, 1)))
    answer = tanteo.locate(readings, part, top=100)
    assert answer.status == "ambiguous"
    return part, T, readings, answer


@pytest.mark.parametrize(
    "name", ["bracket_left", *(pytest.param(name, marks=pytest.mark.slow) for name in ("clamp", "housing"))]
)
def test_the_seventh_touch_decides_a_321_log(name):
    pytest.importorskip("OCP", reason="reading STEP needs tanteo[step]")
    part = tanteo.read_part(PARTS / f"{name}.step")
    decided = 0
    for seed in range(6):
        rng = np.random.default_rng((11, seed))
        T, readings = six_touches(part, rng)
        answer = tanteo.locate(readings, part, top=100)
        if answer.status != "recognized":
            found = next_reading(answer, [part], tanteo.probe_of(SD, contact=True))
            assert isinstance(found, NextReading)
            answer = tanteo.locate(concatenate([readings, made(found.action, part, T, rng)]), part)
        decided += answer.status == "recognized"
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


def test_an_unknown_object_has_no_next_reading(undecided):
    part, _, _, answer = undecided
    assert next_reading(replace(answer, status="unknown"), [part], tanteo.probe_of(SD)) is None


def test_a_goal_must_be_a_length(undecided):
    part, _, _, answer = undecided
    with pytest.raises(tanteo.InputError, match="goal"):
        next_reading(answer, [part], tanteo.probe_of(SD), goal=-1.0)
