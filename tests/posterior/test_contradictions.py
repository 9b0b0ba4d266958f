"""Readings that contradict a part, planes of outliers, touches in one region, and parts that rest on a table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import box_centred_pose, surface_points
from tanteo.geometry import SE3
from tanteo.planning.following import next_reading
from tanteo.posterior import PosePrior, Priors, prepare
from tanteo.posterior import Table as Plane

PARTS = Path(__file__).parents[2] / "examples" / "parts"
SD = 1e-4


@pytest.fixture(scope="module")
def block():
    return prepare(tanteo.read_part(PARTS / "bracket_left.step"))


def touches(points, directions):
    return tanteo.Readings.from_columns(points, directions=directions, sds=np.full(len(points), SD))


def scene(target, n, seed):
    rng = np.random.default_rng(seed)
    T = box_centred_pose(rng)
    p, normals = surface_points(target, n, rng)
    return T, SE3.apply(T, p) + SD * rng.normal(size=p.shape), -normals @ T[:3, :3].T


def test_a_reading_that_contradicts_is_repeated_first(block):
    T, points, directions = scene(block, 14, 5)
    local = SE3.apply(SE3.inverse(T), points)
    alone = [k for k in range(14) if np.sort(np.linalg.norm(local - local[k], axis=1))[1] > 0.02]
    k = alone[0]
    again = points[k] + SD * np.array([0.5, -0.5, 0.5])
    points[k] -= 2.5e-3 * directions[k]
    doubted = tanteo.locate(touches(points, directions), block.part)
    assert doubted.status == "ambiguous"
    assert doubted.findings[0].kind == "outlier_or_variant"
    assert f"Touch near reading {k + 1} again." in doubted.message
    proposed = next_reading(doubted, [block.part], tanteo.probe_of(SD, contact=True))
    assert np.linalg.norm(proposed.finding.point - points[k]) < 0.2 * block.part.diagonal
    assert proposed.action.direction @ directions[k] > 0.9
    both = touches(np.r_[points, again[None]], np.r_[directions, directions[k : k + 1]])
    assert tanteo.locate(both, block.part).status == "recognized"


@pytest.mark.slow
@pytest.mark.parametrize(("name", "count", "seed", "least"), [("step_12mm", 14, 6, 0.1), ("wedge", 12, 3, 0.495)])
def test_the_only_reading_of_a_displaced_face_is_repeated(name, count, seed, least):
    """The unknown object may be as probable; what decides is whether the face is there, and not any other touch."""
    step = prepare(tanteo.read_part(PARTS / f"{name}.step"))
    T, points, directions = scene(step, count, seed)
    local = SE3.apply(SE3.inverse(T), points)
    faces = step.part.triangle_face[step.surface.closest(local).triangles]
    k = next(k for k in range(count) if np.sum(faces == faces[k]) == 1)
    again = points[k] + SD * np.array([0.5, -0.5, 0.5])
    points[k] -= 4e-3 * directions[k]
    doubted = tanteo.locate(touches(points, directions), step.part)
    assert doubted.unknown_probability > least
    assert (doubted.status, doubted.findings[0].kind) == ("ambiguous", "outlier_or_variant")
    proposed = next_reading(doubted, [step.part], tanteo.probe_of(SD, contact=True))
    assert np.linalg.norm(proposed.finding.point - points[k]) < 0.2 * step.part.diagonal
    both = touches(np.r_[points, again[None]], np.r_[directions, directions[k : k + 1]])
    assert tanteo.locate(both, step.part).status == "recognized"


def test_a_repeated_reading_counts_beside_an_inner_corner(block):
    """Off its face the outlier is nearest to the other wall of the corner; its approach shows the face."""
    T, points, directions = scene(block, 24, 5)
    rng = np.random.default_rng(3)
    p, normals = surface_points(block, 4000, rng)
    moved = p + 3e-3 * normals
    near = block.surface.closest(moved)
    beside = (near.distances > 8e-4) & (near.distances < 2e-3)
    k = np.flatnonzero(beside)[0]
    place, into = SE3.apply(T, p[k]), -T[:3, :3] @ normals[k]
    off, again = place - 3e-3 * into, place + SD * rng.normal(size=3)
    doubted = tanteo.locate(touches(np.r_[points, off[None]], np.r_[directions, into[None]]), block.part)
    assert doubted.findings[0].kind == "outlier_or_variant"
    both = touches(np.r_[points, [off, again]], np.r_[directions, [into, into]])
    assert tanteo.locate(both, block.part).status == "recognized"


@pytest.mark.parametrize("at_border", [False, True])
def test_a_reading_on_a_neighbouring_face_refutes_nothing(at_border):
    """A touch beyond the end of the top shows a longer object; touches of the top or at its border do not deny it."""
    box = prepare(tanteo.read_part(PARTS / "block.step"))
    rng = np.random.default_rng(4)
    T, (low, high) = box_centred_pose(rng), box.part.box
    p, normals = surface_points(box, 60, rng)
    other_end = low + np.array([[0, 0.02, 0.01], [0, 0.06, 0.02], [0, 0.03, 0.04]])
    p = np.r_[p[np.abs(normals[:, 0]) < 0.5][:20], other_end]
    y = 0.5 * (low[1] + high[1])
    beyond = np.array([high[0] + 6e-3, y, high[2]])
    p = np.r_[p, [[high[0] - (0.0 if at_border else 4e-3), y + 2e-3, high[2]]], beyond[None]]
    points = SE3.apply(T, p) + SD * rng.normal(size=p.shape)
    doubted = tanteo.locate(touches(points, None), box.part)
    assert (doubted.status, doubted.findings[0].kind) == ("ambiguous", "outlier_or_variant")
    assert doubted.findings[0].readings == (str(len(p)),)
    end = SE3.apply(T, np.array([high[0], y, high[2] - 0.015])) + SD * rng.normal(size=3)
    assert tanteo.locate(touches(np.r_[points, end[None]], None), box.part).status == "recognized"


@pytest.mark.slow
def test_outliers_on_a_plane_that_the_part_touches_are_named(block):
    T, points, directions = scene(block, 20, 2)
    low = SE3.apply(T, block.part.vertices)
    down = np.array([0.0, 0.0, -1.0])
    table = np.c_[T[:2, 3] + 0.12 * np.array([[1, 1], [-1, 1], [0.5, -1], [1, -1]]), np.full(4, low[:, 2].min())]
    answer = tanteo.locate(touches(np.r_[points, table], np.r_[directions, np.tile(down, (4, 1))]), block.part)
    (found,) = [one for one in answer.findings if one.kind == "plane_of_outliers"]
    assert set(found.readings) == {"21", "22", "23", "24"}
    assert answer.status == "recognized"
    beside = table + np.c_[np.zeros((4, 2)), [0.02, 0, -0.03, 0.05]]
    answer = tanteo.locate(touches(np.r_[points, beside], np.r_[directions, np.tile(down, (4, 1))]), block.part)
    assert not any(one.kind == "plane_of_outliers" for one in answer.findings)


def test_bare_points_on_a_plane_may_be_a_face_of_a_variant(block):
    """Without approaches, readings beside a face may be on a larger face of another object."""
    T, points, _ = scene(block, 20, 2)
    low = SE3.apply(T, block.part.vertices)[:, 2].min()
    table = np.c_[T[:2, 3] + 0.12 * np.array([[1, 1], [-1, 1], [0.5, -1], [1, -1]]), np.full(4, low)]
    answer = tanteo.locate(touches(np.r_[points, table], None), block.part)
    assert "plane_of_outliers" in [one.kind for one in answer.findings]
    assert answer.status != "recognized"


def test_a_part_on_a_table_prefers_its_stable_poses(block):
    from tanteo.catalogue import known_stable_poses

    T = known_stable_poses(block.part)[0].T_table_part
    rng = np.random.default_rng(1)
    p, _ = surface_points(block, 7, rng)
    readings = touches(SE3.apply(T, p), None)
    sure = {}
    for leaning in (0.05, 1.0):
        table = Plane(np.zeros(3), np.array([0.0, 0.0, 1.0]), 5e-4, leaning)
        answer = tanteo.locate(readings, block.part, priors=Priors(pose=PosePrior(table=table)))
        ups = [h.T_world_part[:3, :3].T[:, 2] for h in answer.hypotheses]
        rests = [one.T_table_part[2, :3] for one in known_stable_poses(block.part)]
        stands = [max(up @ rest for rest in rests) > np.cos(0.03) for up in ups]
        sure[leaning] = sum(h.probability for h, ok in zip(answer.hypotheses, stands, strict=True) if ok)
    assert sure[0.05] > sure[1.0]


def test_touches_of_one_corner_leave_the_larger_part():
    parts = [tanteo.read_part(PARTS / f"{name}.step") for name in ("block", "step_12mm", "wedge")]
    block = prepare(parts[0])
    rng = np.random.default_rng(2)
    p, _ = surface_points(block, 4000, rng)
    near = p[np.linalg.norm(p - block.part.vertices[0], axis=1) < 0.025][:16]
    T = box_centred_pose(rng)
    readings = touches(SE3.apply(T, near) + SD * rng.normal(size=near.shape), None)
    answer = tanteo.identify(readings, parts)
    assert dict(answer.parts).get("block", 0.0) > 0.01
    total = sum(P for _, P in answer.parts) + answer.unknown_probability + answer.missed_probability
    assert total == pytest.approx(1, abs=1e-6)
