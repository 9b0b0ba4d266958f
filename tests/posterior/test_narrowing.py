"""Pruning of many parts: the sensed part always stays, and the pruned probability counts."""

from dataclasses import replace

import numpy as np
import pytest

from random_parts import write_off
from tanteo import _core
from tanteo.catalogue import build_catalogue, open_catalogue
from tanteo.factors import FreeRays, surface_points
from tanteo.geometry import SE3
from tanteo.posterior import (
    DEFAULTS,
    Priors,
    Problem,
    WholeObject,
    candidate_pruning,
    candidates,
    identify_points,
    prepare,
    sized,
)
from tanteo.posterior.proposals import plane_votes, sensed_planes

SD, TILT = 1e-4, 0.02
FAMILIES, MEMBERS = 8, 10


def angle_part(a, b, width, depth, t, s):
    """Return an angle: an L of two legs of different thickness, and its depth [mm]."""
    outline = np.array([(0, 0), (a, 0), (a, t), (s, t), (s, b), (0, b)], dtype=float)
    n = len(outline)
    vertices = np.concatenate([np.c_[outline, np.zeros(n)], np.c_[outline + np.array([width, 0]), np.full(n, depth)]])
    cap = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    sides = [t for k in range(n) for t in ((k, (k + 1) % n, n + (k + 1) % n), (k, n + (k + 1) % n, n + k))]
    return vertices, [*((i, k, j) for i, j, k in cap), *((n + i, n + j, n + k) for i, j, k in cap), *sides]


@pytest.fixture(scope="module")
def catalogue(tmp_path_factory):
    folder = tmp_path_factory.mktemp("angles")
    rng = np.random.default_rng(7)
    for family in range(FAMILIES):
        first = np.array([80, 60, 10, 40, 14, 18]) * rng.uniform(0.8, 1.25, 6)
        for member in range(MEMBERS):
            own = first.copy()
            own[member % 6] += 2.0 * (member // 6 + 1) * (member > 0)
            write_off(folder / f"angle_{family}{member}.off", *angle_part(*own))
    out = tmp_path_factory.mktemp("catalogue")
    build_catalogue(folder, out, unit="mm", workers=0)
    return open_catalogue(out)


def sensed(part, kind, rng, along=None):
    """Labelled points of all faces, points with normals, or points alone, at a random pose; on faces along one axis."""
    corners = part.vertices[part.triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(across, axis=1)
    if along is not None:
        across = across * (np.abs(across[:, [along]]) < 1e-9 * areas[:, None])
        areas = np.where(np.any(across != 0, axis=1), areas, 0.0)
    if kind == "labelled":
        faces = rng.choice(len(part.faces), size=6, replace=False)
        rows = np.concatenate(
            [
                rng.choice(
                    len(areas), size=4, p=areas * (part.triangle_face == f) / areas[part.triangle_face == f].sum()
                )
                for f in faces
            ]
        )
        labels = tuple(f"face {f}" for f in faces for _ in range(4))
    else:
        rows, labels = rng.choice(len(areas), size=10 if kind == "normals" else 30, p=areas / areas.sum()), ()
    u, v = np.sort(rng.uniform(size=(2, len(rows), 1)), axis=0)
    a, b, c = corners[rows].transpose(1, 0, 2)
    T = SE3.exp(np.r_[rng.uniform(-0.3, 0.3, 3), rng.normal(size=3)])
    p = SE3.apply(T, u * a + (v - u) * b + (1 - v) * c)
    n = (across[rows] / areas[rows, None]) @ T[:3, :3].T
    tilted = n + TILT * rng.normal(size=n.shape)
    tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
    oriented = kind == "normals"
    return surface_points(
        p + SD * rng.normal(size=p.shape), SD, normals=tilted if oriented else None,
        normal_sds=TILT if oriented else np.pi, labels=labels, kind="plane" if labels else "point",
        outward=n if labels else None,
    )  # fmt: skip


def question(points, every):
    return Problem(points, FreeRays.none(), sized(None, float(every.radii.max())))


@pytest.mark.slow
def test_few_parts_are_all_searched_from_their_coarse_fields(catalogue):
    settings = DEFAULTS.changed("search.negligible", 0.0)  # of many parts, none but the best would have poses
    parts = [catalogue[row] for row in range(0, 40, 8)]
    every = candidates.Candidates(parts)
    points = sensed(parts[2], "points", np.random.default_rng(1))
    chosen = candidate_pruning.screen(replace(question(points, every), settings=settings), every)
    assert chosen.rows.tolist() == sorted(chosen.known)
    on = [prepare(parts[2]).surface.closest(SE3.apply(SE3.inverse(T), points.points)) for T in chosen.known[2]]
    assert min(np.median(one.distances) for one in on) < 0.01 * parts[2].diagonal


@pytest.mark.parametrize("kind", ["labelled", "normals", "points"])
def test_the_part_that_was_sensed_is_searched(catalogue, kind):
    every = candidates.Candidates(catalogue)
    for k in range(12):
        row = (7 * k) % len(catalogue)
        chosen = candidate_pruning.screen(
            question(sensed(catalogue[row], kind, np.random.default_rng(k)), every), every
        )
        assert row in chosen.rows, k
        if chosen.exhaustive and kind == "labelled":
            assert len(chosen.rows) < len(catalogue) / 2
            assert chosen.unsearched < 0


def test_a_part_sensed_on_faces_along_one_line_is_searched(catalogue):
    every = candidates.Candidates(catalogue)
    for k in range(8):
        points = sensed(catalogue[9 * k], "normals", np.random.default_rng(k), along=0)
        problem = question(points, every)
        assert set(sensed_planes.sensed_planes(problem, points).triples[2::3]) == {-1}
        chosen = candidate_pruning.screen(problem, every)
        assert chosen.exhaustive
        assert 9 * k in chosen.rows, k


def test_a_catalogue_and_its_list_of_parts_answer_equally(catalogue):
    points = sensed(catalogue[33], "points", np.random.default_rng(1))
    stored = identify_points(points, FreeRays.none(), catalogue)
    listed = identify_points(points, FreeRays.none(), list(catalogue))
    assert stored.hypotheses[0].part == listed.hypotheses[0].part == catalogue[33].name
    assert stored.hypotheses[0].probability == pytest.approx(listed.hypotheses[0].probability, abs=0.02)


def test_a_labelled_outlier_does_not_leave_its_part_out(catalogue):
    every = candidates.Candidates(catalogue)
    points = sensed(catalogue[20], "labelled", np.random.default_rng(5))
    moved = [replace(f, at=f.at + 0.02 * (k < 4)) for k, f in enumerate(points.factors)]
    off = replace(points, factors=tuple(moved))
    assert 20 in candidate_pruning.screen(question(off, every), every).rows


def test_few_parts_are_all_searched(catalogue):
    few = candidates.Candidates(list(catalogue[:10]))
    chosen = candidate_pruning.screen(question(sensed(catalogue[3], "labelled", np.random.default_rng(2)), few), few)
    assert sorted(chosen.rows) == list(range(10))
    assert chosen.unsearched == -np.inf


def test_votes_of_the_own_faces_of_a_part_cost_nothing(catalogue):
    every = candidates.Candidates(catalogue)
    for k in range(8):
        points = sensed(catalogue[5 * k], "labelled", np.random.default_rng(k))
        planes = sensed_planes.sensed_planes(question(points, every), points)
        ((_, table),) = every.tables
        assert plane_votes.votes(planes, table)[5 * k] == 0


def test_what_is_left_out_is_as_probable_as_it_may_be():
    assert candidate_pruning.Unsearched().log_evidence(10.0, 5.0) == -np.inf
    assert candidate_pruning.Unsearched(100, -3.0).log_evidence(10.0, 5.0) == 7.0
    assert candidate_pruning.Unsearched(100).log_evidence(10.0, 5.0) == pytest.approx(5.0 + np.log(100))


def test_global_properties_are_evaluated_first(catalogue):
    every = candidates.Candidates(catalogue)
    points = sensed(catalogue[41], "points", np.random.default_rng(4))
    odds = np.where(np.arange(len(catalogue)) % 4 == 1, 3.0, -3.0)
    chosen = candidate_pruning.screen(question(points, every), every, odds)
    assert 41 in chosen.rows
    assert chosen.pruned_by_properties > 0
    assert (odds[list(chosen.known)] > 0).all()  # the others are not evaluated
    assert chosen.discount < -2
    everything = candidate_pruning.screen(question(points, every), every, odds, every=True)
    assert (everything.pruned_by_properties, 41 in everything.rows) == (0, True)


def test_a_part_is_found_though_the_whole_object_misleads(catalogue):
    """Sides of another part prune the true one; as nothing else explains the readings, it is searched after all."""
    part = catalogue[41]
    sides = tuple(np.ptp(part.box, axis=0) + 0.02)
    priors = Priors(whole=WholeObject(sides=sides, side_sd=1e-4))
    points = sensed(part, "points", np.random.default_rng(4))
    answer = identify_points(points, FreeRays.none(), catalogue, priors=priors)
    assert part.name in {h.part for h in answer.hypotheses}


def test_sizes_of_a_catalogue_are_those_of_its_parts(catalogue):
    assert candidates.sizes_of(catalogue) == pytest.approx(tuple(part.diagonal for part in catalogue))


POSE = SE3.exp(np.array([0.1, -0.2, 0.3, 0.5, 1.0, -0.7]))


def planes_at_a_pose(planes):
    """Return all planes of a part as a sensor measures them, and three of them that fix the pose."""
    n = len(planes)
    rows = np.column_stack([
        planes.normals @ POSE[:3, :3].T, SE3.apply(POSE, planes.centroids), np.full(n, SD), np.full(n, 1e-3),
        np.zeros(n), np.full(n, 10.0), np.ones(n), np.zeros(n),
    ])  # fmt: skip
    triples = [(i, j, k) for i in range(n) for j in range(i) for k in range(j)]
    return rows, max(triples, key=lambda t: abs(np.linalg.det(rows[list(t), :3])))


def test_planes_at_their_own_pose_cost_next_to_nothing(catalogue):
    ((_, table),) = candidates.Candidates(catalogue).tables
    rows, triple = planes_at_a_pose(catalogue[0].planes)
    costs, Ts = on_planes(table, rows, triple)
    assert costs[0, 0] < 0.1
    np.testing.assert_allclose(Ts[0, 0], POSE, atol=1e-5)
    assert np.all(costs[MEMBERS:, 0] > 5)


def test_a_plane_of_no_face_costs_its_nats_and_moves_nothing(catalogue):
    ((_, table),) = candidates.Candidates(catalogue).tables
    rows, triple = planes_at_a_pose(catalogue[0].planes)
    off = rows.copy()
    off[triple[0], 3:6] += 7e-3 * off[triple[0], :3]
    costs, Ts = on_planes(table, off, triple)
    assert costs[0, 0] == pytest.approx(10.0, abs=0.1)
    np.testing.assert_allclose(Ts[0, 0], POSE, atol=1e-5)


@pytest.mark.parametrize("how", ["in another order", "with sides that are not known"])
def test_planes_lead_to_the_same_pose(catalogue, how):
    ((_, table),) = candidates.Candidates(catalogue).tables
    rows, triple = planes_at_a_pose(catalogue[0].planes)
    if how == "in another order":
        order = np.random.default_rng(1).permutation(len(rows))
        rows, triple = rows[order], [int(np.flatnonzero(order == k)[0]) for k in triple]
    else:
        rows[:, 10] = 0
        rows[::2, :3] *= -1
    costs, Ts = on_planes(table, np.ascontiguousarray(rows), triple)
    assert costs[0, 0] < 0.1
    assert np.abs(Ts[0] - POSE).max(axis=(1, 2)).min() < 1e-5


def test_the_nats_of_a_pose_are_those_of_its_planes(catalogue):
    ((_, table),) = candidates.Candidates(catalogue).tables
    rows, triple = planes_at_a_pose(catalogue[0].planes)
    rng = np.random.default_rng(4)
    rows[:, 3:6] += SD * rng.normal(size=(len(rows), 3))
    rows[:, :3] += 1e-3 * rng.normal(size=(len(rows), 3))
    rows[:, :3] /= np.linalg.norm(rows[:, :3], axis=1, keepdims=True)
    costs, Ts = on_planes(table, rows, triple)
    start = table["planes_start"]
    for part in range(0, len(costs), 7):
        faces = np.float64(table["planes"][start[part] : start[part + 1]])
        for T, cost in zip(Ts[part], costs[part], strict=True):
            if cost < 60:
                assert cost == pytest.approx(nats(rows, faces, T), rel=1e-6)


def nats(rows, faces, T):
    """Return the cost of planes at a pose [nat]: each on its least costly face, or on none."""
    into = SE3.inverse(T)
    p, n = SE3.apply(into, rows[:, 3:6]), rows[:, :3] @ into[:3, :3].T
    off = p[:, None] - faces[:, 3:6]
    h, c, tilt2 = np.sum(off * faces[:, :3], axis=2), n @ faces[:, :3].T, 1e-6 + 0.004**2
    reach = faces[:, 6] + 4 * SD
    there = (np.sum(off**2, axis=2) - h**2 <= reach**2) & (c >= np.cos(4 * np.sqrt(tilt2)))
    return np.minimum(np.where(there, 0.5 * h**2 / SD**2 + (1 - c) / tilt2, np.inf).min(axis=1), 10.0).sum()


TWO_FACES = np.array([[0, 0, 1, 0.02, 0.03, 0.01, 0.1], [1, 0, 0, 0.05, 0.03, 0.0, 0.1]])
"""Normal, centroid and reach of a top and a side [m]."""


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_point_of_a_bore_or_boss_fixes_what_two_planes_leave(sign):
    bore = np.array([[0.01, 0.03, 0.0, 0, 0, 1, 0.006, 0.01, sign]])
    tables = {"planes": TWO_FACES, "planes_start": [0, 2], "rounds": bore, "rounds_start": [0, 1]}
    T, way = SE3.exp(np.array([0.1, -0.2, 0.3, 0.5, 1.0, -0.7])), np.array([0.6, 0.8, 0])
    normals = np.array([[0, 0, 1], [1, 0, 0], way]) @ T[:3, :3].T
    at = SE3.apply(T, np.array([[0.03, 0.02, 0.01], [0.05, 0.01, 0.002], [0.01, 0.03, 0.003] + sign * 0.006 * way]))
    felt = np.column_stack([normals, at, np.tile([SD, 1e-3, 0, 8, 1, 1], (3, 1))])
    costs, Ts = on_planes(tables | {"numbers": np.zeros((1, 17))}, felt, (0, 1, 2))
    assert costs[0, 0] < 0.1
    np.testing.assert_allclose(Ts[0, 0], T, atol=1e-5)


def test_points_of_two_bores_determine_the_rotation():
    bores = np.array([[0.01, 0.03, 0.0, 0, 0, 1, 0.006, 0.01, -1], [0.05, 0.01, 0.0, 0, 0, 1, 0.008, 0.01, -1]])
    tables = {"planes": TWO_FACES[:1], "planes_start": [0, 1], "rounds": bores, "rounds_start": [0, 2]}
    ways = np.array([[0.6, 0.8, 0], [0, -1, 0]])
    normals = np.concatenate([[[0, 0, 1]], ways]) @ POSE[:3, :3].T
    walls = bores[:, :3] - bores[:, [6]] * ways + np.array([0, 0, 0.004])
    at = SE3.apply(POSE, np.concatenate([[[0.03, 0.02, 0.01]], walls]))
    felt = np.column_stack([normals, at, np.tile([SD, 1e-3, 0, 8, 1, 1], (3, 1))])
    given = tables | {"numbers": np.zeros((1, 17))}
    costs, Ts = on_planes(given, felt, (), walls=np.array([0, 1, 2], dtype=np.int32))
    assert costs[0, 0] < 0.1
    np.testing.assert_allclose(Ts[0, 0], POSE, atol=1e-5)
    assert on_planes(given, felt, ())[0][0, 0] == 60


def on_planes(table, felt, triple, **changed):
    given = {
        "planes": np.float32(table["planes"]).ravel(), "starts": np.int64(table["planes_start"]),
        "rounds": np.float32(table["rounds"]).ravel(), "rounds_start": np.int64(table["rounds_start"]),
        "unseen": np.ascontiguousarray(table["numbers"][:, 16]),
        "rows": np.arange(len(table["numbers"]), dtype=np.int32), "sensed": felt,
        "triples": np.array(triple, dtype=np.int32), "walls": np.zeros(0, dtype=np.int32), "limit": 60.0,
        "gap": 60.0, "keep": 3,
    }  # fmt: skip
    return _core.on_planes(**{**given, **changed})


@pytest.mark.parametrize("what", ["no noise", "a normal of no length", "one plane thrice", "walls that are no numbers"])
def test_degenerate_planes_end_in_nats_that_are_numbers(catalogue, what):
    ((_, table),) = candidates.Candidates(catalogue).tables
    rows, triple = planes_at_a_pose(catalogue[0].planes)
    given = {name: table[name] for name in ("planes", "planes_start", "rounds", "rounds_start", "numbers")}
    if what == "no noise":
        rows[:, 6:8] = 0
    elif what == "a normal of no length":
        rows[triple[0], :3] = 0
    elif what == "one plane thrice":
        rows[:] = rows[0]
    else:
        rows[:, 11] = 1
        count = len(table["numbers"])
        given |= {"rounds": np.full((count, 9), np.nan), "rounds_start": np.arange(count + 1)}
    costs, Ts = on_planes(given, rows, triple, walls=np.array(triple, dtype=np.int32))
    assert np.isfinite(costs).all()
    assert np.isfinite(Ts).all()


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("planes", np.zeros(5, dtype=np.float32), "7 numbers a row"),
        ("rounds", np.zeros(5, dtype=np.float32), "9 numbers a row"),
        ("starts", np.array([0, 10**6], dtype=np.int64), "expected"),
        ("rows", np.array([10**6], dtype=np.int32), "rows"),
        ("triples", np.array([0, 1, 99], dtype=np.int32), "triples"),
        ("triples", np.array([0, -1, 1], dtype=np.int32), "missing third plane"),
        ("walls", np.array([0, 1, 99], dtype=np.int32), "walls"),
        ("sensed", np.full((3, 12), np.nan), "finite"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(catalogue, name, value, message):
    ((_, table),) = candidates.Candidates(catalogue).tables
    with pytest.raises(ValueError, match=message):
        on_planes(table, np.ones((3, 12)), (0, 1, 2), **{name: value})
