"""Which maxima are of one region: by the ellipsoids, by what lies between, and only where nothing is free."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bare_scenes import no_paths, surface_points, touches_of
from tanteo.lie import SE3
from tanteo.matching import Priors
from tanteo.parts import read_part
from tanteo.surface_search import identify_touches, prepare_target
from tanteo.surface_search.polish import polish
from tanteo.surface_search.regions import groups_of_regions

PARTS = Path(__file__).parents[2] / "examples" / "parts"
STEP = np.array([1e-3, 0, 0, 0, 0, 0])


@pytest.fixture(scope="module")
def target():
    return prepare_target(read_part(PARTS / "bracket_left.step"))


def beside_each_other(target, n, steps, sd=1e-3):
    """Maxima at the truth and at so many steps from it, each from its own group of readings; not climbed."""
    rng = np.random.default_rng(5)
    touches = touches_of(surface_points(target, n, rng)[0], sd)
    Ts = np.stack([SE3.exp(k * STEP) for k in steps])
    priors = Priors(radius=target.part.radius)
    found = polish(touches, no_paths(), Ts, target, priors, iterations=0, groups=1 << np.arange(len(Ts)))
    found.log_evidence[:] = 0.0
    return found


def level(Ts, z):
    return np.zeros(len(Ts))


def valley(Ts, z):
    return np.where(np.abs(Ts[:, 0, 3] - 0.5e-3) < 1e-4, -3.0, 0.0)


def test_maxima_within_the_ellipsoid_of_another_are_of_its_region(target):
    found = beside_each_other(target, 40, [0, 1, 30])
    assert groups_of_regions(found, target, level).tolist() == [3, 3, 4]


def test_what_lies_behind_a_valley_is_another_region(target):
    found = beside_each_other(target, 40, [0, 1, 30])
    assert groups_of_regions(found, target, valley).tolist() == [1, 2, 4]


def test_regions_are_joined_by_what_lies_between_them(target):
    found = beside_each_other(target, 40, [0, 2, 1])
    assert groups_of_regions(found, target, level).tolist() == [7, 7, 7]


def test_where_a_motion_is_free_there_is_no_ellipsoid(target):
    found = beside_each_other(target, 40, [0, 1])
    found.information[:, 0] = found.information[:, :, 0] = 0.0
    assert groups_of_regions(found, target, level).tolist() == [1, 2]


@pytest.mark.slow
def test_much_noise_does_not_make_the_search_endless(target, monkeypatch):
    """Readings that scatter more than a wall is thick have many maxima in one region: found once, they are no news."""
    from tanteo.surface_search import rounds

    counted = []
    search = rounds.search
    monkeypatch.setattr(rounds, "search", lambda *a: counted.append(1) or search(*a))
    rng = np.random.default_rng(8)
    for _ in range(4):
        points = surface_points(target, 30, rng)[0] + 4e-3 * rng.normal(size=(30, 3))
        identify_touches(touches_of(points, 4e-3), no_paths(), [target])
    joined = len(counted)
    monkeypatch.setattr(rounds, "groups_of_regions", lambda found, target, log_density: found.groups)
    rng = np.random.default_rng(8)
    for _ in range(4):
        points = surface_points(target, 30, rng)[0] + 4e-3 * rng.normal(size=(30, 3))
        identify_touches(touches_of(points, 4e-3), no_paths(), [target])
    assert joined < len(counted) - joined
