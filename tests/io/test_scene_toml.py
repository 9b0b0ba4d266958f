"""Scene files: valid content becomes a scene, and invalid content is refused by name."""

from pathlib import Path

import numpy as np
import pytest

from tanteo.errors import InputError, PartError, TanteoError
from tanteo.hand.acquisition import EdgeGuess, FaceGuess, VertexGuess
from tanteo.io import read_scene

CUBE = np.array([[x, y, z] for x in (0, 0.1) for y in (0, 0.1) for z in (0, 0.1)])
TRIANGLES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
                      [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])  # fmt: skip
WHOLE = """
seed = 3
[table]
top_mm = 10
size_mm = [400, 300]
[parts.cube]
file = "cube.stl"
units = "mm"
position_mm = [0, 0, 10]
turn_deg = [0, 0, 90]
[occluders.clamp]
low_in = [1, 1, 0]
high_in = [2, 2, 4]
[hand]
front_mm = [-50, 50, 200]
view_direction = [0, 0.0, -1]
pair = [0, 1, 0]
rate_hz = 50
latency_ms = 20
speed_mm_s = 100
turn_deg_s = 45
robot = "calibrated_small"
cone_rays = 16
[workspace]
low_mm = [-300, -300, 12]
[forbidden.rail]
low_mm = [0, 0, 0]
high_mm = [10, 20, 500]
position_mm = [200, 0, 0]
turn_deg = [0, 0, 90]
[sense]
standoff_mm = 15
clearance_mm = 8
[sense.plane]
point_mm = [-40, 40, 110]
normal = [0, 0, 2]
[sense.edge]
point_mm = [-40, 0, 110]
direction = [1, 0, 0]
normal = [0, 0, 1]
[sense.vertex]
point_mm = [0, 0, 110]
arriving = [1, 0, 0]
leaving = [0, 1, 0]
normal = [0, 0, 1]
"""
LEAST = '[parts.cube]\nfile = "cube.stl"\n[hand]\nfront_mm = [50, 50, 200]\n'


def read(tmp_path, text):
    path = tmp_path / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return read_scene(path, lambda file, unit: (CUBE, TRIANGLES))


def test_all_of_it(tmp_path):
    scene = read(tmp_path, WHOLE)
    assert [s.name for s in scene.scene.solids] == ["table", "cube", "clamp"]
    _, cube, clamp = scene.scene.solids
    np.testing.assert_allclose(
        [cube.vertices.min(0), cube.vertices.max(0)], [[-0.1, 0, 0.01], [0, 0.1, 0.11]], atol=1e-12
    )
    np.testing.assert_allclose(clamp.vertices.max(0), np.array([2, 2, 4]) * 0.0254)
    np.testing.assert_allclose(scene.T_world_hand[:3, :3] @ scene.hand.pair, [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(scene.T_world_hand @ [*scene.hand.front, 1], [-0.05, 0.05, 0.2, 1], atol=1e-12)
    cell = scene.cell
    assert (cell.period, cell.latency, cell.max_speed, cell.cone) == pytest.approx((0.02, 0.02, 0.1, 16))
    assert cell.max_turn == pytest.approx(np.pi / 4)
    assert cell.robot.name == "calibrated_small"
    np.testing.assert_allclose(scene.workspace.low, [-0.3, -0.3, 0.012])
    assert np.isinf(scene.workspace.high).all()
    (rail,) = scene.workspace.forbidden
    assert rail.name == "rail"
    np.testing.assert_allclose(rail.distances(np.array([[0.19, 0.005, 0.1], [0.21, 0.005, 0.1]]))[0], [-0.005, 0.01])
    assert (scene.seed, scene.standoff, scene.clearance) == pytest.approx((3, 0.015, 0.008))
    assert [type(scene.guesses[k]) for k in ("plane", "edge", "vertex")] == [FaceGuess, EdgeGuess, VertexGuess]
    np.testing.assert_allclose(scene.guesses["plane"].normal, [0, 0, 1])


def test_the_least_there_must_be(tmp_path):
    scene = read(tmp_path, LEAST)
    assert scene.seed == 0
    assert scene.clearance == pytest.approx(0.6 * scene.standoff)
    assert np.isinf(scene.workspace.low).all()
    guess = scene.guesses["plane"]
    np.testing.assert_allclose(guess.point, [0.05, 0.05, 0.14], atol=1e-12)
    np.testing.assert_allclose(guess.normal, [0, 0, 1], atol=1e-12)
    assert set(scene.guesses) == {"plane"}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("seed = 3", "seed = -1"), "seed: expected a whole number"),
        (("[table]", "[tabel]"), "expected one of seed, table"),
        (("top_mm", "top"), "top: expected one of top_mm"),
        (("size_mm = [400, 300]", "size_mm = [400]"), "size_mm: expected 2 numbers, got 1"),
        (("low_in = [1, 1, 0]", "low_in = [3, 1, 0]"), "clamp: expected a low and a high corner"),
        (("high_mm = [10, 20, 500]", "high_mm = [10, 20, -5]"), "forbidden box 'rail': expected a low and a high"),
        (("high_mm = [10, 20, 500]\n", ""), "forbidden box 'rail': expected 'high_mm'"),
        (("[forbidden.rail]", "[forbiden.rail]"), "expected one of seed, table"),
        (("front_mm", "fronts_mm"), "Did you mean 'front_mm'"),
        (
            ("view_direction = [0, 0.0, -1]", "view_direction = [0, 0, 0]"),
            "view_direction: expected a direction that is not zero",
        ),
        (("pair = [0, 1, 0]", "pair = [0, 0, 1]"), "pair: expected a direction across view_direction"),
        (("rate_hz = 50", "rate_hz = true"), "rate_hz: expected finite numbers"),
        (("latency_ms = 20", "latency_ms = -5"), "latency_ms: expected one number of zero or more, got -5"),
        (('robot = "calibrated_small"', 'robot = "r2d2"'), "robot: expected one of"),
        (("point_mm = [-40, 40, 110]\n", ""), "sense.plane: expected 'point_mm'"),
        (("arriving = [1, 0, 0]", "arriving = [0, 1, 0]"), "leaving: expected an edge that meets"),
        (('file = "cube.stl"\n', ""), "part 'cube': expected 'file'"),
        (("turn_deg = [0, 0, 90]", "turn_deg = [0, 0, 90]\nquaternion_wxyz = [1, 0, 0, 0]"), "got both"),
        (("standoff_mm = 15", "standoff_mm = 15\nstandoff_m = 1"), "expected 'standoff' once"),
        (("[table]", "table ="), "expected TOML"),
    ],
)
def test_invalid_scenes_are_refused(tmp_path, change, message):
    assert change[0] in WHOLE
    with pytest.raises(TanteoError, match=message):
        read(tmp_path, WHOLE.replace(*change, 1))


def test_files_that_are_missing(tmp_path):
    with pytest.raises(InputError, match="expected a scene file, got"):
        read_scene(tmp_path / "none.toml")
    (tmp_path / "scene.toml").write_text(LEAST, encoding="utf-8")
    with pytest.raises(PartError, match="expected a CAD file, got nothing there"):
        read_scene(tmp_path / "scene.toml")
    with pytest.raises(InputError, match=r"expected at least one table \[parts.NAME\]"):
        read(tmp_path, "seed = 1\n")


def test_the_example():
    scene = read_scene(Path(__file__).parents[2] / "examples" / "scenes" / "bracket.toml")
    assert [s.name for s in scene.scene.solids] == ["table", "bracket", "clamp", "riser"]
    assert set(scene.guesses) == {"plane", "edge"}


def test_the_example_of_a_bore():
    scene = read_scene(Path(__file__).parents[2] / "examples" / "scenes" / "bore.toml")
    assert [s.name for s in scene.scene.solids] == ["table", "flange"]
    assert {"circle", "cylinder"} <= set(scene.guesses)


def test_a_rough_place_and_the_furniture(tmp_path):
    place = "[prior]\nposition_mm = [1, 2, 3]\nturn_deg = [0, 0, 90]\nsd_mm = [10, 20, 5]\nturn_sd_deg = 8\n"
    scene = read(tmp_path, WHOLE + place)
    assert [s.name for s in scene.furniture] == ["table", "clamp"]
    assert [b.name for b in scene.occluders] == ["clamp"]
    np.testing.assert_allclose(scene.occluders[0].high, [0.0508, 0.0508, 0.1016])
    assert scene.prior is not None
    np.testing.assert_allclose(scene.prior.T[:3, 3], [0.001, 0.002, 0.003])
    # the sds are along the world's axes, the covariance along those of the part, which is turned by 90 degrees
    np.testing.assert_allclose(np.sqrt(np.diag(scene.prior.C)), [0.02, 0.01, 0.005, *np.radians([8, 8, 8])])
    assert read(tmp_path, LEAST).prior is None
    assert read(tmp_path, LEAST).furniture == ()


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("position_mm = [1, 2, 3]\nturn_sd_deg = 8", "expected 'sd_mm'"),
        ("sd_mm = 3\nturn_sd_deg = 80", "attitude known to 60 degrees"),
        ("sd_mm = [3, 4]\nturn_sd_deg = 8", "expected one positive number or three"),
        ("sd_mm = -3\nturn_sd_deg = 8", "expected one positive number or three"),
    ],
)
def test_a_rough_place_that_is_none(tmp_path, table, message):
    with pytest.raises(InputError, match=message):
        read(tmp_path, f"{LEAST}[prior]\n{table}\n")
