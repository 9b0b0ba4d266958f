"""Points against coarse fields of many parts: the right part and pose are found among any other parts."""

import numpy as np
import pytest

from random_parts import write_off
from tanteo import _core
from tanteo.catalogue import build_catalogue, open_catalogue
from tanteo.factors import FreeRays, surface_points
from tanteo.geometry import SE3
from tanteo.parts import read_part
from tanteo.posterior import Problem, candidate_pruning, candidates, sized

SD, LEVELS = 1e-4, 24.0
SIDES = 1e-3 * np.array([[40, 30, 20], [40, 30, 26], [44, 34, 12], [40, 18, 20], [1, 0.7, 0.4], [9e3, 5e3, 4e3]])
"""Of blocks, two of which are tiny and huge: the one holds no point, and in the other all are within a cell [m]."""


def tables(sides):
    """Columns of blocks about their origins, as a catalogue has them."""
    fields, grids = [], []
    for side in np.atleast_2d(sides):
        step = side.max() / 14
        counts = 2 * np.ceil(side / (2 * step) - 1e-9).astype(int).clip(1) + 5
        origin = -0.5 * step * (counts - 1)
        axes = [origin[k] + step * np.arange(counts[k]) for k in range(3)]
        off = np.abs(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)) - side / 2
        distance = np.linalg.norm(np.maximum(off, 0), axis=-1) + np.minimum(off.max(axis=-1), 0)
        fields.append(np.rint(distance / step * LEVELS).clip(-127, 127).astype(np.int8).ravel())
        grids.append(np.r_[origin, step, counts])
    side = np.atleast_2d(sides)
    area = 2 * (side[:, 0] * side[:, 1] + side[:, 1] * side[:, 2] + side[:, 2] * side[:, 0])
    return {
        "field": np.concatenate(fields), "field_start": np.cumsum([0, *map(len, fields)]),
        "grid": np.float32(grids), "spacings": np.sqrt(area / 64), "centres": np.zeros((len(side), 3)),
        "boxes": np.hstack([-side / 2, side / 2]), "levels": LEVELS,
        "rows": np.arange(len(side), dtype=np.int32), "kinds": np.arange(len(side), dtype=np.int32),
    }  # fmt: skip


def on_block(side, n, seed):
    """Points on a block at a random pose, and the pose."""
    rng = np.random.default_rng(seed)
    p = rng.uniform(-0.5, 0.5, (n, 3))
    axis = rng.choice(3, size=n, p=1 / np.array(side) / np.sum(1 / np.array(side)))
    p[np.arange(n), axis] = rng.choice([-0.5, 0.5], n)
    T = SE3.exp(np.r_[rng.uniform(-0.3, 0.3, 3), rng.normal(size=3)])
    return SE3.apply(T, p * side) + SD * rng.normal(size=p.shape), T


def evaluate(table, points, **changed):
    n = len(points)
    given = {
        "best": 1e9, "gap": 1e9, "points": points, "normals": np.zeros((n, 3)), "sds": np.full(n, SD),
        "tilts": np.ones(n), "radii": np.zeros(n), "most": 8.0, "stepped": 32, "keep": 4,
    }  # fmt: skip
    return _core.coarse(**{**table, **given, **changed})


@pytest.mark.parametrize("row", range(len(SIDES) - 2))
def test_the_block_that_was_sensed_costs_least(row):
    points, T = on_block(SIDES[row], 24, row)
    scores, costs, Ts = evaluate(tables(SIDES), points)
    assert costs[row, 0] == costs[:5, 0].min() < 3
    assert costs[4, 0] == 8 * 24
    assert scores[row] < scores.min() + 3
    turned = Ts[row, :, :3, :3].transpose(0, 2, 1) @ T[:3, :3]
    assert np.linalg.norm(Ts[row, 0, :3, 3] - T[:3, 3]) < 1e-3
    assert np.abs(np.abs(turned[0]).max(axis=1) - 1).max() < 0.02  # but for half turns of the block


def test_parts_of_a_kind_find_their_own_poses():
    """One part's poses are begun from, another is sensed."""
    table = tables(SIDES[:2]) | {"kinds": np.zeros(2, dtype=np.int32)}
    for seed in range(5):
        points, _ = on_block(SIDES[1], 24, seed)
        _, costs, _ = evaluate(table, points)
        assert costs[1, 0] < 3
        assert costs[1, 0] < costs[0, 0]


def test_a_score_far_below_costs_the_most_and_changes_no_other():
    points, _ = on_block(SIDES[0], 24, 7)
    scores, whole, _ = evaluate(tables(SIDES), points)
    some = evaluate(tables(SIDES), points, gap=12.0)[1]
    near = scores <= scores.min() + 12
    assert 0 < near.sum() < len(SIDES)
    np.testing.assert_array_equal(some[near], whole[near])
    assert np.all(some[~near] == 8 * 24)


def test_an_outlier_costs_what_one_costs():
    points, _ = on_block(SIDES[0], 24, 8)
    points[3] += 0.03
    _, costs, _ = evaluate(tables(SIDES), points)
    assert costs[0, 0] == costs[:5, 0].min() < 8 + 3


@pytest.mark.parametrize("n", [1, 2, 3, 24])
def test_one_point_many_times_is_on_any_part(n):
    _, costs, Ts = evaluate(tables(SIDES), np.tile([0.1, 0.2, 0.3], (n, 1)))
    assert np.all(costs[:, 0] < n)
    assert np.isfinite(Ts).all()


def test_a_part_of_one_face_is_found():
    side = np.array([0.04, 0.03, 0.0])
    rng = np.random.default_rng(3)
    T = SE3.exp(np.r_[rng.uniform(-0.3, 0.3, 3), rng.normal(size=3)])
    points = SE3.apply(T, rng.uniform(-0.5, 0.5, (20, 3)) * side)
    assert evaluate(tables(side), points)[1][0, 0] < 3


def test_centres_of_balls_are_off_the_surface_by_their_radius():
    points, T = on_block(SIDES[0], 24, 4)
    inner = SE3.apply(SE3.inverse(T), points)
    face = np.argmax(np.abs(inner) / SIDES[0], axis=1)
    normals = np.zeros((24, 3))
    normals[np.arange(24), face] = np.sign(inner[np.arange(24), face])
    points = points + 0.002 * normals @ T[:3, :3].T
    assert (
        evaluate(tables(SIDES), points, radii=np.full(24, 0.002))[1][0, 0]
        < 3
        < evaluate(tables(SIDES), points)[1][0, 0]
    )


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("grid", np.zeros((6, 7), dtype=np.float32), "grid"),
        ("rows", np.array([6], dtype=np.int32), "rows"),
        ("kinds", np.zeros(5, dtype=np.int32), "kinds"),
        ("points", np.zeros((0, 3)), "points"),
        ("field_start", np.arange(6), "field_start"),
        ("boxes", np.zeros((5, 6)), "boxes"),
    ],
)
def test_arrays_that_cannot_be_meant_are_refused(name, value, message):
    table = tables(SIDES)
    given = table | {name: value} if name in table else table
    with pytest.raises(ValueError, match=message):
        evaluate(given, value if name == "points" else np.eye(3))


@pytest.mark.parametrize("thickness", [0.05, 1.0, 5.0, 9.0])
def test_a_sheet_is_where_its_field_vanishes(tmp_path, thickness):
    corners = np.array([(x, y, z) for z in (0, thickness) for x, y in ((0, 0), (100, 0), (100, 60), (0, 60))])
    sides = [f for i in range(4) for f in ((i, (i + 1) % 4, 4 + (i + 1) % 4), (i, 4 + (i + 1) % 4, 4 + i))]
    write_off(tmp_path / "sheet.off", corners, [(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), *sides])
    part = read_part(tmp_path / "sheet.off", unit="mm")
    table = candidates.Candidates([part]).tables[0][1]
    p = np.random.default_rng(1).uniform((0, 0, 0), (0.1, 0.06, 0), (20, 3))
    p[::2, 2] = 1e-3 * thickness
    numbers = np.asarray(table["numbers"])
    given = {
        "field": table["field"], "field_start": table["field_start"], "grid": table["grid"],
        "spacings": np.sqrt(numbers[:, 0] / 64), "centres": numbers[:, 5:8].copy(), "boxes": numbers[:, 8:14].copy(),
        "levels": LEVELS, "rows": np.zeros(1, dtype=np.int32), "kinds": np.zeros(1, dtype=np.int32),
    }  # fmt: skip
    assert evaluate(given, p)[1][0, 0] < 3


@pytest.mark.slow
def test_points_alone_distinguish_parts_in_the_same_box(tmp_path):
    """Angles with the same three sides: they have one kind, and good poses of one are bad for another."""
    rng = np.random.default_rng(2)
    corners = np.array([(0, 0), (1, 0), (1, "t"), ("s", "t"), ("s", 1), (0, 1)], dtype=object)
    for k in range(70):
        s, t = rng.uniform(0.15, 0.85, 2)
        outline = np.array([[{"s": s, "t": t}.get(v, v) for v in xy] for xy in corners], dtype=float) * 30
        vertices = np.concatenate([np.c_[outline, np.zeros(6)], np.c_[outline, np.full(6, 30.0)]])
        caps = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
        sides = [f for i in range(6) for f in ((i, (i + 1) % 6, 6 + (i + 1) % 6), (i, 6 + (i + 1) % 6, 6 + i))]
        faces = [*((a, c, b) for a, b, c in caps), *((6 + a, 6 + b, 6 + c) for a, b, c in caps), *sides]
        write_off(tmp_path / f"angle_{k}.off", vertices, faces)
    build_catalogue(tmp_path, tmp_path / "catalogue", unit="mm", workers=0)
    catalogue = open_catalogue(tmp_path / "catalogue")
    every, ranks = candidates.Candidates(catalogue), []
    for row in range(0, 70, 14):
        part, own = catalogue[row], np.random.default_rng(row)
        a, b, c = part.vertices[part.triangles].transpose(1, 0, 2)
        areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        at = own.choice(len(areas), size=30, p=areas / areas.sum())
        u, v = np.sort(own.uniform(size=(2, 30, 1)), axis=0)
        T = SE3.exp(np.r_[own.uniform(-0.3, 0.3, 3), own.normal(size=3)])
        p = SE3.apply(T, u * a[at] + (v - u) * b[at] + (1 - v) * c[at]) + SD * own.normal(size=(30, 3))
        problem = Problem(sensed(p), FreeRays.none(), sized(None, float(every.radii.max())))
        rows = candidate_pruning.screen(problem, every).rows
        ranks.append(int(np.flatnonzero(rows == row)[0]))
    assert np.median(ranks) <= 2
    assert max(ranks) < 20


def sensed(p):
    return surface_points(p, SD)


@pytest.mark.parametrize("sides", [(26, 24, 25), (25, 35, 50), (30, 36, 44)])
def test_more_steps_find_what_coarse_scores_miss(sides):
    """A dozen blurred points are as likely in many attitudes of a block that is nearly a cube."""
    block, found = 1e-3 * np.array(sides), {}
    for stepped in (24, 800):
        results = [evaluate(tables([block]), on_block(block, 12, seed)[0], stepped=stepped) for seed in range(20)]
        found[stepped] = sum(costs[0, 0] < 2 for _, costs, _ in results)
    assert found[24] < found[800] == 20
