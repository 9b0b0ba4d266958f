"""Outlines on a table: the part that has one is likely at any yaw and light, and others as far as they differ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from random_parts import write_off
from tanteo.catalogue import known_stable_poses
from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.parts import read_part
from tanteo.posterior import SeenOutline, WholeObject, candidates

EYE = np.array([0.15, -0.1, 0.6])
PIXEL = 1e-3
QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
BOX = np.array([t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))])
TURNS = 2 * np.pi * np.arange(32) / 32
UNIT_CIRCLE = np.stack([np.cos(TURNS), np.sin(TURNS)])


def wedge(folder, name, a, b, c, cut=15):
    """Return a block, slanted at one end [mm]."""
    corners = np.array([[x, y, z] for x in (0, a) for y in (0, b) for z in (0, c)], dtype=float)
    corners[corners[:, 0] == a, 0] -= cut * (corners[corners[:, 0] == a, 1] > 0)
    write_off(folder / f"{name}.off", corners, BOX)
    return read_part(folder / f"{name}.off", unit="mm")


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wedges")
    sizes = [(90 + 3 * i, 50 + 4 * j, 30 + 5 * k) for i in range(5) for j in range(3) for k in range(3)]
    return tuple(wedge(folder, f"wedge_{k}", *size) for k, size in enumerate(sizes))


def outline(part, rest, yaw, *, place=(0.03, 0.02), light=None, noise=None):
    """Return the image outline of a part in a stable pose, with its shadow under a light from a direction."""
    ways = known_stable_poses(part)
    T = SE3.from_parts(SO3.axis_rotation(2, yaw), np.array([*place, 0.0])) @ ways[rest].T_table_part
    x = SE3.apply(T, part.vertices)
    seen = EYE[:2] + (x[:, :2] - EYE[:2]) * (EYE[2] / (EYE[2] - x[:, 2:]))
    if light is not None:
        seen = np.concatenate([seen, x[:, :2] - x[:, 2:] * np.asarray(light)])
    middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    reach = ((seen - middle) @ UNIT_CIRCLE).max(axis=0)
    return SeenOutline(reach if noise is None else reach + noise, middle, EYE, PIXEL)


def test_an_outline_is_its_own_part_s_at_any_yaw(parts):
    rng = np.random.default_rng(1)
    for k in range(12):
        part, rest = parts[k], k % 3
        log, _ = outline(part, rest, rng.uniform(-3, 3)).by_rest([part])
        assert log[rest] == pytest.approx(np.log(known_stable_poses(part)[rest].probability), abs=0.05)


def test_an_outline_determines_the_pose_of_its_part(parts):
    """In the world, for any place of the table; up to a half turn, which the hull of a block hardly determines."""
    rng = np.random.default_rng(4)
    T_world_table = SE3.exp(np.array([0.3, -0.1, 0.2, 0.1, 0.2, 0.3]))
    for k in range(8):
        yaw, rest = rng.uniform(-3, 3), known_stable_poses(parts[k])[0]
        seen = replace(outline(parts[k], 0, yaw), T_world_table=T_world_table)
        lying = SE3.from_parts(SO3.axis_rotation(2, yaw), np.array([0.03, 0.02, 0.0])) @ rest.T_table_part
        truth = SE3.apply(T_world_table @ lying, parts[k].vertices)
        off = [np.abs(SE3.apply(T, parts[k].vertices) - truth).max() for T in seen.poses(parts, k)]
        assert min(off) < 1e-3


def test_a_shadow_does_not_make_it_another_s(parts):
    rng = np.random.default_rng(2)
    for k in range(12):
        turn, length = rng.uniform(0, 2 * np.pi), rng.uniform(0.1, 0.6)
        seen = outline(parts[k], 0, rng.uniform(-3, 3), light=length * np.array([np.cos(turn), np.sin(turn)]))
        log = seen.log_likelihood(parts)
        assert log[k] > log.max() - 4
        assert log[k] > np.log(known_stable_poses(parts[k])[0].probability) - 2


@pytest.mark.slow
def test_the_true_part_has_its_stated_probability(parts):
    """Of noisy outlines the mean log odds of the truth are high, and its surprises no more than one part allows."""
    rng = np.random.default_rng(3)
    surprises, gains = 0, []
    for k in range(60):
        row = int(rng.integers(len(parts)))
        light = rng.uniform(-0.4, 0.4, 2) if k % 2 else None
        seen = outline(parts[row], 0, rng.uniform(-3, 3), light=light, noise=0.5 * PIXEL * rng.normal(size=32))
        odds = seen.log_odds(parts)
        gains.append(odds[row])
        surprises += odds[row] < np.log(0.1)
    assert surprises <= 3
    assert np.mean(gains) > 0.6  # half of the parts are left, or fewer


def test_a_larger_part_costs_more_than_a_smaller_one(parts):
    """A shadow may be seen beyond a part; a part that is seen nowhere cannot be."""
    small, large = parts[0], parts[-1]
    shadowed = outline(small, 0, 0.4, light=(0.3, 0.2))
    assert shadowed.log_likelihood([large, small])[0] < shadowed.log_likelihood([large, small])[1] - 10
    assert outline(large, 0, 0.4).log_odds([large, small])[0] > 0.5


def test_odds_are_one_on_the_average(parts):
    odds = outline(parts[7], 1, 0.2).log_odds(parts)
    assert np.exp(odds).mean() == pytest.approx(1.0)
    assert odds.min() >= np.log(0.05) - 1e-9


def test_an_outline_of_no_part_favours_the_unknown_object(parts):
    turns = 0.04 + 0.02 * np.cos(5 * TURNS)
    assert (SeenOutline(turns, np.zeros(2), EYE, PIXEL).log_odds(parts) < -2).all()


def test_what_was_measured_counts_together(parts):
    seen = outline(parts[3], 0, 0.1)
    sides = tuple(np.ptp(parts[3].box, axis=0))
    alone, size = WholeObject(outline=seen), WholeObject(sides=sides, side_sd=1e-3)
    both = WholeObject(sides=sides, side_sd=1e-3, outline=seen)
    odds = [candidates.Candidates(parts).log_odds(whole) for whole in (alone, size, both)]
    np.testing.assert_allclose(odds[0] + odds[1], odds[2])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"reach": np.ones(31)}, "reach: expected 32 finite numbers"),
        ({"middle": np.array([0.0, np.nan])}, "middle: expected 2 finite numbers"),
        ({"eye": np.array([0.0, 0.0, -1.0])}, "eye: expected one above the table"),
        ({"pixel": 0.0}, "pixels of a length"),
    ],
)
def test_an_outline_outside_the_camera_is_refused(change, words):
    known = {"reach": np.ones(32), "middle": np.zeros(2), "eye": EYE, "pixel": PIXEL}
    with pytest.raises(InputError, match=words):
        SeenOutline(**{**known, **change})
