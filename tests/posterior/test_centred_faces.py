"""Balls and countersinks, sensed as features or given by a report: which part, and where."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCone, BRepPrimAPI_MakeSphere
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

from drilled import THICK, as_part, drilled, pin
from tanteo import identify, read_part, read_readings
from tanteo.features.kinds import CONE, SPHERE
from tanteo.fitting import fit_plane, fit_round, given_round
from tanteo.geometry import SE3
from tanteo.parts.faces import centred_faces
from tanteo.posterior import identify_features

SD = 1e-5
T = SE3.exp(np.array([0.3, 0.2, 0.05, 0.4, -0.3, 1.2]))
BARS = (100, 10, 8), (100, 10, 10), (80, 10, 8)
SUNK = ((-30, -20), (35, 12)), ((-30, -20), (35, -12)), ((-30, -20), (22, 12))


def bar(length, *radii):
    """Return a foot with two balls on pins, 30 mm over its lower face."""
    body = BRepPrimAPI_MakeBox(gp_Pnt(-15, -10, 0), gp_Pnt(length + 15, 10, 10)).Shape()
    for x, radius in zip((0, length), radii, strict=True):
        body = BRepAlgoAPI_Fuse(body, pin(x, 0, 5, 30, 4)).Shape()
        body = BRepAlgoAPI_Fuse(body, BRepPrimAPI_MakeSphere(gp_Pnt(x, 0, 30), radius).Shape()).Shape()
    return body


def sunk(places):
    """Return a plate with holes of 6 mm, countersunk to 14 mm from above: their apexes are 5 mm over its lower face."""
    axes = [gp_Ax2(gp_Pnt(x, y, THICK - 4), gp_Dir(0, 0, 1)) for x, y in places]
    cones = [BRepPrimAPI_MakeCone(axis, 3, 7, 4).Shape() for axis in axes]
    return drilled((), None, [*cones, *(pin(x, y, -1, THICK + 1, 3) for x, y in places)])


@pytest.fixture(scope="module")
def bars(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bars")
    return [as_part(bar(*spec), folder / f"bar{k}.step") for k, spec in enumerate(BARS)]


@pytest.fixture(scope="module")
def plates(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plates")
    return [as_part(sunk(places), folder / f"plate{k}.step") for k, places in enumerate(SUNK)]


def as_mesh(part, path):
    corners = (1e3 * part.vertices[part.triangles]).astype("<f4")
    rows = b"".join(bytes(12) + one.tobytes() + bytes(2) for one in corners)
    path.write_bytes(bytes(80) + struct.pack("<I", len(corners)) + rows)
    return read_part(path, unit="mm")


def face(corners, outward, rng):
    """Return a plane touched at four places of the part [mm]."""
    p = SE3.apply(T, 1e-3 * np.asarray(corners, dtype=float))
    covs = np.tile(SD**2 * np.eye(3), (len(p), 1, 1))
    return fit_plane(p + SD * rng.normal(size=p.shape), covs, outward=T[:3, :3] @ outward, label="face")[0]


def balls(length, *radii, rng, **more):
    """Two balls and the lower face."""
    found = []
    for x, radius in zip((0, length), radii, strict=True):
        c = SE3.apply(T, 1e-3 * np.array([x, 0, 30.0])) + SD * rng.normal(size=3)
        found.append(given_round(SPHERE, c, SD, size=1e-3 * radius, size_sd=SD, label=f"ball {x}", **more))
    corners = [(-14, -9, 0), (length + 14, -9, 0), (length + 14, 9, 0), (-14, 9, 0)]
    return [*found, face(corners, [0, 0, -1.0], rng)]


def sinks(places, rng, **more):
    """Two countersinks and the upper face."""
    found = []
    for x, y in places:
        c, given = SE3.apply(T, 1e-3 * np.array([x, y, 5.0])) + SD * rng.normal(size=3), {"size": np.pi / 4, **more}
        found.append(given_round(CONE, c, SD, axis=T[:3, 2], axis_sd=2e-3, size_sd=1e-3, label=f"sink {x}", **given))
    return [*found, face([(-48, -33, 12), (48, -33, 12), (48, 33, 12), (-48, 33, 12)], [0, 0, 1.0], rng)]


def nearest(hypothesis):
    """Return the error of the nearest of all symmetric poses [m]."""
    poses = np.concatenate([hypothesis.T_world_part[None], hypothesis.symmetry_poses])
    return np.linalg.norm((poses - T)[:, :3, 3], axis=1).min()


@pytest.mark.parametrize("of_mesh", [False, True])
@pytest.mark.parametrize("k", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in range(1, len(BARS)))])
def test_two_balls_and_a_face_locate_a_ball_bar(bars, tmp_path, k, of_mesh):
    parts = [as_mesh(part, tmp_path / f"{part.name}.stl") for part in bars] if of_mesh else bars
    answer = identify_features(balls(*BARS[k], rng=np.random.default_rng(k), convex=True), parts)
    best = answer.hypotheses[0]
    assert (answer.status, best.part) == ("recognized", f"bar{k}")
    assert nearest(best) < 5e-5
    assert {face for name, face in best.pairings if name.startswith("ball")} == {
        parts[k].faces[one.face].name for one in centred_faces(parts[k])
    }


@pytest.mark.parametrize("of_mesh", [False, True])
@pytest.mark.parametrize("k", range(len(SUNK)))
def test_two_countersinks_and_a_face_locate_a_plate(plates, tmp_path, k, of_mesh):
    parts = [as_mesh(part, tmp_path / f"{part.name}.stl") for part in plates] if of_mesh else plates
    assert [one.size for one in centred_faces(parts[k])] == pytest.approx([np.pi / 4] * 2, abs=1e-5)
    answer = identify_features(sinks(SUNK[k], np.random.default_rng(k), convex=False), parts)
    assert (answer.status, answer.hypotheses[0].part) == ("recognized", f"plate{k}")
    assert nearest(answer.hypotheses[0]) < 5e-5


def test_a_fitted_cone_has_a_better_axis_than_apex(plates):
    """The apex is below the touches: to the sides it is known to 26 um, where it was touched to six."""
    rng, found = np.random.default_rng(3), []
    turn, z = np.arange(12) * np.pi / 6, np.array([8.5, 9.8, 11.2])[np.arange(12) % 3]
    away = np.c_[np.cos(turn), np.sin(turn), 0 * turn]
    for x, y in SUNK[0]:
        q = 1e-3 * (np.array([x, y, 0]) + (z - 5)[:, None] * away + np.outer(z, [0, 0, 1.0]))
        points = SE3.apply(T, q) + SD * rng.normal(size=q.shape)
        into = (away - [0, 0, 1]) @ T[:3, :3].T
        covs = np.tile(SD**2 * np.eye(3), (12, 1, 1))
        found.append(fit_round(CONE, points, covs, directions=into, label=f"sink {x}")[0])
    assert all(np.sqrt(np.diag(cone.P)[:2]).min() > 2e-5 for cone in found)
    answer = identify_features([*found, sinks(SUNK[0], rng)[-1]], plates[:1])
    best = answer.hypotheses[0]
    assert np.sqrt(np.diag(best.covariance)[:2]).max() < 1.2e-5
    assert nearest(best) < 5e-5


@pytest.mark.parametrize("more", [{"convex": True}, {"size": np.radians(30.0)}], ids=["a boss", "another angle"])
def test_a_cone_of_another_side_or_angle_is_not_on_the_plate(plates, more):
    answer = identify_features(sinks(SUNK[0], np.random.default_rng(0), **more), plates)
    assert answer.unknown_probability > 0.9 or not any(
        name.startswith("sink") for name, _ in answer.hypotheses[0].pairings
    )


def test_three_balls_alone_locate_their_part(tmp_path):
    body = BRepPrimAPI_MakeBox(gp_Pnt(-20, -20, 0), gp_Pnt(90, 70, 10)).Shape()
    places = [(0, 0, 18), (70, 5, 18), (20, 55, 18)]
    for at in places:
        body = BRepAlgoAPI_Fuse(body, BRepPrimAPI_MakeSphere(gp_Pnt(*at), 10).Shape()).Shape()
    part, rng = as_part(body, tmp_path / "three.step"), np.random.default_rng(1)
    centres = SE3.apply(T, 1e-3 * np.array(places, dtype=float)) + SD * rng.normal(size=(3, 3))
    found = [
        given_round(SPHERE, c, SD, size=0.01, size_sd=SD, convex=True, label=str(k)) for k, c in enumerate(centres)
    ]
    answer = identify_features(found, [part])
    assert answer.status == "recognized"
    assert nearest(answer.hypotheses[0]) < 1e-4


def test_a_table_gives_balls_and_cones(tmp_path, bars):
    c = 1e3 * SE3.apply(T, 1e-3 * np.array([[0, 0, 30.0], [100, 0, 30]]))
    foot = 1e3 * SE3.apply(T, 1e-3 * np.array([[-14, -9, 0.0], [114, -9, 0], [114, 9, 0], [-14, 9, 0]]))
    down = T[:3, 2]
    rows = [f"{x},{y},{z},,,,{r},boss,sphere,b{r}" for (x, y, z), r in zip(c, (10, 8), strict=True)]
    rows += [f"{x},{y},{z},{down[0]},{down[1]},{down[2]},,,plane,foot" for x, y, z in foot]
    path = tmp_path / "report.csv"
    path.write_text("x_mm,y_mm,z_mm,dx,dy,dz,sphere_radius_mm,side,kind,feature\n" + "\n".join(rows) + "\n")
    readings = read_readings(path)
    assert readings.kinds[:2] == ("sphere_centre",) * 2
    assert "2 rows give the centre of a sphere" in " ".join(readings.notes)
    answer = identify(readings, bars, sd=SD)
    assert (answer.status, answer.hypotheses[0].part) == ("recognized", "bar0")
    assert nearest(answer.hypotheses[0]) < 5e-5
