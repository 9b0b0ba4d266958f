"""Programs that place a part's surface on readings, behind one call: ours and the peers of ``bench_surface_search``.

Each maker takes the part and returns a solver; what it prepares is not timed. A solver gets a scene and a generator for
its own samples and returns poses, best first. A peer that is not installed raises ``ImportError`` when it is made.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from bare_scenes import surface_points, touches_of
from tanteo.answers import Priors
from tanteo.inference import Problem, identify_points, posterior_about, prepare
from tanteo.lie import SE3, SO3
from tanteo.measurements import ContactPoints, FreeRays
from tanteo.parts import Part
from tanteo.shapes import Surface

MM = 1e3
CLOUD = 5_000
"""Surface points that stand for the part in programs for point clouds; four times as many found no more poses."""

JITTER = 8.0
"""Spread of the random starts about "centre on centre" [mm]; without it small_gicp found fewer poses."""

TOP = 100
"""Poses that ours may report."""


@dataclass(frozen=True)
class Scene:
    """Readings of the part at a pose, in metres and radians, and what is known of their noise."""

    T_world_part: np.ndarray
    points: np.ndarray
    normals: np.ndarray | None
    sd: float
    normal_sd: float


@dataclass(frozen=True)
class Answer:
    """Poses of the part in the world, best first; covariance of the best, over its right perturbation."""

    Ts: np.ndarray
    covariance: np.ndarray | None = None
    sure: bool | None = None


Solver = Callable[[Scene, np.random.Generator], Answer]


def tanteo(part: Part, path: Path) -> Solver:
    target = prepare(part)
    _ = target.shape

    def solve(scene: Scene, rng: np.random.Generator) -> Answer:
        found = identify_points(_touches(scene), FreeRays.none(), [target], top=TOP)
        Ts = np.array([h.T_world_part for h in found.hypotheses]).reshape(-1, 4, 4)
        covariance = found.hypotheses[0].covariance if found.hypotheses else None
        return Answer(Ts, covariance, found.status == "recognized")

    return solve


def told(part: Part, path: Path) -> Solver:
    """Ours where nothing is left to find: one maximization from the true pose, and what is said of where it ends."""
    target, priors = prepare(part), Priors(radius=part.radius)

    def solve(scene: Scene, rng: np.random.Generator) -> Answer:
        problem = Problem(_touches(scene), FreeRays.none(), priors)
        modes = posterior_about(problem, target, scene.T_world_part[None], rng).modes
        return Answer(np.array([mode.T_world_part for mode in modes]), modes[0].covariance)

    return solve


def _touches(scene: Scene) -> ContactPoints:
    return touches_of(scene.points, scene.sd, normals=scene.normals, normal_sd=scene.normal_sd)


def small_gicp(starts: int) -> Callable[[Part, Path], Solver]:
    def make(part: Part, path: Path) -> Solver:
        align = _point_to_plane(part)
        centre = MM * surface_points(Surface(part.vertices, part.triangles), CLOUD, np.random.default_rng(0))[0].mean(0)

        def solve(scene: Scene, rng: np.random.Generator) -> Answer:
            points = MM * scene.points
            q = rng.normal(size=(starts, 4))
            R = SO3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True))
            t = centre - R @ points.mean(axis=0) + JITTER * rng.normal(size=(starts, 3))
            return align(points, SE3.from_parts(R, t), scene.sd)

        return solve

    return make


def surface_matching(part: Part, path: Path) -> Solver:
    import cv2

    cv2.setNumThreads(1)
    align = _point_to_plane(part)
    points, normals = surface_points(Surface(part.vertices, part.triangles), CLOUD, np.random.default_rng(1))
    detector = cv2.ppf_match_3d.PPF3DDetector(*PPF)
    detector.trainModel(np.hstack([MM * points, normals]).astype(np.float32))

    def solve(scene: Scene, rng: np.random.Generator) -> Answer:
        points = MM * scene.points
        found = detector.match(np.hstack([points, scene.normals]).astype(np.float32), 1.0, SCENE_SAMPLING)
        Ts = SE3.inverse(np.array([result.pose for result in found], dtype=float).reshape(-1, 4, 4))
        return align(points, Ts, scene.sd)

    return solve


PPF = 0.08, 0.05, 30
"""Steps of OpenCV's detector: sampling and distance, relative to the part, and angles in a turn. Finer sampling takes
minutes to train."""

SCENE_SAMPLING = 0.03
"""Relative size of the cells in which OpenCV merges readings; the default."""


def trimesh_registration(part: Part, path: Path) -> Solver:
    import trimesh

    mesh = trimesh.Trimesh(part.vertices, part.triangles, process=False)

    def solve(scene: Scene, rng: np.random.Generator) -> Answer:
        seed = int(rng.integers(2**31))
        T, _ = trimesh.registration.mesh_other(mesh, scene.points, reflection=False, seed=seed)
        return Answer(T[None])

    return solve


def chsel(part: Part, path: Path) -> Solver:
    import chsel
    import pytorch_kinematics as kinematics
    import pytorch_volumetric as volumetric
    import torch

    torch.set_num_threads(1)
    factory = volumetric.MeshObjectFactory(str(path), scale=1 / MM)
    exact, box = volumetric.MeshSDF(factory), factory.bounding_box(padding=0.05)
    with TemporaryDirectory() as folder:
        kept = Path(folder) / "distances.pkl"
        sdf = volumetric.CachedSDF(part.name, 0.002, box, exact, device="cpu", cache_path=kept)
    centre = torch.tensor(part.centroid, dtype=torch.float)

    def solve(scene: Scene, rng: np.random.Generator) -> Answer:
        torch.manual_seed(int(rng.integers(2**31)))
        points = torch.tensor(scene.points, dtype=torch.float)
        surface = torch.full((len(points),), chsel.SemanticsClass.SURFACE.value, dtype=torch.long)
        starts = torch.eye(4).repeat(CHSEL_POSES, 1, 1)
        starts[:, :3, :3] = kinematics.random_rotations(CHSEL_POSES)
        starts[:, :3, 3] = centre - starts[:, :3, :3] @ points.mean(dim=0)
        found, _ = chsel.CHSEL(sdf, positions=points, semantics=surface).register(
            iterations=CHSEL_ROUNDS, initial_tsf=starts
        )
        Ts = chsel.solution_to_world_to_link_matrix(found).numpy().astype(float)
        return Answer(SE3.inverse(Ts[np.argsort(found.rmse.numpy())]))

    return solve


CHSEL_POSES, CHSEL_ROUNDS = 30, 1
"""Poses that CHSEL keeps, as in its examples, and rounds of its search."""


def _point_to_plane(part: Part) -> Callable[[np.ndarray, np.ndarray, float], Answer]:
    """small_gicp's point-to-plane ICP from every start, its own error ranks them; millimetres, part from world."""
    import small_gicp

    points, _ = surface_points(Surface(part.vertices, part.triangles), CLOUD, np.random.default_rng(0))
    cloud, tree = small_gicp.preprocess_points(MM * points, downsampling_resolution=0.5, num_neighbors=10)

    def align(points: np.ndarray, starts: np.ndarray, sd: float) -> Answer:
        source = small_gicp.PointCloud(points)
        ends = [
            small_gicp.align(
                cloud, source, tree, T, registration_type="PLANE_ICP", max_correspondence_distance=1e3,
                max_iterations=30,
            )
            for T in starts
        ]  # fmt: skip
        ends.sort(key=lambda end: end.error if end.num_inliers == len(points) else np.inf)
        Ts = np.array([end.T_target_source for end in ends]).reshape(-1, 4, 4)
        Ts[:, :3, 3] /= MM
        return Answer(SE3.inverse(Ts), None if not ends else _covariance(Ts[0], ends[0].H, sd))

    return align


def _covariance(T_part_world: np.ndarray, H: np.ndarray, sd: float) -> np.ndarray | None:
    """That of the pose of the part in the world, from a Hessian over turn and shift [mm] of the inverse pose."""
    scale = np.r_[np.full(3, MM), np.ones(3)]
    information = np.roll(H, (3, 3), axis=(0, 1)) * np.outer(scale, scale) / (MM * sd) ** 2
    if np.linalg.matrix_rank(information, hermitian=True) < 6:
        return None
    Ad = SE3.adjoint(T_part_world)
    return np.asarray(Ad @ np.linalg.inv(information) @ Ad.T)


@contextmanager
def silent() -> Iterator[None]:
    """Without what C++ libraries write to the error stream, one line a call."""
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
