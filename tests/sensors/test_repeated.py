"""Readings that came in twice: named with every answer, counted all the same."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tanteo import Readings, identify
from tanteo.factors import as_contact_points
from tanteo.io import read_readings
from tanteo.parts import read_part
from tanteo.sensors import concatenate, measure
from tanteo.sensors.anomalies import find_repeated, without_repeats

EXAMPLES = Path(__file__).parents[2] / "examples"
POINTS = np.arange(12.0).reshape(4, 3) / 100
WORDS = "are equal in place, direction and standard deviation, and each counts"


def warnings_of(points=POINTS, ids="abcd", **columns):
    found = find_repeated(measure(Readings.from_columns(points, ids=list(ids), **columns), sd=1e-3))
    return "" if found is None else found.message


@pytest.mark.parametrize("name", ["bracket_bare", "bracket_left"])
def test_both_sorts_of_answers_name_them(name):
    part = read_part(EXAMPLES / "parts" / "bracket_left.step")
    once = read_readings(EXAMPLES / "readings" / f"{name}.csv")
    again = once.take([2, 4])
    twice = concatenate([once, replace(again, ids=("late", "later"))])
    alone, both = (identify(readings, [part]) for readings in (once, twice))
    assert WORDS not in alone.message
    assert f"Readings 3 and late; 5 and later {WORDS}" in both.message
    assert both.status == alone.status == "recognized"
    assert len(both.hypotheses[0].pairings) == len(alone.hypotheses[0].pairings) + 2


@pytest.mark.parametrize("shift", [0.0, 1e-12])
def test_equal_ones_are_found_and_named_once(shift):
    assert warnings_of() == ""
    assert warnings_of(np.concatenate([POINTS, POINTS[1:2] + shift, POINTS[1:2]]), "abcdef").startswith(
        "Readings b, e and f "
    )


@pytest.mark.parametrize(
    "columns",
    [
        {"directions": [[0, 0, 1], [0, 1, 0]] * 2},
        {"normals": [[0, 0, 1], [0, 1, 0]] * 2, "normal_sds": [0.1] * 4},
        {"sds": [1e-3, 2e-3] * 2},
        {"radii": [1e-3, 2e-3] * 2},
    ],
    ids=lambda columns: next(iter(columns)),
)
def test_what_differs_in_anything_is_another_reading(columns):
    same = np.repeat(POINTS[:2], 2, axis=0)
    assert warnings_of(same).startswith("Readings a and b; c and d ")
    assert warnings_of(same, **columns) == ""
    assert warnings_of(same + 1e-6 * np.arange(4)[:, None]) == ""


def test_many_are_counted():
    points = np.repeat(np.arange(18.0).reshape(6, 3) / 100, 2, axis=0)
    assert warnings_of(points, "abcdefghijkl").startswith(
        "Readings a and b; c and d; e and f (and 3 more such sets) are"
    )


def test_beams_without_hits_are_no_readings_of_a_place():
    free = Readings.from_columns(POINTS, directions=POINTS + 1, max_ranges=np.ones(4), is_free=np.ones(4, dtype=bool))
    assert find_repeated(measure(free)) is None


def test_repeats_of_one_place_are_one_reading():
    drift = 2e-6 * np.arange(10)[:, None] * [0, 0, 1]
    readings = Readings.from_columns(np.concatenate([POINTS, POINTS[1] + drift]))
    kept, found = without_repeats(readings)
    assert kept.ids == ("1", "2", "3", "4")
    assert found.sets == (("2", *map(str, range(5, 15))),)
    assert found.drift == pytest.approx(2e-6, rel=0.2)
    assert "repeat one place, and the first of each counts" in found.message


@pytest.mark.parametrize(
    "shift",
    [[0.3e-4, 0, 1e-6], [2e-4, 0, 0]],
    ids=["two axes", "a line of a scan"],
)
def test_touches_of_several_places_all_count(shift):
    readings = Readings.from_columns(np.arange(5)[:, None] * np.array(shift))
    kept, found = without_repeats(readings)
    assert (len(kept), found) == (5, None)


def test_touches_across_the_approach_are_no_repeats():
    points = np.arange(5)[:, None] * np.array([1e-5, 0, 0])
    readings = Readings.from_columns(points, directions=np.tile([0.0, 0, -1], (5, 1)))
    assert without_repeats(readings)[1] is None


def test_repeats_along_a_slanted_approach_are_one_reading():
    aim = np.array([0.6, 0.0, -0.8])
    points = np.concatenate([POINTS, POINTS[2] + 1e-6 * np.array([3, 0, 5, 2])[:, None] * aim])
    kept, found = without_repeats(Readings.from_columns(points, directions=np.tile(aim, (8, 1))))
    assert (kept.ids, found.sets) == (("1", "2", "3", "4"), (("3", "5", "6", "7", "8"),))


def test_encoders_repeat_a_place_within_micrometres():
    rng = np.random.default_rng(1)
    jitter = rng.uniform(-2e-6, 2e-6, (10, 3)) + 1e-5 * rng.uniform(size=(10, 1)) * [0, 0, 1]
    kept, _ = without_repeats(Readings.from_columns(np.concatenate([POINTS, POINTS[1] + jitter])))
    assert kept.ids == ("1", "2", "3", "4")


def test_coordinates_have_the_variance_of_their_rounding():
    rounded = Readings.from_columns(POINTS, sds=np.full(4, 1e-6), step=1e-4)
    points = as_contact_points(measure(rounded), 2e-5)
    expected = 1e-12 + 4e-10 + 1e-8 / 12
    np.testing.assert_allclose(points.covs, np.broadcast_to(expected * np.eye(3), (4, 3, 3)))
