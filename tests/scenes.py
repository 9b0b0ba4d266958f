"""Scenes for the tests: sensed features of a part at a pose, drawn from the model that the estimators assume."""

from __future__ import annotations

import numpy as np

from tanteo.features import Feature
from tanteo.features.kinds import EDGE, PLANE, VERTEX
from tanteo.geometry import SE3, SO3


def random_pose(rng, spread=0.3):
    q = rng.normal(size=4)
    return SE3.from_parts(SO3.from_quaternion(q), rng.uniform(-spread, spread, 3))


def points_on_plane(part, plane, n, rng):
    """Uniform surface points of one planar face, in the part frame."""
    triangles = part.vertices[part.triangles[part.triangle_face == part.planes.faces[plane]]]
    areas = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    chosen = triangles[rng.choice(len(triangles), size=n, p=areas / areas.sum())]
    u, v = rng.uniform(size=(2, n, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    return chosen[:, 0] + u * (chosen[:, 1] - chosen[:, 0]) + v * (chosen[:, 2] - chosen[:, 0])


def plane_feature(points, normal, sd, rng, label=""):
    """Return a plane with the fit covariance of world points; the frame has an error drawn from it."""
    centre = points.mean(axis=0)
    R = SO3.frame_from_axis(normal, 2)
    local = (points - centre) @ R
    h = np.column_stack([-np.ones(len(points)), -local[:, 1], local[:, 0]])
    P = np.linalg.inv(h.T @ h / sd**2)
    T = SE3.from_parts(R, centre) @ SE3.exp(PLANE.B.T @ np.linalg.cholesky(P) @ rng.normal(size=3))
    ids = tuple(f"{label}.{i}" for i in range(len(points)))
    return Feature(PLANE, T, P, label=label, support=points + sd * rng.normal(size=points.shape), readings=ids)


def sensed_planes(part, T_world_part, planes, sd, rng, n_points=5):
    out = []
    for k, plane in enumerate(planes):
        while True:  # three collinear points are no plane
            points = SE3.apply(T_world_part, points_on_plane(part, plane, n_points, rng))
            if np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1] > 8 * sd:
                break
        out.append(plane_feature(points, T_world_part[:3, :3] @ part.planes.normals[plane], sd, rng, f"s{k}"))
    return out


def sensed_edge(part, T_world_part, edge, sd, rng, label=""):
    length = part.edges.lengths[edge]
    cov = np.array([sd**2 / 5, sd**2 / 5, sd**2 / (length**2 / 2), sd**2 / (length**2 / 2)])
    T = T_world_part @ part.edges.Ts_part_feature[edge] @ SE3.exp(EDGE.B.T @ (np.sqrt(cov) * rng.normal(size=4)))
    T = T @ EDGE.symmetries[rng.integers(2)]
    s = np.linspace(-0.4, 0.4, 5)[:, None] * length
    return Feature(EDGE, T, np.diag(cov), label=label, support=T[:3, 3] + s * T[:3, 0])


def sensed_vertex(part, T_world_part, corner, sd, rng, label=""):
    T = np.eye(4)
    T[:3, 3] = SE3.apply(T_world_part, part.corners.points[corner]) + sd * rng.normal(size=3)
    return Feature(VERTEX, T, sd**2 * np.eye(3), label=label)


def random_planes(part, n, rng, least_gyration=1e-3):
    """Distinct planar faces, by area, none thinner than a probe can feel."""
    usable = np.flatnonzero(part.planes.gyration[:, 1] > least_gyration)
    w = part.planes.areas[usable]
    return rng.choice(usable, size=min(n, len(usable)), replace=False, p=w / w.sum())


def surface_point(part, rng):
    """Return a point of the planar surface, uniform by area, and its face."""
    plane = rng.choice(len(part.planes), p=part.planes.areas / part.planes.areas.sum())
    return points_on_plane(part, plane, 1, rng)[0], plane


def touch(point, normal, rng, label="", sd=2e-4, tilt=5e-3):
    """Return a point with its sensed normal, as a small plane."""
    P = np.diag([sd**2, tilt**2, tilt**2])
    T = SE3.from_parts(SO3.frame_from_axis(normal, 2), point)
    T = T @ SE3.exp(PLANE.B.T @ (np.sqrt(np.diag(P)) * rng.normal(size=3)))
    return Feature(PLANE, T, P, label=label, support=T[None, :3, 3], readings=(label,))


def surface_touches(part, T_world_part, n, rng, **sds):
    """Touches that fall on the surface evenly, one face as often as chance has it."""
    out = []
    for k in range(n):
        point, plane = surface_point(part, rng)
        normal = T_world_part[:3, :3] @ part.planes.normals[plane]
        out.append(touch(SE3.apply(T_world_part, point), normal, rng, f"t{k}", **sds))
    return out


def surface_planes(part, T_world_part, n, rng, sd=2e-4):
    """Planes from five points each on faces drawn by area, one face as often as chance has it."""
    return [sensed_planes(part, T_world_part, [surface_point(part, rng)[1]], sd, rng)[0] for _ in range(n)]


def clutter_touch(radius, rng, label="", **sds):
    """Return a clutter plane in a ball about the world's origin: direction, offset and place as in ``Priors``."""
    normal = rng.normal(size=3)
    R = SO3.frame_from_axis(normal / np.linalg.norm(normal), 2)
    place, turn = radius * np.sqrt(rng.uniform()), rng.uniform(0, 2 * np.pi)
    local = np.array([place * np.cos(turn), place * np.sin(turn), rng.uniform(-radius, radius)])
    return touch(R @ local, R[:, 2], rng, label, **sds)
