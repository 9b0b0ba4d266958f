"""Centres of holes and bosses in the posterior: with faces, by themselves, of twins, with radius, side and axis."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")

from bare_scenes import nees, off
from drilled import HOLES, HUB, SD, THICK, TOP, T, as_part, drilled, heights, sensed
from tanteo import PosePrior, Priors, Readings, identify, locate
from tanteo.errors import InputError
from tanteo.features import Feature
from tanteo.features.kinds import CIRCLE, CYLINDER
from tanteo.geometry import SE3, SO3
from tanteo.posterior import identify_features

FIRST = heights(HOLES, np.random.default_rng(3))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("holes")


@pytest.fixture(scope="module")
def plate(folder):
    return as_part(drilled(), folder / "plate.step")


@pytest.fixture(scope="module")
def twin(folder):
    """One hole is elsewhere by a millimetre."""
    return as_part(drilled([*HOLES[:2], (-32.2, 25.6, 4), HOLES[3]]), folder / "twin.step")


def right(answer, plate, within=2e-4):
    moved, turned = off(plate, answer.best.T_world_part, T)
    return answer.best.part == plate.name and moved < within and turned < 5e-3


def test_two_holes_and_a_face_locate_a_plate(plate):
    answer = locate(sensed(FIRST[[0, 3]]), plate)
    assert answer.status == "recognized"
    assert right(answer, plate)
    chi2, _ = nees(plate, answer.best.T_world_part, answer.best.covariance, T)
    assert chi2 < 30
    assert [face[:4] for _, face in answer.best.pairings] == ["hole"] * 2 + ["face"] * len(TOP)


@pytest.mark.parametrize("seed", range(3))
def test_the_pattern_distinguishes_twins(plate, twin, seed):
    answer = identify(sensed(FIRST, seed=seed), [plate, twin])
    assert answer.status == "recognized"
    assert right(answer, plate)


def test_what_was_sensed_of_neither_twin_is_not_taken_for_one(plate, twin):
    moved = FIRST + np.array([[0, 0, 0], [0, 0, 0], [-0.003, 0.002, 0], [0, 0, 0]])
    assert identify(sensed(moved), [plate, twin]).status != "recognized"


def test_one_centre_is_too_little(plate):
    answer = locate(sensed(FIRST[:1], top=0), plate)
    assert answer.status == "insufficient"
    assert "the part can tilt and turn about it" in answer.message


def test_two_centres_alone_are_too_little(plate):
    answer = locate(sensed(FIRST[:2], top=0), plate)
    assert answer.status == "insufficient"
    assert "Sense a face" in answer.message


def test_one_hole_and_a_face_leave_a_turn_free(plate):
    answer = locate(sensed(FIRST[:1], hole_radii=[4e-3, *[np.nan] * len(TOP)]), plate)
    assert answer.status in ("insufficient", "ambiguous")


@pytest.mark.parametrize("side", ["hole", "boss"])
def test_a_hole_is_never_taken_for_a_boss(plate, side):
    """The hub is where a centre was sensed; a label that makes it a hole is rejected."""
    centres = np.concatenate([FIRST[[0, 1, 3]], [[1e-3 * HUB[0], 1e-3 * HUB[1], 0.02]]])
    sides = ["", "", "", side, *[""] * len(TOP)]
    best = locate(sensed(centres, material_sides=sides), plate).best
    assert ("4" in best.outliers) == (side == "hole")


def test_a_hole_of_another_radius_is_an_outlier(plate):
    radii = [4e-3, 4e-3, 4e-3, 4.5e-3, *[np.nan] * len(TOP)]
    best = locate(sensed(FIRST, hole_radii=radii), plate).best
    assert best.outliers == ("4",)
    assert right_pose(best, plate)


def right_pose(best, plate):
    return off(plate, best.T_world_part, T)[0] < 3e-4


@pytest.mark.parametrize("sign", [1, -1])
def test_an_axis_may_be_named_by_either_end(plate, sign):
    """Three holes in a plate fix all but the height where their axes are known."""
    n, m = len(FIRST), len(TOP)
    normals = np.full((n + m, 3), np.nan)
    normals[:n] = sign * T[:3, 2]
    sds = np.r_[np.full(n, 0.01), np.full(m, np.nan)]
    answer = locate(sensed(FIRST, normals=normals, normal_sds=sds), plate)
    assert answer.status == "recognized"
    assert right(answer, plate)


def test_a_symmetric_pattern_is_ambiguous(folder):
    """Holes at the corners of a rectangle, of a plate that is equal from below except for a hub."""
    corners = [(x, y, 4) for x in (-40, 40) for y in (-25, 25)]
    part = as_part(drilled(corners, hub=(20, 0, 9)), folder / "even.step")
    assert locate(sensed(heights(corners)), part).status == "ambiguous"


@pytest.mark.slow
def test_centres_beside_many_holes_are_found(folder):
    rng = np.random.default_rng(5)
    grid = [(x, y) for x in range(-44, 45, 8) for y in range(-28, 29, 8)]
    holes = [(x + rng.uniform(-1.5, 1.5), y + rng.uniform(-1.5, 1.5), 1.5) for x, y in grid]
    part = as_part(drilled(holes, hub=None), folder / "sieve.step")
    some = heights([holes[k] for k in rng.choice(len(holes), 9, replace=False)], rng)
    answer = locate(sensed(some, top=0), part)
    best = answer.best
    moved = (SE3.inverse(T) @ best.T_world_part)[:2, 3]  # the height along the holes is open
    assert np.linalg.norm(moved) < 5e-4
    assert len(best.pairings) == 9
    assert answer.status == "insufficient"
    assert "sliding along part z" in answer.message


@pytest.mark.parametrize("height", [-0.3, 0.0, 0.02, 0.5])
def test_the_height_of_centres_does_not_count(plate, height):
    """The centres of a table in two dimensions have any height; a touched face states that of the plate."""
    lifted = FIRST * [1, 1, 0] + [0, 0, height]
    answer = locate(sensed(lifted), plate)
    assert answer.status == "recognized"
    assert right(answer, plate)


def test_the_prior_states_the_height_of_centres_alone(plate):
    C = np.diag([2e-2, 2e-2, 1e-3, 0.02, 0.02, 0.02]) ** 2
    answer = locate(sensed(FIRST * [1, 1, 0], top=0), plate, priors=Priors(pose=PosePrior(T, C)))
    assert answer.status == "recognized"
    sd = float(np.sqrt(answer.best.covariance[2, 2]))
    assert 0.5e-3 < sd < 1.5e-3
    assert abs((SE3.inverse(T) @ answer.best.T_world_part)[2, 3]) < 3 * sd


def test_contacts_on_walls_share_a_round_face(plate):
    rng, walls = np.random.default_rng(1), []
    for x, y, radius in HOLES:
        turn, z = rng.uniform(0, 2 * np.pi, 4), rng.uniform(1, 11, 4)
        walls.append(np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn), z]) * 1e-3)
    p = SE3.apply(T, np.concatenate([*walls, TOP])) + SD * rng.normal(size=(16 + len(TOP), 3))
    labels = [f"bore {k // 4}" for k in range(16)] + ["top"] * len(TOP)
    readings = Readings.from_columns(
        points=p,
        sds=np.full(len(p), SD),
        features=labels,
        kinds=["circle"] * 8 + ["cylinder"] * 8 + ["plane"] * len(TOP),
    )
    answer = locate(readings, plate)
    assert answer.status == "recognized"
    assert right(answer, plate)


def test_places_remain_under_a_wrong_label(plate):
    """Contacts of the upper face with the name of a wall contradict their label, but stay on the part."""
    readings = sensed(FIRST)
    kinds = ["cylinder" if kind == "plane" else kind for kind in readings.kinds]
    named = Readings.from_columns(
        points=readings.points,
        sds=readings.sds,
        kinds=kinds,
        features=readings.features,
        directions=readings.directions,
    )
    best = locate(named, plate).best
    assert right_pose(best, plate)
    assert not best.outliers


def features(axes):
    """Return the holes as circles and cylinders, and the face as points of one label."""
    out = []
    for k, (centre, kind) in enumerate(zip(FIRST, (CIRCLE, CIRCLE, CYLINDER, CYLINDER), strict=True)):
        axis = 2 if kind is CIRCLE else kind.axis
        R = SO3.frame_from_axis(T[:3, 2] * axes, axis)
        P = np.diag([SD**2] * 3 + [1e-4] * 2) if kind is CIRCLE else np.diag([SD**2] * 2 + [1e-4] * 2)
        out.append(Feature(kind, SE3.from_parts(R, SE3.apply(T, centre)), P, f"h{k}"))
    return out


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_circles_and_cylinders_are_features(plate, sign):
    answer = identify_features(features(sign), [plate])
    moved, turned = off(plate, answer.best.T_world_part, T)
    assert answer.best.part == plate.name
    assert not answer.best.outliers
    assert moved < 1e-3 * THICK
    assert min(turned, abs(turned - np.pi)) < 0.05


def test_the_published_method_has_no_circles(plate):
    with pytest.raises(InputError, match="round features"):
        locate(sensed(FIRST), plate, as_published=True)
