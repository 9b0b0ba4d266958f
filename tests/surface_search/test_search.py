"""One search: what it finds from several first poses is there once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bare_scenes import SENSORS, box_centred_pose, holds, no_paths, scene
from tanteo.lie import SE3
from tanteo.matching import PosePrior, Priors
from tanteo.parts import read_part
from tanteo.surface_search import prepare_target, search
from tanteo.surface_search.polish import polish
from tanteo.surface_search.refine import refine
from tanteo.surface_search.rounds import search_all
from tanteo.surface_search.search import Effort, groups_of

PARTS = Path(__file__).parents[2] / "examples" / "parts"


@pytest.fixture(scope="module")
def target():
    return prepare_target(read_part(PARTS / "bracket_left.step"))


def test_poses_turned_about_that_meet_at_one_maximum_are_one(target, monkeypatch):
    """Three more climbs to the best maximum: it is there once, found by them too."""
    rng = np.random.default_rng(1)
    T = box_centred_pose(rng)
    touches, _, _ = scene(target, T, SENSORS[1], 8, rng)
    effort, priors, groups = Effort(500, 8, 10, 3), Priors(radius=0.1), groups_of(touches, target, 2)
    monkeypatch.setattr(search, "slid_beside", lambda *_: (np.zeros((0, 4, 4)), np.zeros(0, dtype=np.int64)))

    def run(turned):
        monkeypatch.setattr(search, "turned_about", lambda *_: (turned, np.full(len(turned), 8)))
        return search.search(touches, no_paths(), target, priors, effort, groups)

    alone = run(np.zeros((0, 4, 4)))
    again = run(alone.Ts[:1] @ SE3.exp(1e-6 * rng.normal(size=(3, 6))))
    assert len(again.Ts) == len(alone.Ts)
    assert again.groups[0] == alone.groups[0] | 8


def test_a_rough_pose_leads_to_its_maximum_for_every_group(target, monkeypatch):
    """No group of readings leads anywhere; what the rough pose alone leads to is no find of one group."""
    rng = np.random.default_rng(2)
    T = box_centred_pose(rng)
    touches, _, _ = scene(target, T, SENSORS[1], 12, rng)
    priors = Priors(radius=0.1, pose=PosePrior(T, np.diag(np.repeat([2e-3, 0.02], 3)) ** 2))
    monkeypatch.setattr(search, "first_poses", lambda *_: (np.zeros((0, 4, 4)), np.zeros(0, dtype=np.int64)))
    groups = groups_of(touches, target, 3)
    found = search.search(touches, no_paths(), target, priors, Effort(100, 8, 8, 3), groups, 2)
    assert found.groups[0] == 0b11100


@pytest.mark.parametrize(
    ("name", "k", "scenes"),
    [pytest.param("bracket_left", 0, (1, 2, 7), marks=pytest.mark.slow), ("clamp", 1, (6, 7))],
)
def test_the_right_pose_is_found_beside_a_reading_that_is_astray(name, k, scenes, monkeypatch):
    """Eight touches, one of them off by millimetres: it pulls rough poses to where no reading fits."""
    part, priors, found = prepare_target(read_part(PARTS / f"{name}.step")), Priors(radius=0.1), {}
    for trimmed in (False, True):
        monkeypatch.setattr(search, "refine", lambda *a, ok=trimmed: refine(*a[:6], *(ok and t for t in a[6:])))
        found[trimmed] = 0
        for i in scenes:
            rng = np.random.default_rng((8, k, i))
            T = box_centred_pose(rng)
            touches, _, _ = scene(part, T, SENSORS[0], 8, rng, stray=0.1)
            maxima = search_all(touches, no_paths(), [part], priors).maxima[0][1]
            best = polish(touches, no_paths(), T[None], part, priors)
            found[trimmed] += maxima.log_evidence[0] > best.log_evidence[0] + 1 or holds(part, maxima, best)
    assert found[True] == len(scenes) > found[False]


def test_of_six_readings_none_is_left_out(target):
    rng = np.random.default_rng(4)
    T = box_centred_pose(rng)
    touches, _, _ = scene(target, T, SENSORS[1], 6, rng)
    rough = T @ SE3.exp(1e-3 * rng.normal(size=(5, 6)))
    same, one_out = (refine(touches, rough, target, np.array([9.0, 3.0]), trimmed=flag)[0] for flag in (False, True))
    assert np.array_equal(same, one_out)
