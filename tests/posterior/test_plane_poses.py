"""Poses from three labelled planes: the true one is among them, on whichever side the planes are seen from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from altered import altered
from bare_scenes import no_paths, touches_of
from scenes import random_pose
from tanteo.geometry import SE3
from tanteo.posterior import DEFAULTS, Problem, identify_points, sized
from tanteo.posterior.part_search import leader_of, start_search
from tanteo.posterior.proposals import InitialPoses, plane_votes, sensed_planes

SD = 3e-4


def on_faces(target, rng, faces):
    """Four points of a label each, well apart, on some planar faces, part frame, and outward normals."""
    part, points, labels, normals = target.part, [], [], []
    for k in faces:
        corners = part.vertices[part.triangles[part.triangle_face == part.planes.faces[k]]]
        areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        some = corners[rng.choice(len(corners), 40, p=areas / areas.sum())]
        p = np.einsum("nk,nki->ni", rng.dirichlet(np.ones(3), 40), some)
        chosen = [0]
        while len(chosen) < 4:
            chosen.append(int(np.argmax(np.linalg.norm(p[:, None] - p[chosen], axis=2).min(axis=1))))
        points.append(p[chosen])
        normals.append(np.tile(part.planes.normals[k], (4, 1)))
        labels += [f"face {k}"] * 4
    return np.concatenate(points), np.concatenate(normals), tuple(labels)


def scene(target, seed, *, radius=0.0, directed=False, faces=None):
    rng = np.random.default_rng(seed)
    T = random_pose(rng)
    if faces is None:
        large = np.argsort(-target.part.planes.areas)[:8]
        N = target.part.planes.normals[large]
        faces = next(large[[0, j, k]] for j in range(1, 8) for k in range(j) if abs(np.linalg.det(N[[0, j, k]])) > 0.5)
    p, normals, labels = on_faces(target, rng, faces)
    world = SE3.apply(T, p + radius * normals) + SD * rng.normal(size=p.shape)
    touches = altered(touches_of(world, SD), labels=labels, radii=np.full(len(p), radius))
    if directed:
        touches = altered(touches, directions=-normals @ T[:3, :3].T)
    return T, touches


def planes_of(touches, target):
    problem = Problem(touches, no_paths(), sized(None, target.part.radius))
    return sensed_planes.sensed_planes(problem, touches)


def poses(touches, target):
    return plane_votes.plane_poses(planes_of(touches, target), target, DEFAULTS)


def nearest(target, T, Ts):
    """Return the box error of the nearest of some poses or of their symmetric images, from a pose [m]."""
    corners = target.part.box[[[0, 0, 0], [1, 1, 1]], [0, 1, 2]]
    images = (Ts[:, None] @ target.part.symmetry.Ts).reshape(-1, 4, 4)
    return np.linalg.norm(SE3.apply(images[:, None], corners) - SE3.apply(T, corners), axis=-1).max(axis=1).min()


@pytest.mark.parametrize("directed", [False, True])
@pytest.mark.parametrize("name", ["bracket_left", "housing", "wedge", "block", "hex_spacer"])
def test_the_true_pose_is_among_them(models_of_faces, name, directed):
    target = models_of_faces[name]
    for seed in range(5):
        T, touches = scene(target, seed, directed=directed)
        assert planes_of(touches, target).rows[:, 10].all() == directed
        assert nearest(target, T, poses(touches, target)) < 0.1 * target.part.diagonal


def test_a_ball_is_beside_the_faces(models_of_faces):
    target = models_of_faces["bracket_left"]
    T, touches = scene(target, 7, radius=4e-3)
    assert nearest(target, T, poses(touches, target)) < 0.03 * target.part.diagonal
    wrong = altered(touches, radii=np.zeros(len(touches)))
    right, off = (nearest(target, T, poses(t, target)) for t in (touches, wrong))
    assert off > right


def test_points_off_any_plane_have_no_vote(models_of_faces):
    """Two points, points in a line, points of a ball, a label of an edge; and planes that leave a motion free."""
    target, rng = models_of_faces["block"], np.random.default_rng(3)
    line = np.linspace(0, 0.05, 5)[:, None] * np.array([1.0, 0, 0])
    offsets = 0.02 * rng.normal(size=(8, 3))
    offsets /= np.linalg.norm(offsets, axis=1, keepdims=True) / 0.02
    for points, kind in ((line[:2], "point"), (line, "point"), (offsets, "point"), (rng.uniform(size=(4, 3)), "edge")):
        touches = replace(touches_of(points, SD), labels=("a",) * len(points), kinds=(kind,) * len(points))
        assert len(planes_of(touches, target).rows) == 0
    opposite = np.flatnonzero(np.abs(target.part.planes.normals @ target.part.planes.normals[0]) > 0.99)[:2]
    across = np.flatnonzero(np.abs(target.part.planes.normals @ target.part.planes.normals[0]) < 0.01)[:1]
    _, touches = scene(target, 4, faces=[*opposite, *across])
    assert len(planes_of(touches, target).rows) == 3
    assert len(poses(touches, target)) == 0


@pytest.mark.parametrize("scenes", [4, pytest.param(12, marks=pytest.mark.slow)])
def test_labels_inform_more_than_unlabelled_readings(models_of_faces, scenes):
    """Four points on each of three faces, among five parts: the truth is at least as probable with labels."""
    parts = list(models_of_faces.values())
    right, claimed, truth, unknown = np.zeros((4, 2))
    for seed in range(scenes):
        target = parts[seed % len(parts)]
        T, touches = scene(target, (9, seed))
        for k, given in enumerate((touches, replace(touches, labels=("",) * len(touches)))):
            answer = identify_points(given, no_paths(), parts)
            unknown[k] += answer.unknown_probability
            best = answer.hypotheses[0]
            true = [h for h in answer.hypotheses if h.part == target.part.name]
            true = [h for h in true if nearest(target, T, h.T_world_part[None]) < 5e-3]
            truth[k] += sum(h.probability for h in true)
            right[k] += best in true
            claimed[k] += best.probability
    assert truth[0] > truth[1] - 0.5
    assert unknown[0] / scenes < 0.1
    assert abs(claimed[0] - right[0]) < np.sqrt(scenes)  # twice the largest standard deviation of a binomial count


@pytest.fixture(scope="module")
def models_of_faces(parts):
    from tanteo.posterior import prepare

    return {name: prepare(parts[name]) for name in ("bracket_left", "housing", "wedge", "block", "hex_spacer")}


def test_a_mirrored_part_is_not_found_by_its_labels(parts):
    """Eight labelled faces of the right bracket, and the left one is the only candidate."""
    from tanteo.posterior import prepare

    left, right = prepare(parts["bracket_left"]), prepare(parts["bracket_right"])
    faces = np.argsort(-right.part.planes.areas)[:8]
    _, touches = scene(right, 11, faces=faces)
    assert identify_points(touches, no_paths(), [left]).status != "recognized"
    both = identify_points(touches, no_paths(), [left, right])
    assert (both.status, both.best.part) == ("recognized", "bracket_right")


@pytest.mark.parametrize("name", ["bracket_left", "wedge", "hex_spacer"])
def test_every_pose_puts_three_faces_where_the_planes_are(models_of_faces, name):
    """Not their mirror image, and none of three faces that fix nothing: for all errors of the angles."""
    target = models_of_faces[name]
    for seed in range(3):
        _, touches = scene(target, (12, seed), directed=True)
        normals = planes_of(touches, target).rows[:, :3]
        Ts = poses(touches, target)
        assert len(Ts)
        assert np.isfinite(Ts).all()
        rotated = np.einsum("kij,mj->kmi", Ts[:, :3, :3], target.part.planes.normals)
        cosines = np.einsum("kmi,ni->kmn", rotated, normals).max(axis=1)
        assert cosines.min() > np.cos(0.15)


def test_planes_are_tried_up_to_the_margin_of_the_best_part(models_of_faces):
    best = models_of_faces["bracket_left"]
    others = [part for name, part in models_of_faces.items() if name != "bracket_left"]
    T, touches = scene(best, 0, faces=np.argsort(-best.part.planes.areas)[:6])
    planes = planes_of(touches, best)
    limited = plane_votes.competing(planes, [best, *others], DEFAULTS)
    assert limited.limit < planes.hopeless
    assert nearest(best, T, plane_votes.plane_poses(limited, best, DEFAULTS)) < 0.1 * best.part.diagonal
    counts = [[len(plane_votes.plane_poses(one, part, DEFAULTS)) for part in others] for one in (planes, limited)]
    assert all(few <= many for many, few in zip(*counts, strict=True))
    assert sum(counts[1]) < sum(counts[0])


def test_poses_far_below_another_part_are_not_maximized(models_of_faces):
    best, other = (models_of_faces[name] for name in ("bracket_left", "hex_spacer"))
    T, touches = scene(best, 0)
    problem = Problem(touches, no_paths(), sized(None, best.part.radius))
    searches = [start_search(problem, part, np.random.default_rng(0)) for part in (best, other, other)]
    leader, free, limited = searches
    leader.add(InitialPoses.unproposed(T[None]))
    for search, known in ((free, None), (limited, leader_of([leader]))):
        for poses_of in (InitialPoses.unproposed, InitialPoses.exhaustive):
            search.add(poses_of(T[None]), leader=known)
    assert len(leader.peaks) == 1
    assert len(free.peaks) > 0
    assert len(limited.peaks) == 0
