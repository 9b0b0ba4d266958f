"""Sensed features as labelled points, with their covariance; world, metres.

A plane is as good as a few of the points where it was felt, an edge as good as two points of it, with variances that
give the feature's own covariance; a circle is its centre with its axis, a cylinder two points of its axis, a sphere its
centre, a cone its apex with its axis. So features are measurements like any other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeAlias

import numpy as np

from tanteo.errors import InputError
from tanteo.features import (
    CIRCLE,
    CONE,
    CYLINDER,
    EDGE,
    PLANE,
    SPHERE,
    VERTEX,
    Feature,
    Sides,
    collect_shared,
    shared_root,
)
from tanteo.lie import SE3
from tanteo.measurements.plane_points import as_good, scatter
from tanteo.measurements.points import MADE, MADE_ANGLE, ContactPoints
from tanteo.sensors import CENTRE_OF, CENTRES
from tanteo.typing import Covariances, FloatArray, Transforms, Vectors


def as_labelled_points(features: Sequence[Sides], tolerance: float = 0.0) -> ContactPoints:
    """The points that say of the part what the features say; rows of one feature have its label as their id.

    Args:
        features: planes, edges, vertices, circles, cylinders, spheres and cones.
        tolerance: sd of the made surface against its CAD [m].

    Raises:
        InputError: another kind of feature; a plane of unknown side that was not sensed at points that spread.
    """
    views = [given if isinstance(given, tuple) else (given,) for given in features]
    errors, _, shared_jacobian = collect_shared([view[0] for view in views])
    root = shared_root(errors)
    names = _names([view[0] for view in views])
    rows = [_rows(view, name, gain @ root) for view, name, gain in zip(views, names, shared_jacobian, strict=True)]
    kinds, columns = [view[0].kind.name for view in views], rows or [_none(len(root))]
    counts = [len(block[0]) for block in rows]
    points, covs, sides, normals, sds, gained, circles, offsets = map(np.concatenate, zip(*columns, strict=True))
    kinds = np.repeat([CENTRE_OF.get(kind, kind) for kind in kinds], counts).tolist()
    surface = np.array([kind not in CENTRES for kind in kinds], dtype=bool)[:, None]
    covs, outward = covs + tolerance**2 * np.eye(3), (sides + normals) * surface  # only one of the two is given
    radii = np.repeat([view[0].tip_radius for view in views], counts) * outward.any(axis=1)
    return ContactPoints(
        tuple(np.repeat(names, counts).tolist()), points + radii[:, None] * outward, covs, radii + offsets,
        np.zeros(points.shape), normals, sds, np.zeros(len(points)), gained,
        np.sqrt(np.linalg.eigvalsh(covs)[:, -1]), tolerance,
        labels=tuple(np.repeat(names, counts).tolist()), kinds=tuple(kinds), sides=sides, circles=circles,
    )  # fmt: skip


class FeaturePoints(NamedTuple):
    """Points that say of the part what one feature says.

    Attributes:
        points: ``(n, 3)`` in the world [m].
        covs: ``(n, 3, 3)``.
        sides: outward normals where only the side is known, else zero ``(n, 3)``.
        normals: sensed outward normals, else zero ``(n, 3)``.
        normal_sds: of these, pi where there is none ``(n,)`` [rad].
        shared_jacobian: of the points by the whitened shared errors ``(n, 3, D)``.
        circles: of centres, radius [m], half angle of an apex [rad], or 0, its sd, and 1 for a hole, -1 for a boss
            ``(n, 3)``.
        offsets: of points of a cone's axis, how far they are from the apex, else zero ``(n,)`` [m].
    """

    points: Vectors
    covs: Covariances
    sides: Vectors
    normals: Vectors
    normal_sds: FloatArray
    shared_jacobian: FloatArray
    circles: FloatArray
    offsets: FloatArray


ToPoints: TypeAlias = Callable[[tuple[Feature, ...], str, FloatArray], FeaturePoints]
"""From a feature (two if its side is unknown), its name and its gain on the shared errors ``(size, D)``."""


def _none(D: int) -> FeaturePoints:
    none = np.zeros((0, 3))
    return FeaturePoints(none, np.zeros((0, 3, 3)), none, none, np.zeros(0), np.zeros((0, 3, D)), none, np.zeros(0))


def _names(features: Sequence[Feature]) -> list[str]:
    """Their labels, each once."""
    names = list[str]()
    for k, feature in enumerate(features, start=1):
        name = feature.label or f"feature {k}"
        names.append(f"{name} ({k})" if name in names else name)
    return names


def _rows(view: tuple[Feature, ...], name: str, gain: FloatArray) -> FeaturePoints:
    kind = view[0].kind.name
    if not np.linalg.eigvalsh(view[0].P).min() > 0:
        raise InputError(f"feature {name!r}, P: expected a positive variance in every direction, got zero.")
    if kind not in TO_POINTS:
        raise InputError(
            f"feature {name!r}: expected one of {', '.join(TO_POINTS)}, got a {kind}. Such features are not matched "
            "yet; give the points that were sensed on it."
        )
    return TO_POINTS[kind](view, name, gain)


def _plain(points: Vectors, covs: Covariances, shared_jacobian: FloatArray) -> FeaturePoints:
    none = np.zeros(points.shape)
    sds, zeros = np.full(len(points), np.pi), np.zeros(len(points))
    return FeaturePoints(points, covs, none, none, sds, shared_jacobian, none, zeros)


def _of_vertex(view: tuple[Feature, ...], name: str, gain: FloatArray) -> FeaturePoints:
    T, R = view[0].T_world_feature, view[0].T_world_feature[:3, :3]
    return _plain(T[None, :3, 3], (R @ view[0].P @ R.T)[None], (R @ gain)[None])


def _of_plane(view: tuple[Feature, ...], name: str, gain: FloatArray) -> FeaturePoints:
    """Points where the plane was felt that say what it says; or one with its normal, where no such points do."""
    feature, sided = view[0], len(view) == 1
    T, local = feature.T_world_feature, SE3.apply(SE3.inverse(feature.T_world_feature), feature.support)[:, :2]
    normal, levers = T[:3, 2], np.column_stack([np.ones(len(local)), local[:, 1], -local[:, 0]])
    rows, variances = as_good(levers, feature.P)
    if len(rows):
        heights = np.sqrt(variances) * scatter(levers[rows] / np.sqrt(variances)[:, None])
        points = SE3.apply(T, np.column_stack([local[rows], heights]))
        columns = _plain(points, variances[:, None, None] * np.eye(3), _along(normal, levers[rows] @ gain))
        return columns._replace(sides=np.tile(normal, (len(rows), 1)) * sided)
    if not sided:
        raise InputError(
            f"plane {name!r}: expected the points where it was sensed (support), spread as far as its tilts are known "
            "well, because its outward side is unknown. Give them, or the side."
        )
    x, y = local.mean(axis=0) if len(local) else np.zeros(2)
    lever = np.array([[1.0, y, -x]])
    variance = float((lever @ feature.P @ lever.T)[0, 0])
    tilt = float(np.sqrt(np.linalg.eigvalsh(feature.P[1:, 1:])[-1]))
    point = SE3.apply(T, np.array([[x, y, 0.0]]))
    return FeaturePoints(
        point,
        variance * np.eye(3)[None],
        0 * normal[None],
        normal[None],
        np.array([tilt]),
        _along(normal, lever @ gain),
        np.zeros((1, 3)),
        np.zeros(1),
    )


def _along(direction: Vectors, shared_jacobian: FloatArray) -> FloatArray:
    return direction[:, None] * shared_jacobian[:, None]


def _of_edge(view: tuple[Feature, ...], name: str, gain: FloatArray) -> FeaturePoints:
    """Two points of the edge, about where it is known best."""
    return _of_line(view[0], view[0].T_world_feature, gain)


def _of_sphere(view: tuple[Feature, ...], name: str, gain: FloatArray) -> FeaturePoints:
    """Its centre."""
    return _of_vertex(view, name, gain)._replace(circles=_size(view[0])[None])


def _of_centre(view: tuple[Feature, ...], name: str, gain: FloatArray) -> FeaturePoints:
    """The centre of a circle with its axis."""
    feature, T, R = view[0], view[0].T_world_feature, view[0].T_world_feature[:3, :3]
    tilt = float(np.sqrt(np.linalg.eigvalsh(feature.P[3:, 3:])[-1]))
    centre = _plain(T[None, :3, 3], (R @ feature.P[:3, :3] @ R.T)[None], (R @ gain[:3])[None])
    return centre._replace(normals=R[None, :, 2], normal_sds=np.array([tilt]), circles=_size(feature)[None])


def _of_cone(view: tuple[Feature, ...], name: str, gain: FloatArray) -> FeaturePoints:
    """A point of its axis, where errors of place and direction are independent, and how far that is from the apex."""
    feature, T = view[0], view[0].T_world_feature
    tilts = feature.P[3:, 3:]
    s = max(float((feature.P[1, 3] - feature.P[0, 4]) / np.trace(tilts)), 0.0)  # at s the place is x + s wy, y - s wx
    J = np.eye(5)
    J[0, 4], J[1, 3] = s, -s
    at = T @ SE3.from_parts(np.eye(3), np.array([0, 0, s]))
    there = replace(feature, T_world_feature=at, P=J @ feature.P @ J.T, size=None)
    return _of_centre((there,), name, J @ gain)._replace(offsets=np.array([s]), circles=_size(feature)[None])


def _of_cylinder(view: tuple[Feature, ...], name: str, gain: FloatArray) -> FeaturePoints:
    """Two points of its axis, about where it is known best; the first has its radius."""
    feature, T = view[0], np.array(view[0].T_world_feature)
    T[:3, :3] = np.roll(T[:3, :3], -(feature.kind.axis or 0), axis=1)  # the axis first
    return _of_line(feature, T, gain)._replace(circles=np.stack([_size(feature), np.zeros(3)]))


def _size(feature: Feature) -> FloatArray:
    """Radius or half angle, its standard deviation and the side of the material ``(3,)``; zero where it is unknown."""
    size = getattr(feature, "size", None)
    if size is None:
        return np.zeros(3)
    side = 0.0 if size.convex is None else (-1.0 if size.convex else 1.0)
    made = MADE_ANGLE if feature.kind is CONE else MADE
    return np.array([size.value, np.hypot(np.sqrt(size.variance), made), side])


def _of_line(feature: Feature, T: Transforms, gain: FloatArray) -> FeaturePoints:
    """Two points of a line along the x axis of a frame, about where it is known best."""
    turn = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, -1], [0, 0, 1, 0]])  # (y, z, wy, wz) of (y, z, wz, -wy)
    information = turn.T @ np.linalg.inv(feature.P) @ turn
    # y + x wz and z - x wy at places of mean m and mean square q say: n (1, m; m, q) (x) inverse covariance
    across = np.linalg.inv(information[:2, :2])
    m = float(np.trace(information[2:, :2] @ across)) / 2
    q = float(np.linalg.eigvals(information[2:, 2:] @ across).real.min())
    spread = np.sqrt(max(q - m**2, 0.0))
    if len(feature.support) > 1:
        along = SE3.apply(SE3.inverse(T), feature.support)[:, 0]
        spread = min(spread, float(np.abs(along - m).max()))
    x = m + spread * np.array([-1.0, 1.0])
    cov = np.zeros((3, 3))
    cov[1:, 1:] = 2 * across
    cov[0, 0] = np.trace(across)  # along it, where nothing was measured, as across
    world = T[:3, :3] @ cov @ T[:3, :3].T
    lever = np.array([[[0, 0, 0, 0], [1, 0, 0, s], [0, 1, -s, 0]] for s in x])
    return _plain(SE3.apply(T, np.column_stack([x, 0 * x, 0 * x])), np.tile(world, (2, 1, 1)), T[:3, :3] @ lever @ gain)


TO_POINTS: dict[str, ToPoints] = {
    PLANE.name: _of_plane, EDGE.name: _of_edge, VERTEX.name: _of_vertex,
    CIRCLE.name: _of_centre, CYLINDER.name: _of_cylinder, SPHERE.name: _of_sphere, CONE.name: _of_cone,
}  # fmt: skip
"""How features of each kind become points, by its name."""
