"""Centres of holes narrow many parts: the own part stays in, others drop out, and what is wrong costs an outlier."""

from dataclasses import replace

import numpy as np
import pytest

from tanteo import _core
from tanteo.catalogue import tables_of
from tanteo.factors import ContactPoints, FreeRays, SurfacePoint
from tanteo.factors.factor import SensedDirection, SensedSize, factor_class
from tanteo.geometry import SE3
from tanteo.posterior import DEFAULTS, Priors, Problem, candidate_pruning
from tanteo.posterior.proposals import centre_votes, plane_votes, sensed_planes
from tanteo.posterior.sampling import peaks

SD, RADIUS = 3e-5, 0.15
KINDS = {3: "centre", 5: "sphere_centre", 6: "apex"}
SIDES = ((0, 1), (0, -1), (1, 1), (1, -1), (2, 1), (2, -1))


def box_faces(size):
    """Return normal, centroid and reach of the six faces of a box from the origin."""
    rows = []
    for axis, sign in SIDES:
        n, c = np.eye(3)[axis] * sign, size / 2
        c = np.where(np.arange(3) == axis, size * (sign > 0), c)
        rows.append([*n, *c, np.linalg.norm(np.delete(size, axis)) / 2])
    return np.array(rows)


def wall(start, end, radius, *, share=1.0, side=1, number=0, kind=3):
    """Return a row of a hole with its wall: half of its length beyond its ends."""
    a, b = np.array(start, dtype=float), np.array(end, dtype=float)
    beyond = 0.5 * (b - a) if kind == 3 else 0.0
    return [*(a - beyond), *(b + beyond), radius, radius, share, side, number, kind]


def block(rng, holes=None, *, crossing=True):
    """Return a block with holes along z through it, and one along x: size, and the rows of its axes."""
    size = rng.uniform([0.06, 0.05, 0.015], [0.12, 0.09, 0.03])
    count = holes or int(rng.integers(3, 7))
    rows = []
    for k in range(count):
        x, y = rng.uniform(0.1, 0.9, 2) * size[:2]
        rows.append(wall([x, y, 0], [x, y, size[2]], rng.uniform(2e-3, 6e-3), number=k))
    if crossing:
        y, z = rng.uniform(0.3, 0.7, 2) * size[1:]
        rows.append(wall([0, y, z], [0.3 * size[0], y, z], 3e-3, number=count))
    rows = np.array(rows)
    rows[:, 8] = 1 / len(rows)
    return size, rows


class Every:
    """Candidates with tables and sizes only."""

    def __init__(self, columns, sizes):
        self.tables = [(0, tables_of(columns))]
        self.diagonals = np.linalg.norm(sizes, axis=1)

    def __len__(self):
        return len(self.diagonals)


def catalogue(parts):
    """Parts of size and rows as the tables of a catalogue."""
    columns = []
    for size, rows in parts:
        numbers = np.zeros(17)
        numbers[3:5] = np.linalg.norm(size), np.linalg.norm(size)
        numbers[8:14] = np.r_[np.zeros(3), size]
        columns.append({
            "numbers": numbers, "grid": np.zeros(7, dtype=np.float32), "planes": np.float32(box_faces(size)),
            "axes": np.float32([[*row, row[11] == 3, 0, 0] for row in rows]).reshape(-1, 15),
            "rounds": np.zeros((0, 9), dtype=np.float32),
            "hull": np.zeros((0, 3), dtype=np.float32), "rests": np.zeros((0, 4), dtype=np.float32),
            "field": np.zeros(0, dtype=np.int8),
            **dict.fromkeys(("same", "opposite", "angles"), np.zeros(0, dtype=np.float32)),
        })  # fmt: skip
    return Every(columns, [size for size, _ in parts])


def sensed(part, rng, which, *, sized=True, oriented=False, face=4, heights=None):
    """Centres of some axes of a part at a random pose, and three points of a face: the pose, and the points."""
    size, rows = part
    own = rows[list(which)]
    a, b = own[:, :3], own[:, 3:6]
    t = rng.uniform(0.25, 0.75, len(own)) if heights is None else np.array(heights)  # the wall is the middle half
    line = own[:, 11] == 3
    centres = np.where(line[:, None], a + t[:, None] * (b - a), a)
    top, out = np.zeros((0, 3)), np.zeros(3)
    if face is not None:
        axis, sign = SIDES[face]
        out = sign * np.eye(3)[axis]
        top = np.insert([[0.1, 0.1], [0.9, 0.2], [0.4, 0.9]], axis, sign > 0, axis=1) * size
    T = SE3.exp(np.r_[rng.uniform(-0.3, 0.3, 3), rng.normal(size=3)])
    p = SE3.apply(T, np.concatenate([centres, top]))
    c, m = len(own), len(p)
    normals = np.zeros((m, 3))
    if oriented:
        normals[:c] = ((b - a) / np.linalg.norm(b - a, axis=1)[:, None]) @ T[:3, :3].T * rng.choice([-1, 1], (c, 1))
    radii = own[:, 6] + SD * rng.normal(size=c)
    p = p + SD * rng.normal(size=p.shape)
    factors = []
    for k in range(m):
        axis = SensedDirection(normals[k], 0.01) if oriented and k < c else None
        if k < c:
            size, side = (SensedSize(radii[k], 1e-4), int(own[k, 9])) if sized else (None, 0)
            cls = factor_class(KINDS[int(own[k, 11])])
            factors.append(cls(at=p[k], cov=SD**2 * np.eye(3), normal=axis, sensed_size=size, material_side=side))
        else:
            factors.append(SurfacePoint(at=p[k], cov=SD**2 * np.eye(3), outward=T[:3, :3] @ out))
    kinds = (*(KINDS[int(kind)] for kind in own[:, 11]), *("plane",) * (m - c))
    labels = ("",) * c + ("top",) * (m - c)
    ids = tuple(map(str, range(m)))
    return T, ContactPoints(ids, tuple(factors), np.zeros((m, 3, 0)), labels=labels, kinds=kinds)


def felt(points):
    problem = Problem(points, FreeRays.none(), Priors(radius=RADIUS))
    return centre_votes.sensed_centres(problem, points, sensed_planes.sensed_planes(problem, points))


def compared(points, every):
    """Nats of all parts, by centres and planes, and poses."""
    centres, rows, details = felt(points), np.arange(len(every)), {}
    costs = centre_votes.lacking(centres, every, rows)
    centre_votes.on_axes(centres, every, rows, costs, details)
    return costs, details


@pytest.fixture(scope="module")
def blocks():
    rng = np.random.default_rng(1)
    return [block(rng) for _ in range(80)]


@pytest.fixture(scope="module")
def every(blocks):
    return catalogue(blocks)


@pytest.mark.quick_sets(3)
@pytest.mark.parametrize("sized", [True, False])
@pytest.mark.parametrize("face", [4, *(pytest.param(k, marks=pytest.mark.slow) for k in (0, 3)), None])
@pytest.mark.parametrize("oriented", [True, False])
def test_the_own_part_stays_in_and_most_drop_out(blocks, every, sized, face, oriented):
    left = []
    for k in range(15):
        rng = np.random.default_rng((k, sized, face or 9, oriented))
        row = int(rng.integers(len(blocks)))
        which = rng.permutation(len(blocks[row][1]))[: (5 if face is None else 3)]
        _, points = sensed(blocks[row], rng, which, sized=sized, oriented=oriented, face=face)
        costs, details = compared(points, every)
        assert costs[row] < costs.min() + plane_votes.cost_margin(DEFAULTS), k
        assert row in details, k
        left.append(int(np.sum(costs < costs.min() + plane_votes.cost_margin(DEFAULTS))))
    assert np.median(left) <= (2 if sized else 8)


def test_nats_of_the_own_part_are_those_of_noise(blocks, every):
    """Of four centres and a plane, half of chi2 with no more degrees of freedom than eleven, the noise taken larger."""
    own = []
    for k in range(40):
        rng = np.random.default_rng(k)
        row = k % len(blocks)
        _, points = sensed(blocks[row], rng, rng.permutation(len(blocks[row][1]))[:4])
        own.append(compared(points, every)[0][row])
    assert np.mean(own) < 5.5
    assert np.max(own) < 13


def test_poses_bring_centres_to_their_axes(blocks, every):
    """Some pose of the own part is the true one: the block has no other with the same holes."""
    for k in range(15):
        rng = np.random.default_rng((5, k))
        row = int(rng.integers(len(blocks)))
        T, points = sensed(blocks[row], rng, rng.permutation(len(blocks[row][1]))[:4])
        _, details = compared(points, every)
        corners = np.array(np.meshgrid(*zip(np.zeros(3), blocks[row][0], strict=True))).reshape(3, -1).T
        off = np.linalg.norm(SE3.apply(details[row][:, None], corners) - SE3.apply(T, corners), axis=-1)
        assert off.max(axis=1).min() < 1e-3, k


def without(points, row, shift):
    moved = [replace(f, at=f.at + shift * (k == row)) for k, f in enumerate(points.factors)]
    return replace(points, factors=tuple(moved))


@pytest.mark.quick_sets(1)
@pytest.mark.parametrize("which", range(4))
def test_a_centre_of_no_hole_costs_what_an_outlier_does(blocks, every, which):
    for k in range(6):
        rng = np.random.default_rng((which, k))
        row = next(r for r in rng.permutation(len(blocks)) if len(blocks[r][1]) > 4)
        _, points = sensed(blocks[row], rng, range(4), sized=False)
        costs, details = compared(without(points, which, 0.2 * rng.normal(size=3)), every)
        most = felt(points).rows[which, 10]
        assert most - 0.1 < costs[row] < most + 10
        assert costs[row] < costs.min() + plane_votes.cost_margin(DEFAULTS)
        assert row in details


def test_a_radius_that_no_hole_has_costs_an_outlier(blocks, every):
    rng = np.random.default_rng(2)
    _, points = sensed(blocks[3], rng, range(4))
    second = points.factors[1]
    wider = replace(second, sensed_size=SensedSize(second.sensed_size.value + 0.02, second.sensed_size.sd))
    points = replace(points, factors=(points.factors[0], wider, *points.factors[2:]))
    centres = felt(points)
    costs = centre_votes.lacking(centres, every, np.arange(len(blocks)))
    assert costs[3] == pytest.approx(centres.rows[1, 10], abs=3)
    assert np.all(costs > 12)


def test_a_boss_is_no_hole(blocks):
    size, rows = blocks[0]
    bosses = rows.copy()
    bosses[2, 9] = -1.0
    every = catalogue([(size, rows), (size, bosses)])
    rng = np.random.default_rng(4)
    for row, part in enumerate([(size, rows), (size, bosses)]):
        _, points = sensed(part, rng, range(4))
        costs, _ = compared(points, every)
        assert costs[row] < 8 < costs[1 - row]
        unsided = [replace(f, material_side=0) if not f.on_surface else f for f in points.factors]
        points = replace(points, factors=tuple(unsided))
        assert np.max(compared(points, every)[0]) < 8


def test_only_the_different_hole_distinguishes_twins(blocks):
    size, rows = blocks[0]
    twin = rows.copy()
    twin[0, [0, 3]] += 0.002
    every = catalogue([(size, rows), (size, twin)])
    _, points = sensed((size, rows), np.random.default_rng(6), [1, 2, 3])
    costs, _ = compared(points, every)
    assert costs == pytest.approx(costs[0], abs=1e-3)
    _, points = sensed((size, rows), np.random.default_rng(6), [0, 1, 2, 3])
    costs, _ = compared(points, every)
    assert costs[1] > costs[0] + plane_votes.cost_margin(DEFAULTS)


def test_one_hole_sensed_twice_lacks_nothing(blocks, every):
    _, points = sensed(blocks[5], np.random.default_rng(7), [0, 0, 1, 2], heights=[0.3, 0.7, 0.5, 0.5])
    assert centre_votes.lacking(felt(points), every, np.array([5])) < 4
    costs, _ = compared(points, every)
    assert costs[5] < costs.min() + plane_votes.cost_margin(DEFAULTS)


def test_the_height_of_a_centre_costs_nothing(blocks, every):
    costs = []
    for height in (0.5, 1.4, 20.0):
        _, points = sensed(blocks[0], np.random.default_rng(8), range(4), heights=[height, 0.5, 0.5, 0.5])
        costs.append(compared(points, every)[0][0])
    assert costs[1:] == pytest.approx(costs[:1] * 2, abs=1.0)


def test_holes_that_are_not_kept_cost_their_part_little(blocks):
    """Of more holes than a catalogue keeps, one that is not among them is no outlier."""
    size, rows = blocks[0]
    kept = rows[1:].copy()
    every = catalogue([(size, kept), (size, np.concatenate([kept[:, :8], kept[:, 8:] * [1.3, 1, 1, 1]], axis=1))])
    _, points = sensed((size, rows), np.random.default_rng(9), range(4), sized=False)
    costs, _ = compared(points, every)
    assert costs[0] < 5
    assert costs[1] > 10


def test_spheres_and_apexes_are_points(blocks):
    size, rows = blocks[0]
    more = [
        wall([0.01, 0.02, 0.03], [0.01, 0.02, 1.03], 5e-3, number=20, kind=5),
        wall([0.03, 0.01, 0.01], [0.03, 0.01, 1.01], 0.7, number=21, kind=6),
    ]
    every = catalogue([(size, np.concatenate([rows, more])), (size, rows)])
    part = size, np.concatenate([rows, more])
    n = len(rows)
    _, points = sensed(part, np.random.default_rng(10), [0, 1, n, n + 1], face=None)
    costs, details = compared(points, every)
    assert costs[0] < 8
    assert costs[1] > 20
    assert 0 in details


def test_coaxial_holes_and_a_face_fix_no_pose(blocks):
    """Centres have no height, so the distance of the holes does not count; their rotation stays free."""

    def fork(gap):
        size = np.array([0.03, 0.03, gap + 0.02])
        walls = [wall([0.015, 0.015, z], [0.015, 0.015, z + 0.01], 4e-3, number=k, share=0.5)
                 for k, z in enumerate((0, gap + 0.01))]  # fmt: skip
        return size, np.array(walls)

    forks = [fork(gap) for gap in (0.02, 0.03, 0.06, 0.12)]
    every = catalogue(forks)
    for row in range(4):
        for k in range(5):
            _, points = sensed(forks[row], np.random.default_rng((row, k)), [0, 1])
            centres = felt(points)
            assert len(centres.seeds) == 1
            assert not centres.certain
            costs, _ = compared(points, every)
            assert np.all(costs < 8)


def test_seeds_leave_every_reading_out_once(blocks):
    _, points = sensed(blocks[0], np.random.default_rng(11), range(4))
    centres = felt(points)
    for item in range(5):
        assert np.any(np.all(centres.seeds != item, axis=1)), item
    for pair in ((0, 1), (2, 4), (1, 3)):
        both = np.concatenate([centres.seeds, centres.more])
        assert np.any(~np.any(np.isin(both, pair), axis=1)), pair


def test_holes_of_nearly_one_height_beside_a_face_are_found(blocks, every):
    """How the part is turned about the normal of a side follows from the heights of two holes along their axes."""
    for k in range(20):
        rng = np.random.default_rng((18, k))
        row = int(rng.integers(len(blocks)))
        heights = 0.5 + rng.choice([0.0, 0.01, 0.1, 0.2], 2)
        _, points = sensed(blocks[row], rng, [0, 1], face=int(rng.integers(4)), heights=heights)
        costs, details = compared(points, every)
        assert row in details
        assert costs[row] < 9


def test_compiled_nats_are_those_of_plain_numbers(blocks, every):
    for k in range(10):
        rng = np.random.default_rng((12, k))
        row = int(rng.integers(len(blocks)))
        _, points = sensed(blocks[row], rng, range(3), oriented=True)
        centres, details, costs = felt(points), {}, np.zeros(1)
        centre_votes.on_axes(centres, every, np.array([row]), costs, details)
        plain = [plainly(centres, blocks[row], T) for T in details[row]]
        assert min(plain) == pytest.approx(costs[0], abs=1e-3)


def plainly(centres, part, T):
    """Return the cost of centres and planes at a pose, computed directly."""
    size, rows = part
    total, back = 0.0, SE3.inverse(T)
    for c in centres.rows:
        q, m = SE3.apply(back, c[:3]), c[3:6] @ T[:3, :3]
        along = (rows[:, 3:6] - rows[:, :3]) / np.linalg.norm(rows[:, 3:6] - rows[:, :3], axis=1)[:, None]
        off = q - rows[:, :3]
        across = off - np.sum(off * along, axis=1)[:, None] * along
        cost = 0.5 * np.sum(across**2, axis=1) / c[6] ** 2 + 0.5 * ((c[8] - rows[:, 6]) / c[9]) ** 2
        cost += (1 - np.abs(along @ m)) / (c[7] ** 2 + 0.004**2)
        total += min(float(cost.min()), c[10])
    faces = box_faces(size)
    for p in centres.planes:
        q, n = SE3.apply(back, p[3:6]), p[:3] @ T[:3, :3]
        cost = 0.5 * (np.sum((q - faces[:, 3:6]) * faces[:, :3], axis=1) / p[6]) ** 2
        cost += (1 - faces[:, :3] @ n) / (p[7] ** 2 + 0.004**2)
        total += min(float(cost.min()), p[9])
    return total


def narrowed(parts, points):
    few = DEFAULTS.changed("pruning.budget", 2)
    return candidate_pruning.screen(
        Problem(points, FreeRays.none(), Priors(radius=RADIUS), settings=few), catalogue(parts)
    )


def test_what_is_left_is_searched_and_the_rest_counts(blocks):
    _, points = sensed(blocks[7], np.random.default_rng(13), range(4))
    chosen = narrowed(blocks, points)
    assert chosen.exhaustive
    assert chosen.bound
    assert chosen.rows[0] == 7
    assert len(chosen.rows) < 10
    assert -40 < chosen.unsearched < 0
    assert len(chosen.rows) + len(chosen.others) == len(blocks)


def test_two_centres_alone_leave_parts_out_by_radius_only(blocks):
    _, points = sensed(blocks[7], np.random.default_rng(14), [0, 1], face=None)
    chosen = narrowed(blocks, points)
    assert chosen.bound
    assert not chosen.exhaustive
    assert not chosen.known
    assert 7 in [*chosen.rows, *chosen.others]
    assert chosen.unsearched > -13


def given(sensed_ones, every, **changed):
    ((_, table),) = every.tables
    rows = np.arange(3, dtype=np.int32)
    own = {
        "axes": table["axes"].ravel(), "axes_start": table["axes_start"], "planes": table["planes"].ravel(),
        "planes_start": table["planes_start"], "rounds": table["rounds"].ravel(),
        "rounds_start": table["rounds_start"],
        "unseen": np.zeros(len(every)), "rows": rows, "centres": sensed_ones.rows,
        "sensed": sensed_ones.planes, "seeds": sensed_ones.seeds.ravel(), "poses_before": np.zeros((0, 4, 4)),
        "poses_start": np.zeros(4, dtype=np.int32), "limit": 60.0, "gap": 16.0, "keep": 3,
    }  # fmt: skip
    return _core.on_axes(**{**own, **changed})


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("axes", np.zeros(5, dtype=np.float32), "15 numbers"),
        ("axes_start", np.arange(81) * 1000, "increasing"),
        ("planes_start", np.arange(3), "increasing"),
        ("rows", np.array([10**6], dtype=np.int32), "rows"),
        ("centres", np.full((2, 13), np.nan), "finite"),
        ("centres", np.zeros((2, 13)), "positive"),
        ("centres", np.full((2, 13), 99.0), "kinds"),
        ("sensed", np.zeros((2, 5)), "expected an array"),
        ("seeds", np.array([0, 1], dtype=np.int32), "three numbers"),
        ("seeds", np.array([0, 99, 1], dtype=np.int32), "seeds"),
        ("seeds", np.array([4, 0, 1], dtype=np.int32), "centres, then planes"),
        ("poses_start", np.array([0, 5, 5, 5], dtype=np.int32), "poses_start"),
        ("unseen", np.zeros(3), "unseen"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(blocks, every, name, value, message):
    _, points = sensed(blocks[0], np.random.default_rng(15), range(4))
    centres = felt(points)
    assert given(centres, every)[0].shape == (3, 3)
    with pytest.raises(ValueError, match=message):
        given(centres, every, **{name: value})


def test_axes_of_no_length_or_no_number_end_in_costs(blocks):
    """What a damaged table may hold is no crash: the part is out, or in."""
    size, rows = blocks[0]
    broken = rows.copy()
    broken[0, 3:6] = broken[0, :3]
    broken[1, :6] = np.nan
    _, points = sensed((size, rows), np.random.default_rng(16), range(4))
    costs, _ = compared(points, catalogue([(size, broken), (size, rows)]))
    assert costs.shape == (2,)
    assert costs[1] < 8


def test_centres_are_taken_from_all_sides(blocks):
    assert sorted(peaks.spread_out(np.arange(12.0).reshape(4, 3), 9)) == [0, 1, 2, 3]


def test_a_lonely_normal_makes_no_poses(blocks, every):
    """It may lie on a face that is no plane, which a table does not have."""
    _, points = sensed(blocks[4], np.random.default_rng(17), [0, 1], face=None)
    normal = np.array([[0.6, 0.0, 0.8]])
    at = points.points[0] + 0.01 * normal[0]
    one = SurfacePoint(at=at, cov=SD**2 * np.eye(3), normal=SensedDirection(normal[0], 0.01))
    joined = ContactPoints(
        (*points.ids, "one"), (*points.factors, one), np.zeros((len(points) + 1, 3, 0)),
        labels=(*points.labels, ""), kinds=(*points.kinds, "point"),
    )  # fmt: skip
    centres = felt(joined)
    assert len(centres.planes) == 1
    assert not len(centres.seeds)
    assert not centres.certain
