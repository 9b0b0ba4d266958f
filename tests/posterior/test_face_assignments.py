"""Poses that put points on faces near a prior: none of the assignments of points to faces is missed."""

from __future__ import annotations

import sys
from pathlib import Path

import manifold3d
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import few_touches

from bare_scenes import beams, box_centred_pose, holds, nees, surface_points, touches_of
from tanteo import Readings, _core, locate, part_from_mesh, read_part
from tanteo.factors import FreeRays
from tanteo.geometry import SE3, SO3
from tanteo.posterior import PosePrior, Priors, Problem, infer, prepare
from tanteo.posterior.part_search import start_search

PARTS = Path(__file__).parents[2] / "examples" / "parts"
NAMES = "block", "bracket_left", "clamp", "flange", "housing", "step_12mm", "t_slot", "wedge"
SD, WIDTHS = 2e-5, np.repeat([3e-3, np.radians(2)], 3)
SEARCH = {"gate": 4.0, "cost": 40.0, "gap": 28.0, "noise": 1.5, "outliers": 0, "nodes": 1000, "keep": 40}


def scene(name, n, rng, *, directed=False, away=None):
    """Return a part, its pose, and touches of it with a prior of the pose: 3 mm and 2 degrees."""
    part, T = prepare(read_part(PARTS / f"{name}.step")), box_centred_pose(rng, 0.3)
    p, d = beams(part, n, rng, 0.3) if directed else (surface_points(part, n, rng)[0], None)
    x = SE3.apply(T, p) + SD * rng.normal(size=(n, 3))
    if away is not None:
        x[away] += [0, 0, 0.05]
    near = PosePrior(T_world_part=T @ SE3.exp(-WIDTHS * rng.normal(size=6)), covariance=np.diag(WIDTHS**2))
    touches = touches_of(x, SD, directions=None if d is None else d @ T[:3, :3].T)
    return (
        part,
        T,
        Problem(touches, FreeRays.none(), Priors(pose=near, radius=part.part.radius), typical_area=part.part.area),
    )


def searched(part, problem, **changed):
    """Return what the tree search finds near the prior."""
    known, about = problem.mixture(part), np.eye(6)
    about[:3, 3:] = SO3.hat(part.shape.centre)
    information = np.ascontiguousarray(about.T @ np.linalg.inv(known.covariances[0]) @ about)
    rows, mean = np.arange(len(problem.points), dtype=np.int32), np.ascontiguousarray(known.Ts[0])
    return _core.assigned_poses(part.shape, problem.compiled(part), rows, mean, information, **SEARCH | changed)


def maximum_at(part, problem, T):
    """Return the objective and the maximum to which the true pose leads."""
    objective = start_search(problem, part, np.random.default_rng(0)).objective
    return objective, objective.maximize(T[None], fine=True)


@pytest.mark.parametrize("directed", [False, True])
def test_the_true_assignment_is_among_those_tried(directed):
    """The turn is known to two degrees, so that points are up to 0.3 mm beside their linear prediction."""
    found = 0
    for seed in range(24):
        rng = np.random.default_rng((7, seed))
        part, T, problem = scene(NAMES[seed % len(NAMES)], 8, rng, directed=directed)
        Ts, scores, nodes, complete = searched(part, problem)
        objective, truth = maximum_at(part, problem, T)
        assert complete
        assert nodes <= 1000
        assert np.all(np.diff(scores) <= 0)
        peaks = objective.maximize(Ts, fine=True)
        found += holds(part, peaks, truth) or abs(peaks.logs.max() - truth.logs[0]) < 0.5  # or the same ridge
    assert found >= 23


def test_a_search_that_ends_early_is_not_complete():
    part, _, problem = scene("housing", 6, np.random.default_rng(1))
    assert searched(part, problem, nodes=3)[2:] == (3, False)
    assert searched(part, problem)[3]


def test_one_point_may_be_on_no_face():
    part, T, problem = scene("bracket_left", 8, np.random.default_rng(2), away=3)
    assert len(searched(part, problem)[0]) == 0
    Ts, *_, complete = searched(part, problem, outliers=1)
    objective, truth = maximum_at(part, problem, T)
    assert complete
    assert holds(part, objective.maximize(Ts, fine=True), truth)


@pytest.mark.parametrize("seed", [225, 228, 268, 297])
def test_a_pose_that_fits_as_well_is_a_mode(seed):
    """Its assignment of points to faces differs from that of the best maximum in up to three points."""
    rng = np.random.default_rng((55, seed))
    part, T, problem = scene(NAMES[seed % len(NAMES)], 6, rng)
    found = infer(problem, [part], 1, part.part.centroid, np.random.default_rng(seed))
    _, truth = maximum_at(part, problem, T)
    near = [mode for mode in found.modes if nees(part.part, mode.T_world_part, mode.covariance, T)[0] < 45]
    assert near or truth.evidence[0] < found.searches[0].peaks.evidence[0] - 4.5


@pytest.mark.parametrize("number", [7, 42])
def test_a_pose_under_a_tight_level_is_not_lost(number):
    """Height and tilt are known. All starts led to maxima with an outlier, and an unknown object was preferred."""
    parts = [read_part(PARTS / f"{name}.step") for name in few_touches.NAMES]
    part, T, readings, pose = few_touches.scene_of(parts, 5, 20261201, number, "level")
    answer = locate(readings, part, priors=Priors(pose=pose))
    unknown, _, wrong, share = few_touches.outcome(answer, part, T)
    assert not unknown
    assert not wrong
    assert share > 0.5


def ribbed(thickness):
    """Return a large plate with two thin ribs, as a mesh of flat faces."""
    body = manifold3d.Manifold.cube((0.5, 0.35, 0.03))
    body += manifold3d.Manifold.cube((0.3, thickness, 0.04)).translate((0.1, 0.15, 0.015))
    body += manifold3d.Manifold.cube((thickness, 0.35, 0.035)).translate((0.06, 0, 0.015))
    mesh = body.to_mesh()
    return part_from_mesh(mesh.vert_properties[:, :3].astype(float), mesh.tri_verts, unit="m", name="ribbed")


@pytest.mark.slow
def test_both_sides_of_a_thin_rib_are_modes():
    """Touches without a direction are on one side of the rib or on the other, of a plate 250 times as long."""
    part, found = ribbed(0.002), 0
    low, high = np.array([
        ((0.15, 0.02, 0.03), (0.45, 0.12, 0.03)), ((0.15, 0.02, 0.03), (0.45, 0.33, 0.03)),
        ((0.45, 0.05, 0.03), (0.495, 0.3, 0.03)), ((0.5, 0.05, 0.003), (0.5, 0.15, 0.027)),
        ((0.5, 0.05, 0.003), (0.5, 0.3, 0.027)), ((0.11, 0.15, 0.035), (0.2, 0.15, 0.053)),
        ((0.3, 0.15, 0.035), (0.39, 0.15, 0.053)), ((0.15, 0.05, 0), (0.45, 0.3, 0)), ((0.15, 0.05, 0), (0.45, 0.3, 0)),
    ]).swapaxes(0, 1)  # fmt: skip
    for seed in range(1, 5):
        rng = np.random.default_rng((5, seed))
        T = box_centred_pose(rng)
        points = SE3.apply(T, rng.uniform(low, high)) + rng.normal(0, 2e-5, (len(low), 3))
        near = [
            h.probability
            for h in locate(Readings.from_columns(points), part, sd=2e-5).hypotheses
            if np.linalg.norm(SE3.apply(h.T_world_part, part.centroid) - SE3.apply(T, part.centroid)) < 5e-4
        ]
        found += sum(near) > 0.01
    assert found >= 3
