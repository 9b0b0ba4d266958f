"""Coarser copies of meshes: bounded deviation, also of borders, and the same answers."""

import numpy as np
import pytest

import tanteo
from tanteo import _core
from tanteo.catalogue import copies
from tanteo.catalogue.copies import SHARE, Resolution, copy_for_field, copy_for_walls, copy_of
from tanteo.geometry import SE3, SO3
from tanteo.parts import Surface


def grid(rows, height):
    """Return a square sheet of ``2 rows^2`` triangles above the unit square."""
    x, y = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, rows + 1), indexing="ij")
    vertices = np.stack([x, y, height(x, y)], axis=-1).reshape(-1, 3)
    at = np.arange(rows * (rows + 1)).reshape(rows, rows + 1)[:, :-1].ravel()
    right, up = at + rows + 1, at + 1
    return vertices, np.concatenate([np.stack([at, right, right + 1], -1), np.stack([at, right + 1, up], -1)])


def ball(rows, rng=None):
    """Return a closed lumpy shape of ``4 rows^2`` triangles, about 2 large."""
    vertices, triangles = [[0, 0, 1.0]], []
    sides = 2 * rows
    for polar in np.linspace(0, np.pi, rows + 1)[1:-1]:
        turn = np.linspace(0, 2 * np.pi, sides, endpoint=False)
        vertices += np.column_stack(
            [np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.full(sides, np.cos(polar))]
        ).tolist()
    last = len(vertices)
    for k in range(sides):
        after = (k + 1) % sides
        triangles += [(0, 1 + k, 1 + after), (last, last - sides + after, last - sides + k)]
        for ring in range(rows - 2):
            a, b = 1 + ring * sides + k, 1 + ring * sides + after
            triangles += [(a, a + sides, b), (b, a + sides, b + sides)]
    vertices = np.array([*vertices, [0, 0, -1.0]])
    rng = rng or np.random.default_rng(5)
    radius = np.ones(len(vertices))
    for _ in range(6):
        radius += 0.07 * np.cos(vertices @ rng.normal(size=3) * 2 + rng.uniform(0, 6))
    return vertices * radius[:, None] * [1.0, 0.8, 0.6], np.array(triangles)


def simplified(vertices, triangles, tolerance, faces=None, tilt=0.3):
    faces = np.zeros(len(triangles)) if faces is None else faces
    return _core.simplify(
        np.ascontiguousarray(vertices, dtype=np.float64), triangles.astype(np.int32), faces.astype(np.int32),
        tolerance, tilt,
    )  # fmt: skip


def deviation(vertices, first, second):
    """Return the largest distance of points of each surface from the other."""
    away = []
    for one, other in ((first, second), (second, first)):
        weights = np.random.default_rng(0).dirichlet(np.ones(3), len(one))
        points = np.concatenate([vertices[np.unique(one)], np.einsum("tk,tki->ti", weights, vertices[one])])
        away.append(Surface(vertices, other.astype(np.int64)).closest(points).distances.max())
    return max(away)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-3, 5e-3])
@pytest.mark.parametrize("seed", range(4))
def test_copies_stay_within_their_tolerance(tolerance, seed):
    vertices, triangles = ball(40, np.random.default_rng(seed))
    kept, rows = simplified(vertices, triangles, tolerance)
    assert len(kept) < len(triangles)
    assert len(np.unique(rows)) == len(rows)
    assert deviation(vertices, triangles, kept) < 2 * tolerance


def test_copies_of_closed_meshes_are_closed():
    vertices, triangles = ball(40)
    kept, _ = simplified(vertices, triangles, 5e-3)
    _, ahead, back, _, _ = _core.edge_table(kept.astype(np.int64), len(vertices))
    assert len(kept) < 0.3 * len(triangles)
    assert (ahead == 1).all()
    assert (back == 1).all()


def borders(some, owner):
    """Return the sides between two faces, and the sides of one triangle only."""
    sides = np.sort(np.concatenate([some[:, [0, 1]], some[:, [1, 2]], some[:, [2, 0]]]), axis=1)
    found = {}
    for side, one in zip(map(tuple, sides.tolist()), np.tile(owner, 3).tolist(), strict=True):
        found.setdefault(side, []).append(one)
    between = {side for side, of in found.items() if len(set(of)) > 1}
    return between, {side for side, of in found.items() if len(of) == 1}


def from_segments(points, segments):
    """Return the distance of each point from the nearest segment."""
    a, b = np.moveaxis(segments, 1, 0)
    along = b - a
    t = np.clip(np.einsum("psi,si->ps", points[:, None] - a, along) / np.sum(along**2, axis=1), 0, 1)
    return np.linalg.norm(points[:, None] - a - t[..., None] * along, axis=2).min(axis=1)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-2])
def test_copies_keep_open_ends_and_move_borders_little(tolerance):
    vertices, triangles = grid(30, lambda x, y: 0.01 * np.sin(3 * x + y))
    x, y = vertices[triangles].mean(axis=1)[:, :2].T
    faces = (x > 0.5 + 0.2 * np.sin(4 * y)).astype(int)
    kept, rows = simplified(vertices, triangles, tolerance, faces)
    assert len(kept) < 0.5 * len(triangles)
    (between, ends), (old, old_ends) = borders(kept, faces[rows]), borders(triangles, faces)
    assert ends == old_ends
    assert len(between) < len(old)
    points = vertices[np.unique(sorted(old))]
    assert from_segments(points, vertices[np.array(sorted(between))]).max() <= tolerance


def tube(sides):
    """Return vertices, triangles and faces of a tube of ``sides`` facets, 0.03 in radius and 0.1 long, with a bore."""
    turn = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    vertices = np.concatenate([np.column_stack([r * ring, np.full(sides, z)]) for r, z in
                               ((0.03, 0), (0.03, 0.1), (0.01, 0.1), (0.01, 0))])  # fmt: skip
    k, after = np.arange(sides), np.roll(np.arange(sides), -1)
    triangles, faces = [], []
    for face in range(4):
        a, b = face * sides, (face + 1) % 4 * sides
        triangles += [np.stack([a + k, a + after, b + k], -1), np.stack([a + after, b + after, b + k], -1)]
        faces += [np.full(2 * sides, face)]
    return vertices, np.concatenate(triangles), np.concatenate(faces)


def test_round_faces_between_flat_ones_become_coarser():
    vertices, triangles, faces = tube(256)
    counts = []
    for tolerance in (1e-5, 1e-4, 1e-3):
        kept, rows = simplified(vertices, triangles, tolerance, faces)
        _, ahead, back, _, _ = _core.edge_table(kept.astype(np.int64), len(vertices))
        assert (ahead == 1).all()
        assert (back == 1).all()
        for face in range(4):
            own, was = kept[faces[rows] == face], triangles[faces == face]
            hits = Surface(vertices, own.astype(np.int64)).closest(vertices[np.unique(was)])
            assert hits.distances.max() <= tolerance * (1 + 1e-9)
            area, whole = (
                np.linalg.norm(np.cross(*(vertices[t[:, j]] - vertices[t[:, 0]] for j in (1, 2))), axis=1).sum()
                for t in (own, was)
            )
            assert abs(area / whole - 1) < 0.1
        counts.append(len(kept))
    assert len(triangles) > counts[0] > 2 * counts[1] > 4 * counts[2] > 0


def test_both_sides_of_a_thin_sheet_stay_apart():
    top, triangles = grid(30, lambda x, y: 0.05 * x * y + 1e-4)
    bottom, _ = grid(30, lambda x, y: 0.05 * x * y)
    vertices = np.concatenate([top, bottom])
    both = np.concatenate([triangles, triangles[:, ::-1] + len(top)])
    kept, _ = simplified(vertices, both, 2e-3)
    upper = (kept < len(top)).all(axis=1)
    assert (upper | (kept >= len(top)).all(axis=1)).all()
    for side, own in ((upper, triangles), (~upper, triangles[:, ::-1] + len(top))):
        assert deviation(vertices, own, kept[side]) < 4e-3
        a, b, c = np.moveaxis(vertices[kept[side]], 1, 0)
        assert len(np.unique(np.sign(np.cross(b - a, c - a)[:, 2]))) == 1


def test_places_that_are_no_manifold_stay():
    vertices, triangles = grid(20, lambda x, y: 0 * x)
    wing, more = grid(20, lambda x, y: 0 * x)
    wing = wing[:, [0, 2, 1]] + [0, 0.5, 0]  # a sheet that stands on the middle of the other
    points = np.concatenate([vertices, wing])
    rows = np.unique(points.round(9), axis=0, return_inverse=True)[1].reshape(-1)
    joined = rows[np.concatenate([triangles, more + len(vertices)])]
    points = np.unique(points.round(9), axis=0)
    kept, _ = simplified(points, joined, 1e-3)
    seam = np.flatnonzero((points[:, 1] == 0.5) & (points[:, 2] == 0))
    assert len(kept) < 0.4 * len(joined)
    assert np.isin(seam, kept).all()


def test_slivers_and_tiny_meshes_are_kept_sound():
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    tetrahedron = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    kept, _ = simplified(corners, tetrahedron, 10.0)
    assert len(kept) == 4
    vertices, triangles = grid(30, lambda x, y: 0 * x)
    vertices[:, 1] *= 1e-5
    kept, _ = simplified(vertices, triangles, 1e-3)
    assert deviation(vertices, triangles, kept) < 2e-3


def test_a_simplified_mesh_refuses_bad_corners():
    vertices, triangles = ball(4)
    with pytest.raises(ValueError, match="triangles: expected numbers from 0"):
        simplified(vertices[:-1], triangles, 1e-3)


@pytest.fixture(scope="module")
def large():
    vertices, triangles = ball(90)
    return tanteo.part_from_mesh(0.05 * vertices, triangles, unit="m", name="large")


def test_copies_are_as_coarse_as_the_noise_of_many_readings(large):
    small = tanteo.part_from_mesh(*ball(5), unit="m", name="small")
    assert copy_of(small, Resolution(np.inf)) is small
    assert copy_of(large, Resolution(1e-9)) is large
    middle = tanteo.part_from_mesh(*tube(64)[:2], unit="m", name="tube")
    assert copy_of(middle, Resolution(1e-5)) is middle
    counts = [len(copy_of(middle, Resolution(5e-3, count=count)).triangles) for count in (400, 10)]
    assert len(middle.triangles) >= 2 * counts[0] > 2 * counts[1]
    assert copy_for_field(middle) is middle
    assert copy_of(large, Resolution(0.0)) is large
    sizes = [len(copy_of(large, Resolution(sd)).triangles) for sd in (1e-5, 1e-4, 1e-3)]
    assert len(large.triangles) > sizes[0] > sizes[1] > sizes[2]
    for sd in (1e-4, 1e-3):
        copy = copy_of(large, Resolution(sd))
        away = Surface(copy.vertices, copy.triangles).closest(large.vertices).distances.max()
        assert away < 1.5 * SHARE * sd
        assert copy.area == large.area
        assert copy.faces == large.faces


def thickness(part):
    """Return the thickness of a part along z at some places [m]."""
    at = np.array([[x, y, 0.1] for x in (-0.02, 0.0, 0.02) for y in (-0.015, 0.01)])
    surface, down = Surface(part.vertices, part.triangles), np.tile([0.0, 0.0, -1.0], (len(at), 1))
    return 0.2 - surface.cast(at, down).distances - surface.cast(at * [1, 1, -1], -down).distances


def test_walls_are_measured_on_a_copy_that_keeps_them(large):
    copy = copy_for_walls(large)
    assert len(copy.triangles) < 0.8 * len(large.triangles)
    # two oblique surfaces: twice the deviation each
    assert np.abs(thickness(copy) - thickness(large)).max() < 4e-4 * large.diagonal


def test_copies_do_not_depend_on_earlier_questions(large):
    again = tanteo.part_from_mesh(large.vertices, large.triangles, unit="m", name="large")
    copy_for_field(again)
    for sd in (1e-4, 1e-2):
        first, second = (copy_of(one, Resolution(sd)) for one in (large, again))
        np.testing.assert_array_equal(first.triangles, second.triangles)


@pytest.mark.parametrize("tilt", [0.3, 0.1])
def test_normals_of_copies_differ_by_their_tilt_at_most(tilt):
    vertices, triangles = ball(60)
    corners = vertices[triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    smooth = np.zeros_like(vertices)
    np.add.at(smooth, triangles, across[:, None])
    smooth /= np.linalg.norm(smooth, axis=1, keepdims=True)
    kept, _ = simplified(vertices, triangles, 0.02, tilt=tilt)
    hits = Surface(vertices, kept.astype(np.int64))
    normals = hits.normals[hits.closest(vertices).triangles]
    angles = np.arccos(np.clip(np.sum(normals * smooth, axis=1), -1, 1))
    assert len(kept) < 0.5 * len(triangles)
    assert np.quantile(angles, 0.99) < tilt  # a vertex may be nearest to another triangle than its own


@pytest.mark.parametrize("tilt_sd", [0.3, 0.1])
def test_sensed_normals_limit_the_tilt_of_copies(large, tilt_sd):
    kept = copy_of(large, Resolution(5e-3, tilt_sd))
    exact, copy = Surface(large.vertices, large.triangles), Surface(kept.vertices, kept.triangles)
    middles = large.vertices[large.triangles].mean(axis=1)[::50]
    own = exact.normals[exact.closest(middles).triangles]
    other = copy.normals[copy.closest(middles).triangles]
    angles = np.arccos(np.clip(np.sum(own * other, axis=1), -1, 1))
    assert len(kept.triangles) < len(large.triangles)
    assert np.quantile(angles, 0.98) < 0.3 * tilt_sd + 0.01  # facets of the mesh itself differ from its smooth shape


def test_parts_are_located_as_without_copies(monkeypatch):
    vertices, triangles, _ = tube(256)
    vertices = vertices * [1.0, 0.6, 1.0] * (1 + 8 * vertices[:, 2:]) + vertices[:, 2:] * [0.3, 0.0, 0.0]

    def located(share):
        monkeypatch.setattr(copies, "SHARE", share)
        part = tanteo.part_from_mesh(vertices, triangles, unit="m", name="part")
        rng = np.random.default_rng(3)
        corners = vertices[triangles[rng.choice(len(triangles), 25)]]
        T = SE3.from_parts(SO3.exp(np.array([0.4, -1.0, 0.7])), np.array([0.1, 0.2, -0.05]))
        places = np.einsum("pk,pki->pi", rng.dirichlet(np.ones(3), 25), corners)
        points = SE3.apply(T, places) + sd * rng.normal(size=(25, 3))
        readings = tanteo.Readings.from_columns(points=points, sds=np.full(25, sd))
        answer = tanteo.locate(readings, part)
        return answer, min((len(one.triangles) for one in part.derived.get("copies", {}).values()), default=np.inf)

    sd = 1e-3
    with_copies, used = located(0.1)
    exact, none = located(0.0)
    assert used < 0.5 * len(triangles)
    assert none == np.inf
    assert with_copies.status == exact.status
    one, other = with_copies.hypotheses[0], exact.hypotheses[0]
    xi = SE3.log(SE3.inverse(other.T_world_part) @ one.T_world_part)
    assert xi @ np.linalg.solve(other.covariance, xi) < 0.3
    np.testing.assert_allclose(np.diag(one.covariance), np.diag(other.covariance), rtol=0.3)
    assert abs(one.probability - other.probability) < 0.02


@pytest.mark.slow
def test_a_second_process_makes_no_copy_again(monkeypatch, tmp_path):
    monkeypatch.setenv("TANTEO_CACHE", str(tmp_path / "cache"))
    vertices, triangles, _ = tube(4000)
    vertices = vertices * [1.0, 0.6, 1.0] * (1 + 8 * vertices[:, 2:])
    file = tmp_path / "large.off"
    rows = [" ".join(map(str, v)) for v in (1e3 * vertices).tolist()]
    rows += ["3 " + " ".join(map(str, t)) for t in triangles.tolist()]
    file.write_text("\n".join([f"OFF\n{len(vertices)} {len(triangles)} 0", *rows]))
    points = vertices[triangles[::1500]].mean(axis=1)
    readings = tanteo.Readings.from_columns(points=points, sds=np.full(len(points), 1e-4))
    first = tanteo.locate(readings, tanteo.read_parts([file], unit="mm").parts[0])
    assert first.hypotheses

    def never(*arguments):
        raise AssertionError("a copy is made again")

    monkeypatch.setattr(_core, "simplify", never)
    monkeypatch.setattr(Surface, "cast", never)
    again = tanteo.locate(readings, tanteo.read_parts([file], unit="mm").parts[0])
    np.testing.assert_array_equal(again.best.T_world_part, first.best.T_world_part)
