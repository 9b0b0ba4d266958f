"""Places of touches that are even over the part, a region or some faces: the mixture of designs against its formula."""

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
@pytest.mark.parametrize("times", [1.0, 1.5, 20.0])
def test_three_designs_of_the_places_share_the_prior(name, times):
    q, _, Ts, zs, _ = scene(name)
    body, shape = BODIES[name], BODIES[name].shape()
    areas = 0.5 * np.linalg.norm(body.across, axis=1)
    even = densities(q, shape, Ts, zs, 1.0)
    region = densities(q, shape, Ts, zs, times) - np.log(times)
    table, elements, *_ = _core.details(shape, q.core(), Ts, zs)
    faces = []
    for k in range(len(Ts)):
        touched = np.unique(elements[k][table[k, :, 1] > 0.5])
        shares = np.array([areas[body.faces == face].sum() for face in touched]) / areas.sum()
        prior = np.sum(np.log(shares * np.arange(1, len(shares) + 1) / 2))
        faces.append(prior + densities(q, shape, Ts[k : k + 1], zs[k : k + 1], 1 / shares.sum())[0])
    got = _core.log_densities(shape, q.core(areas.sum() / times), Ts, zs)
    expected = np.logaddexp(np.logaddexp(np.log(0.5) + even, np.log(0.25) + region), np.log(0.25) + faces)
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-9)


def densities(q, shape, Ts, zs, times):
    """Return the log densities if places are so many times as dense as those even over the part."""
    log = np.log(times)
    return _core.log_densities(shape, replace(q, log_outlier=q.log_outlier - log).core(), Ts, zs) + len(q.points) * log


@pytest.mark.parametrize("name", BODIES)
def test_beams_of_known_direction_have_no_region(name):
    q, normals, Ts, zs, rng = scene(name)
    q, shape = directed(q, normals, rng), BODIES[name].shape()
    even = _core.log_densities(shape, q.core(), Ts, zs)
    np.testing.assert_array_equal(even, _core.log_densities(shape, q.core(1e-5), Ts, zs))


@pytest.mark.parametrize("labelled", [False, True])
def test_gradients_of_all_designs_equal_differences(labelled):
    q, _, Ts, zs, _ = scene("block" if "block" in BODIES else next(iter(BODIES)))
    q = replace(q, groups=(np.arange(len(q.points)) % 3).astype(np.int32)) if labelled else q
    shape = next(iter(BODIES.values())).shape() if "block" not in BODIES else BODIES["block"].shape()
    core = q.core(2e-3)
    _, gradient, information = _core.slopes(shape, core, Ts, zs)
    sd = 1 / np.sqrt(np.maximum(np.einsum("sii->si", information), 1 / shape.diagonal**2))
    assert (np.abs(gradient - differences(shape, core, Ts, zs)) * sd).max() < 1e-3
