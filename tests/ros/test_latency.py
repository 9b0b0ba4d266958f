"""The delay of a moving sensor: its estimate has the stated spread, and a sensor at rest gives none."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from random_parts import slanted_mesh, write_off
from tanteo.geometry import SE3, SO3
from tanteo.parts import Surface, read_part
from tanteo.ros.latency import STEP, estimate_latency
from tanteo.sensors import Readings, measure

SD, DELAY, TRIALS = 2e-4, 0.012, 40
T_WORLD_PART = SE3.from_parts(SO3.axis_rotation(2, 0.6), np.array([0.42, -0.13, 0.035]))


@pytest.fixture(scope="module")
def part(tmp_path_factory):
    path = tmp_path_factory.mktemp("part") / "part.off"
    write_off(path, *slanted_mesh(np.random.default_rng(5)))
    return read_part(path, unit="mm")


def sensor_at(t, part):
    """Return the pose of a sensor that swings about the part and points at its middle."""
    turn = np.array([0.9 * np.sin(1.3 * t), 0.8 * np.sin(1.9 * t), 0.0])
    beam = SO3.exp(turn) @ np.array([0.0, 0.0, -1.0])
    wanders = 0.3 * part.radius * np.array([np.sin(2.9 * t), np.cos(2.3 * t), np.sin(1.7 * t)])
    return SE3.from_parts(SO3.frame_from_axis(beam, 0), SE3.apply(T_WORLD_PART, part.centroid) + wanders - 0.2 * beam)


def ranges_of(part, times):
    surface, inverse = Surface(part.vertices, part.triangles), SE3.inverse(T_WORLD_PART)
    Ts = np.stack([inverse @ sensor_at(t, part) for t in times])
    return surface.cast(Ts[:, :3, 3], Ts[:, :3, 0]).distances


def read(part, times, ranges, noise=0.0):
    Ts = np.stack([sensor_at(t, part) for t in times])
    return Readings.from_columns(
        Ts[:, :3, 3] + ranges[:, None] * Ts[:, :3, 0] + noise, directions=Ts[:, :3, 0], ranges=ranges,
        ids=[str(k) for k in range(len(times))],
    )  # fmt: skip


def estimated(part, moments, ranges, noise=0.0):
    """Return the estimate under the assumption that stamps are the moments of the readings."""
    shifted = [read(part, moments - shift, ranges, noise) for shift in (0.0, -STEP, STEP)]
    hypothesis = SimpleNamespace(T_world_part=T_WORLD_PART, outliers=())
    return estimate_latency(shifted, STEP, partial(measure, sd=SD), hypothesis, part)


def test_the_delay_follows_its_stated_spread(part):
    sensed, rng = np.arange(0.0, 5.0, 0.05), np.random.default_rng(7)
    true = ranges_of(part, sensed)
    sensed, true = sensed[true < 0.5], true[true < 0.5]
    errors = []
    for _ in range(TRIALS):
        found = estimated(part, sensed + DELAY, true, SD * rng.normal(size=(len(true), 3)))
        assert found.contradicts
        errors.append((found.seconds - DELAY) / found.sd)
    low, high = chi2.ppf([0.001, 0.999], TRIALS)
    assert low < np.sum(np.square(errors)) < high


def test_the_message_explains_what_to_do(part):
    sensed = np.arange(0.0, 5.0, 0.05)
    true = ranges_of(part, sensed)
    sensed, true = sensed[true < 0.5], true[true < 0.5]
    late = estimated(part, sensed + DELAY, true)
    assert "Use --latency 17." in late.words(0.005)
    assert "older" in late.words(0.0)
    right = estimated(part, sensed, true)
    assert not right.contradicts


def test_a_sensor_at_rest_gives_no_delay(part):
    times, hit = np.full(40, 0.3), ranges_of(part, np.array([0.3]))[0]
    still = read(part, times, np.full(40, hit))
    hypothesis = SimpleNamespace(T_world_part=T_WORLD_PART, outliers=())
    assert estimate_latency([still] * 3, STEP, partial(measure, sd=SD), hypothesis, part) is None


def test_few_readings_give_no_delay(part):
    times = np.arange(0.0, 0.3, 0.05)
    assert estimated(part, times, ranges_of(part, times)) is None
