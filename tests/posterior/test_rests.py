"""Planes of a fixture against which a part rests: jaws, rails and V-blocks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import no_paths, surface_points, touches_of
from tanteo import _core
from tanteo.catalogue import known_stable_poses
from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.io.poses import parse_table
from tanteo.posterior import PosePrior, Priors, Problem, prepare
from tanteo.posterior import Table as Plane
from tanteo.posterior.part_search import start_search
from tanteo.posterior.proposals import PriorSamples

PARTS = Path(__file__).parents[2] / "examples" / "parts"
UP, LEFT, BACK = np.eye(3)[[2, 0, 1]]


def cylinder(n=64):
    turn = np.linspace(0, 2 * np.pi, n, endpoint=False)
    ring = np.column_stack([0.02 * np.cos(turn), 0.02 * np.sin(turn)])
    vertices = np.concatenate(
        [np.column_stack([ring, np.full(n, z)]) for z in (0.0, 0.09)] + [[[0, 0, 0.0]], [[0, 0, 0.09]]]
    )
    triangles = []
    for k in range(n):
        after = (k + 1) % n
        triangles += [(k, after, n + k), (after, n + after, n + k), (2 * n, after, k), (2 * n + 1, n + k, n + after)]
    return tanteo.part_from_mesh(vertices, triangles, unit="m", name="cylinder")


def mean_of_prior(part, planes, count, seed):
    """Return the integral of the prior of the pose and its standard error, by samples of attitudes and heights."""
    prepared, rng = prepare(part), np.random.default_rng(seed)
    priors = Priors(pose=PosePrior(table=planes[0], rests=planes[1:]), radius=0.3)
    problem = Problem(touches_of(np.zeros((0, 3)), 1e-4), no_paths(), priors)
    q = rng.normal(size=(count, 4))
    R = np.array(SO3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True)))
    N = np.array([plane.normal for plane in planes])
    heights = np.array([plane.sd for plane in planes]) * rng.normal(size=(count, len(planes)))
    low = np.stack([(np.einsum("nij,i->nj", R, n) @ part.vertices.T).min(axis=1) for n in N], axis=1)
    along = np.array([plane.point @ plane.normal for plane in planes])
    free = np.linalg.svd(N)[2][len(N) :]  # directions along all planes
    anywhere = rng.uniform(-0.3, 0.3, size=(count, len(free)))
    right = np.concatenate([along + heights - low, anywhere], axis=1)
    t = np.linalg.solve(np.concatenate([N, free]), right.T).T
    Ts = np.tile(np.eye(4), (count, 1, 1))
    Ts[:, :3, :3], Ts[:, :3, 3] = R, t
    core = problem.compiled(prepared)
    log_p = _core.log_densities(prepared.shape, core, Ts, np.zeros((count, 0))) + problem.log_pose_density(prepared)
    sds = np.array([plane.sd for plane in planes])
    log_q = -0.5 * np.sum((heights / sds) ** 2, axis=1) - np.sum(np.log(sds * np.sqrt(2 * np.pi)))
    log_q += np.log(abs(np.linalg.det(np.concatenate([N, free])))) - len(free) * np.log(0.6) - np.log(8 * np.pi**2)
    ratio = np.exp(log_p - log_q)
    return ratio.mean(), ratio.std() / np.sqrt(count)


@pytest.mark.quick_sets(3)
@pytest.mark.parametrize("make", [lambda: tanteo.read_part(PARTS / "bracket_left.step"), cylinder])
@pytest.mark.parametrize("normals", [(UP, LEFT), (UP, LEFT, BACK), (UP + LEFT, UP - LEFT), (UP, LEFT + 0.5 * UP)])
def test_the_prior_of_a_part_in_a_fixture_is_a_density(make, normals):
    """Its integral over all poses is one, whichever faces of the part can be flush with two planes at once."""
    part = make()
    planes = tuple(Plane(0.05 * n, n, 0.025 * part.diagonal) for n in normals)
    mean, se = mean_of_prior(part, planes, 100_000, 7)
    assert abs(mean - 1) < 4 * se
    assert se < 0.08


def test_planes_that_fix_no_position_together_are_refused():
    opposite = Plane(np.zeros(3), LEFT, 1e-4), Plane(np.array([0.1, 0, 0]), -LEFT, 1e-4)
    with pytest.raises(InputError, match="Of two jaws give the fixed one"):
        PosePrior(rests=opposite)


def test_a_plane_is_read_with_its_normal():
    plane = parse_table("120,0,0mm -1,0,0 +- 0.1mm")
    assert np.allclose(plane.point, [0.12, 0, 0])
    assert np.allclose(plane.normal, -LEFT)
    assert plane.sd == pytest.approx(1e-4)
    for text in ("120,0,0mm -1,0 +- 0.1mm", "120,0,0mm -1,0,0", "120,0mm -1,0,0 +- 0.1mm", "1,0,0mm 1,0,0 +- 0mm"):
        with pytest.raises(InputError, match="rests"):
            parse_table(text, "rests")


@pytest.mark.parametrize("seed", [5, 6])
def test_poses_on_two_planes_of_a_fixture_are_proposed(seed):
    """The bracket rests on the edges of both legs on one face of a V-block, and on its side on the other."""
    prepared, rng = prepare(tanteo.read_part(PARTS / "bracket_left.step")), np.random.default_rng(seed)
    part, (one, other) = prepared.part, np.array([[1, 0, 1], [-1, 0, 1]]) / np.sqrt(2)
    ups = np.array([pose.T_table_part[2, :3] for pose in known_stable_poses(part)])
    on_edges = ups[np.argmin(np.abs(ups @ part.planes.normals.T).max(axis=1) + np.abs(ups[:, 1]))]
    frames = [np.stack([a, b, np.cross(a, b)], axis=1) for a, b in ((one, other), (on_edges, BACK))]
    R = frames[0] @ frames[1].T
    N = np.array([one, other, BACK])
    t = np.linalg.solve(N, -(N @ R @ part.vertices.T).min(axis=1))
    world = SE3.apply(SE3.from_parts(R, t), surface_points(prepared, 200, rng)[0])
    points = world[(N @ world.T > 2e-3).all(axis=0)][:5] + 1e-4 * rng.normal(size=(5, 3))
    priors = Priors(pose=PosePrior(rests=[Plane(np.zeros(3), n, 2e-4) for n in N]), radius=part.radius)
    search = start_search(Problem(touches_of(points, 1e-4), no_paths(), priors), prepared, rng)
    search.propose(PriorSamples())
    np.testing.assert_allclose(search.peaks.Ts[0, :3, 3], t, atol=3e-3)
