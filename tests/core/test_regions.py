"""Places of touches that are even over one region of the part: the mixture of two designs against its formula."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.bodies import flat_bodies
from core.questions import directed, near_pose, random_pose, touched
from core.test_slopes import differences
from tanteo import _core

BODIES = flat_bodies()


def scene(name, n=9, seed=3):
    rng = np.random.default_rng(seed)
    T = random_pose(rng)
    q, normals = touched(BODIES[name], T, n, 1e-3, rng, edgy=0.0)
    Ts = np.stack([near_pose(T, rng, 3e-4, 3e-3) for _ in range(5)])
    return q, normals, Ts, np.zeros((5, q.states)), rng


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("times", [1.5, 20.0])
def test_a_region_has_one_factor_of_its_area(name, times):
    q, _, Ts, zs, _ = scene(name)
    shape = BODIES[name].shape()
    n, log = len(q.points), np.log(times)
    even = _core.log_densities(shape, q.core(), Ts, zs)
    denser = _core.log_densities(shape, replace(q, log_outlier=q.log_outlier - log).core(), Ts, zs)
    region = denser + n * log - log
    got = _core.log_densities(shape, q.core(area_of(q, shape, Ts, zs) / times), Ts, zs)
    np.testing.assert_allclose(got, np.logaddexp(even, region) - np.log(2), rtol=1e-9, atol=1e-9)


def area_of(q, shape, Ts, zs):
    """Return the area of a body, found by the size of the region up to which the design changes nothing."""
    even = _core.log_densities(shape, q.core(), Ts, zs)[0]
    low, high = 1e-6, 10.0
    for _ in range(80):
        middle = np.sqrt(low * high)
        same = _core.log_densities(shape, q.core(middle), Ts, zs)[0] == even
        low, high = (low, middle) if same else (middle, high)
    return high


@pytest.mark.parametrize("name", BODIES)
def test_beams_of_known_direction_have_no_region(name):
    q, normals, Ts, zs, rng = scene(name)
    q, shape = directed(q, normals, rng), BODIES[name].shape()
    even = _core.log_densities(shape, q.core(), Ts, zs)
    np.testing.assert_array_equal(even, _core.log_densities(shape, q.core(1e-5), Ts, zs))


@pytest.mark.parametrize("labelled", [False, True])
def test_gradients_of_both_designs_equal_differences(labelled):
    q, _, Ts, zs, _ = scene("block" if "block" in BODIES else next(iter(BODIES)))
    q = replace(q, groups=(np.arange(len(q.points)) % 3).astype(np.int32)) if labelled else q
    shape = next(iter(BODIES.values())).shape() if "block" not in BODIES else BODIES["block"].shape()
    core = q.core(2e-3)
    _, gradient, information = _core.slopes(shape, core, Ts, zs)
    sd = 1 / np.sqrt(np.maximum(np.einsum("sii->si", information), 1 / shape.diagonal**2))
    assert (np.abs(gradient - differences(shape, core, Ts, zs)) * sd).max() < 1e-3
