"""Plates that differ in a hole, of a catalogue or a list, narrowed by centres before any is searched."""

import numpy as np
import pytest

pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")

from bare_scenes import off
from drilled import HOLES, TOP, T, as_part, drilled, heights, sensed
from tanteo import identify
from tanteo.catalogue import build_catalogue, open_catalogue
from tanteo.catalogue.signatures import AXES, signature
from tanteo.posterior import DEFAULTS, identify_points, prepare

MOVED = 3


def holes(k):
    """Return the holes of plate ``k``, whose second hole is displaced or larger."""
    x, y, radius = HOLES[1]
    return [HOLES[0], (x - MOVED * (k % 3), y + MOVED * (k // 3), radius), *HOLES[2:]]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("plates")


@pytest.fixture(scope="module")
def plates(folder):
    return [as_part(drilled(holes(k)), folder / f"plate_{k}.step") for k in range(6)]


@pytest.fixture(scope="module")
def catalogue(plates, folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("catalogue")
    build_catalogue(folder, out, unit="mm", workers=0)
    return open_catalogue(out)


@pytest.fixture
def few(monkeypatch):
    """Narrow any number of parts, as very many are narrowed."""
    monkeypatch.setitem(identify_points.__kwdefaults__, "settings", DEFAULTS.changed("pruning.budget", 1))


def right(answer, plates, k):
    moved, turned = off(plates[k], answer.best.T_world_part, T)
    return answer.best.part == plates[k].name and moved < 3e-4 and turned < 5e-3


@pytest.mark.slow
@pytest.mark.parametrize("stored", [True, False])
def test_the_plate_that_was_sensed_is_recognized(plates, catalogue, stored, few):
    for k in (1, 4):
        rng = np.random.default_rng(k)
        radii = [*(radius * 1e-3 for *_, radius in holes(k)), *[np.nan] * len(TOP)]
        readings = sensed(heights(holes(k), rng), seed=k, hole_radii=radii)
        answer = identify(readings, catalogue if stored else plates, conventions=False)
        assert answer.status == "recognized"
        assert right(answer, plates, k)


def test_plates_whose_hole_was_not_sensed_are_all_named(plates, few):
    answer = identify(sensed(heights([HOLES[k] for k in (0, 2, 3)])), plates, conventions=False, top=10)
    assert answer.status == "ambiguous"
    assert {one.part for one in answer.hypotheses} == {plate.name for plate in plates}


def test_a_hole_that_no_plate_has_is_reported(plates, few):
    moved = heights(holes(0)) + np.array([[0, 0, 0], [4e-3, 4e-3, 0], [0, 0, 0], [0, 0, 0]])
    assert identify(sensed(moved), plates, conventions=False).status != "recognized"


def test_a_table_has_the_axes_of_the_likelihood(plates):
    """One axis for each hole and for the hub."""
    prepared = prepare(plates[0])
    rows = signature(plates[0], lambda: prepared.shape)["axes"]
    assert rows[:, 8].sum() == pytest.approx(1)
    assert len(set(rows[:, 10])) == len(HOLES) + 1
    assert sorted(set(rows[:, 9])) == [-1, 1]
    assert len(rows) == len(HOLES) + 1


def test_of_very_many_holes_the_largest_are_kept(folder, monkeypatch):
    from tanteo.catalogue import signatures

    monkeypatch.setattr(signatures, "AXES", 2)
    part = as_part(drilled(hub=None), folder / "many.step")
    rows = signature(part, lambda: prepare(part).shape)["axes"]
    assert len(set(rows[:, 10])) == 2 < AXES
    assert rows[:, 6] == pytest.approx(4e-3)
    assert rows[:, 8].sum() == pytest.approx(0.5)
