"""Adapt programs that locate parts to the benchmark: tanteo and installed others.

Each adapter takes the candidates as meshes and returns a solver. A program for one part runs on every candidate, and
its own error ranks the results; such programs claim no probabilities.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from tanteo.bench.generated import surface_points
from tanteo.bench.sets import BenchScene, Candidate, Placement
from tanteo.errors import MissingExtraError
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import FloatArray, Transforms

CLOUD = 5_000
"""Number of surface points of a part in programs for point clouds; four times as many found no more poses."""

STARTS, JITTER = 500, 8e-3
"""Random initial poses of local registration, and their spread about coinciding centres [m]; a tenth of the poses is
four times as fast and finds fewer."""

_MM = 1e3


def tanteo(candidates: tuple[Candidate, ...]) -> Callable[[BenchScene], list[Placement]]:
    """Make a solver of tanteo; ``unknown`` and ``insufficient`` are no answers."""
    from tanteo.recognition import identify
    from tanteo.sensors import Readings

    parts = [one.part for one in candidates]

    def solve(scene: BenchScene) -> list[Placement]:
        n = len(scene.points)
        sds, normal_sds = np.full(n, scene.sd), None if scene.normals is None else np.full(n, scene.normal_sd)
        readings = Readings.from_columns(scene.points, sds=sds, normals=scene.normals, normal_sds=normal_sds)
        given = readings if scene.readings is None else scene.readings
        answer = identify(given, parts, rig=scene.rig, top=20, conventions=False)
        if answer.status in ("unknown", "insufficient"):
            return []
        return [Placement(h.part, h.T_world_part, h.covariance, h.probability) for h in answer.hypotheses]

    first = parts[0].vertices[:: max(len(parts[0].vertices) // 12, 1)]
    solve(BenchScene("", first, 1e-4 * parts[0].diagonal))  # prepared data are stored with the part
    return solve


def small_gicp(candidates: tuple[Candidate, ...]) -> Callable[[BenchScene], list[Placement]]:
    """Make a solver of point-to-plane registration (Koide 2024) from random starts, with its Hessian as covariance."""
    module = _installed("small_gicp")
    clouds = [_cloud(module, one) for one in candidates]

    def solve(scene: BenchScene) -> list[Placement]:
        rng = np.random.default_rng(0)
        points = _MM * scene.points
        q = rng.normal(size=(STARTS, 4))
        R = SO3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True))
        ends: list[tuple[float, Placement]] = []
        for one, (centre, cloud, tree) in zip(candidates, clouds, strict=True):
            t = centre - R @ points.mean(axis=0) + _MM * JITTER * rng.normal(size=(STARTS, 3))
            ends += _aligned(module, one, cloud, tree, points, SE3.from_parts(R, t), scene.sd)
        return [placement for _, placement in sorted(ends, key=lambda end: end[0])]

    return solve


def opencv(candidates: tuple[Candidate, ...]) -> Callable[[BenchScene], list[Placement]]:
    """OpenCV's surface matching by point pairs (Drost and others 2010), refined by small_gicp; needs normals."""
    cv2, module = _installed("cv2", "opencv-contrib-python-headless"), _installed("small_gicp")
    if not hasattr(cv2, "ppf_match_3d"):
        raise MissingExtraError(
            "opencv: expected surface matching, got none. Run pip install opencv-contrib-python-headless."
        )
    cv2.setNumThreads(1)
    detectors = []
    for one in candidates:
        points, normals = surface_points(one, CLOUD, np.random.default_rng(1))
        detector = cv2.ppf_match_3d.PPF3DDetector(0.08, 0.05, 30)  # finer sampling takes minutes to train
        detector.trainModel(np.hstack([_MM * points, normals]).astype(np.float32))
        detectors.append(detector)
    clouds = [_cloud(module, one) for one in candidates]

    def solve(scene: BenchScene) -> list[Placement]:
        if scene.normals is None:
            raise ValueError("needs normals")
        points, ends = _MM * scene.points, list[tuple[float, Placement]]()
        for one, detector, (_, cloud, tree) in zip(candidates, detectors, clouds, strict=True):
            found = detector.match(np.hstack([points, scene.normals]).astype(np.float32), 1.0, 0.03)
            Ts = SE3.inverse(np.array([result.pose for result in found], dtype=float).reshape(-1, 4, 4))
            ends += _aligned(module, one, cloud, tree, points, Ts, scene.sd)
        return [placement for _, placement in sorted(ends, key=lambda end: end[0])]

    return solve


def open3d(candidates: tuple[Candidate, ...]) -> Callable[[BenchScene], list[Placement]]:
    """Make a solver of Open3D's point-to-plane registration (Zhou et al. 2018) from a hundred random starts."""
    module = _installed("open3d")
    clouds = []
    for one in candidates:
        points, normals = surface_points(one, CLOUD, np.random.default_rng(0))
        cloud = module.geometry.PointCloud(module.utility.Vector3dVector(points))
        cloud.normals = module.utility.Vector3dVector(normals)
        clouds.append((points.mean(axis=0), cloud))
    estimate = module.pipelines.registration.TransformationEstimationPointToPlane()

    def solve(scene: BenchScene) -> list[Placement]:
        rng, ends = np.random.default_rng(0), []
        source = module.geometry.PointCloud(module.utility.Vector3dVector(scene.points))
        q = rng.normal(size=(STARTS // 5, 4))
        for one, (centre, cloud) in zip(candidates, clouds, strict=True):
            for R in SO3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True)):
                T = SE3.from_parts(R, centre - R @ scene.points.mean(axis=0) + JITTER * rng.normal(size=3))
                end = module.pipelines.registration.registration_icp(source, cloud, 1.0, T, estimate)
                ends.append((end.inlier_rmse, Placement(one.name, SE3.inverse(np.array(end.transformation)))))
        return [placement for _, placement in sorted(ends, key=lambda end: end[0])]

    return solve


def trimesh(candidates: tuple[Candidate, ...]) -> Callable[[BenchScene], list[Placement]]:
    """Make a solver of ``trimesh.registration.mesh_other``."""
    module = _installed("trimesh")
    _installed("rtree")
    meshes = [module.Trimesh(one.vertices, one.triangles, process=False) for one in candidates]

    def solve(scene: BenchScene) -> list[Placement]:
        ends = []
        for one, mesh in zip(candidates, meshes, strict=True):
            T, error = module.registration.mesh_other(mesh, scene.points, reflection=False, seed=0)
            ends.append((error, Placement(one.name, T)))
        return [placement for _, placement in sorted(ends, key=lambda end: end[0])]

    return solve


def _installed(name: str, package: str = "") -> Any:
    try:
        return __import__(name)
    except ImportError as error:
        raise MissingExtraError(
            f"{name}: expected it to be installed, got {error}. Run pip install {package or name}."
        ) from error


def _cloud(module: Any, one: Candidate) -> tuple[FloatArray, Any, Any]:
    points = _MM * surface_points(one, CLOUD, np.random.default_rng(0))[0]
    return points.mean(axis=0), *module.preprocess_points(points, downsampling_resolution=0.5, num_neighbors=10)


def _aligned(
    module: Any, one: Candidate, cloud: Any, tree: Any, points: FloatArray, starts: Transforms, sd: float
) -> Sequence[tuple[float, Placement]]:
    """Return the results of small_gicp from all starts with their errors; its frames are in millimetres."""
    source, out = module.PointCloud(points), []
    for T in starts:
        end = module.align(
            cloud, source, tree, T, registration_type="PLANE_ICP", max_correspondence_distance=1e3, max_iterations=30
        )
        if end.num_inliers == len(points):
            T_part_world = np.array(end.T_target_source)
            T_part_world[:3, 3] /= _MM
            placement = Placement(one.name, SE3.inverse(T_part_world), _covariance(T_part_world, end.H, sd))
            out.append((float(end.error), placement))
    return out


def _covariance(T_part_world: Transforms, H: FloatArray, sd: float) -> FloatArray | None:
    """Return the covariance of a pose from a Hessian over rotation and shift [mm] of its inverse, or None."""
    scale = np.r_[np.full(3, _MM), np.ones(3)]
    information = np.roll(H, (3, 3), axis=(0, 1)) * np.outer(scale, scale) / (_MM * sd) ** 2
    if np.linalg.matrix_rank(information, hermitian=True) < 6:
        return None
    Ad = SE3.adjoint(T_part_world)
    return np.asarray(Ad @ np.linalg.inv(information) @ Ad.T)
