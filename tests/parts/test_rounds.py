"""Holes and bosses of a part, their rims and patterns: from STEP and from meshes."""

import json

import numpy as np
import pytest

pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")
import trimesh

from drilled import HOLES, as_part, drilled, pin, tip
from tanteo import io, read_part, render
from tanteo.parts import round_features
from tanteo.parts.faces import hole_patterns

BLIND = (-10, 0, 3)


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    """Through holes, a hub, a drilled blind hole with its tip, and a rounded pocket of a quarter turn."""
    more = pin(*BLIND[:2], 6, 13, 3), tip(*BLIND[:2], 4.3, 6, 3), pin(50, 35, -1, 13, 8)
    return as_part(drilled(more=more), tmp_path_factory.mktemp("rounds") / "plate.step")


def named(part, x, y, surface="cylinder"):
    (one,) = [
        r
        for r in round_features(part)
        if r.surface == surface and np.allclose(r.centre[:2], [1e-3 * x, 1e-3 * y], atol=1e-6)
    ]
    return one


def test_holes_and_bosses_are_found(plate):
    rounds = round_features(plate)
    assert sum(r.hole and r.surface == "cylinder" for r in rounds) == len(HOLES) + 1
    assert [r.radii[0] for r in rounds if not r.hole] == pytest.approx([0.012])
    assert all(r.residual < 1e-9 for r in rounds)
    assert round_features(plate) is rounds


@pytest.mark.parametrize("hole", HOLES)
def test_a_through_hole_is_open_at_both_ends(plate, hole):
    one = named(plate, *hole[:2])
    assert one.through
    assert one.name.startswith("hole")
    assert one.length == pytest.approx(0.012)
    assert [rim.open for rim in one.rims] == [True, True]
    low, high = one.rims
    assert np.allclose(low.axis, [0, 0, -1])
    assert np.allclose(high.axis, [0, 0, 1])
    assert np.allclose(high.centre, [1e-3 * hole[0], 1e-3 * hole[1], 0.012])
    tops = [k for rim in one.rims for k in rim.faces]
    assert [plate.faces[k].surface for k in tops] == ["plane", "plane"]


def test_a_blind_hole_points_out_of_its_opening(plate):
    one, cone = named(plate, *BLIND[:2]), named(plate, *BLIND[:2], "cone")
    assert one.through is False
    assert np.allclose(one.axis, [0, 0, 1])
    assert [rim.open for rim in one.rims] == [False, True]
    assert cone.hole
    assert cone.radii.max() == pytest.approx(0.003)


def test_a_boss_points_to_its_free_end(plate):
    (boss,) = [r for r in round_features(plate) if not r.hole]
    assert boss.through is None
    assert np.allclose(boss.axis, [0, 0, 1])
    assert [rim.open for rim in boss.rims] == [False, True]
    assert boss.ends[1, 2] == pytest.approx(0.030)


def test_a_mesh_has_the_same_holes(plate, tmp_path):
    trimesh.Trimesh(1e3 * plate.vertices, plate.triangles, process=False).export(tmp_path / "plate.stl")
    mesh = read_part(tmp_path / "plate.stl", unit="mm")
    for x, y, radius in HOLES:
        one = named(mesh, x, y)
        assert one.hole
        assert one.through
        assert one.radii[0] == pytest.approx(1e-3 * radius, abs=2e-6)
        assert one.residual < 5e-6


def arc(count, radius, turn=0.3):
    t = turn + 2 * np.pi * np.arange(count) / count
    return [(radius * np.cos(a), radius * np.sin(a), 3) for a in t]


@pytest.mark.parametrize(
    ("holes", "kind", "radius", "steps"),
    [
        (arc(5, 25), "bolt circle", 0.025, ()),
        ([(x, y, 3) for x in (-30, 0, 30) for y in (-12, 12)], "grid", None, (0.024, 0.030)),
        ([(x, 0, 3) for x in (-30, -10, 10, 30)], "row", None, (0.020,)),
        ([(-30, -20, 3), (30, -18, 3), (5, 22, 3), (-12, 3, 3)], "irregular", None, ()),
    ],
)
def test_patterns_are_named(holes, kind, radius, steps, tmp_path):
    part = as_part(drilled(holes, hub=None), tmp_path / "plate.step")
    (pattern,) = hole_patterns(part)
    assert pattern.kind == kind
    assert len(pattern.holes) == len(holes)
    assert pattern.hole_radius == pytest.approx(0.003)
    assert pattern.radius == (radius and pytest.approx(radius))
    assert pattern.steps == pytest.approx(steps)


def test_two_holes_or_unlike_ones_are_no_pattern(tmp_path):
    part = as_part(drilled([(-30, 0, 3), (30, 0, 3), (0, 20, 4)], hub=None), tmp_path / "plate.step")
    assert hole_patterns(part) == ()


def test_a_part_without_round_faces_has_none(tmp_path):
    part = as_part(drilled([], hub=None), tmp_path / "plate.step")
    assert round_features(part) == ()
    assert hole_patterns(part) == ()


def test_they_are_shown_in_words_and_json(plate):
    shown = "\n".join(render.text.part_lines(plate))
    assert "through" in shown
    assert "blind" in shown
    assert "irregular" in shown
    document = json.loads(io.documents.part_json(plate))
    names = [one["name"] for one in document["holes_and_bosses"]]
    assert names == [one.name for one in round_features(plate)]
    assert document["hole_patterns"][0]["holes"] == [names[k] for k in hole_patterns(plate)[0].holes]
