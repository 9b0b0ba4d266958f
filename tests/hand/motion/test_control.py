"""The control law: no overshoot at its gain, margins that are those of the loop."""

import math

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.hand.motion import Loop

LATENCIES = [0.0, 0.005, 0.01, 0.03, 0.05, 0.1]


def response(gain, delay, period, n=4000):
    """Distance from the reference after a step, by the recursion of the module's head."""
    d = [1.0] * (delay + 1)
    for _ in range(n):
        d.append(d[-1] - gain * period * d[-1 - delay])
    return np.array(d)


@pytest.mark.parametrize("latency", LATENCIES)
def test_a_step_is_taken_without_overshoot(latency):
    loop = Loop.of(latency, 0.01)
    d = response(loop.gain, loop.delay, 0.01)
    assert d.min() > -1e-12
    assert abs(d[-1]) < 1e-9


@pytest.mark.parametrize(("latency", "periods"), [(0.0, 0), (0.01, 1), (0.011, 2), (0.025, 3), (0.03, 3), (0.1, 10)])
def test_a_part_of_a_period_is_a_whole_one_of_dead_time(latency, periods):
    assert Loop.of(latency, 0.01).delay == periods


@pytest.mark.parametrize("latency", [0.06, 0.1, 0.2])
def test_a_larger_gain_overshoots(latency):
    loop = Loop.of(latency, 0.01)
    assert response(1.2 * loop.gain, loop.delay, 0.01).min() < -1e-6


@pytest.mark.parametrize("latency", LATENCIES)
def test_the_limit_of_the_gain(latency):
    loop = Loop.of(latency, 0.01)
    below, above = (Loop(s * loop.limit, loop.delay, 0.01) for s in (0.999, 1.001))
    assert below.decay(loop.delay) < 1 < above.decay(loop.delay)
    assert loop.gain_margin == pytest.approx(loop.limit / loop.gain)


@pytest.mark.parametrize("latency", LATENCIES)
def test_the_margin_of_the_latency(latency):
    loop = Loop.of(latency, 0.01)
    last = round(loop.latency_margin / 0.01)
    assert loop.decay(last) <= 1 + 1e-12
    assert loop.decay(last + 1) > 1


@pytest.mark.parametrize("latency", LATENCIES)
def test_the_phase_margin_from_the_frequency_response(latency):
    loop = Loop.of(latency, 0.01)
    w = np.linspace(1e-5, math.pi, 400_001)
    z = np.exp(1j * w)
    open_loop = loop.gain * loop.period * z ** (-loop.delay) / (z - 1)
    k = int(np.argmin(np.abs(np.abs(open_loop) - 1)))
    expected = math.pi + np.unwrap(np.angle(open_loop))[k]
    assert loop.phase_margin == pytest.approx(expected, abs=1e-3)
    assert loop.phase_margin > math.radians(60)
    assert loop.gain_margin > 3


@pytest.mark.parametrize(("latency", "period"), [(-0.01, 0.01), (0.01, 0.0), (math.nan, 0.01)])
def test_loops_that_are_none(latency, period):
    with pytest.raises(InputError, match="latency, period: expected"):
        Loop.of(latency, period)
