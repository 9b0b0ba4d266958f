"""Scenes of readings without correspondences, drawn from exactly the model that the surface search assumes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from tanteo import factors
from tanteo.factors import FreeRays, as_contact_points
from tanteo.features import SharedError
from tanteo.fitting.localization import pose_information
from tanteo.geometry import SE3, SO3
from tanteo.parts.faces import exact_faces
from tanteo.posterior import PreparedPart
from tanteo.posterior.answers import without_symmetric_rotation
from tanteo.sensors import Column, Readings, measure

REACH = 0.3
"""Free path before a beam's hit [m]."""


@dataclass(frozen=True)
class Sensing:
    """A way of sensing: standard deviation [m], whether the direction is known, and how many readings."""

    name: str
    sd: float
    directed: bool
    counts: tuple[int, ...]


SENSORS = (
    Sensing("touch 0.01 mm", 1e-5, False, (8, 10, 15, 25)),
    Sensing("laser 0.3 mm", 3e-4, True, (8, 10, 15, 25)),
    Sensing("time of flight 3 mm", 3e-3, True, (15, 25, 40)),
)


def surface_points(solid, n, rng):
    """Surface points even by area, and their outward normals, in the part frame.

    Args:
        solid: a target, for points of its exact surfaces, or a surface, for points of the mesh.
        n: how many.
        rng: of all draws.
    """
    surface, curved = _both(solid)
    corners = surface.vertices[surface.triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    chosen = rng.choice(len(corners), size=n, p=areas / areas.sum())
    u, v = np.sort(rng.uniform(size=(2, n, 1)), axis=0)
    a, b, c = corners[chosen].transpose(1, 0, 2)
    points, normals = u * a + (v - u) * b + (1 - v) * c, surface.normals[chosen]
    if curved is not None:
        off = np.zeros(n)
        curved.replace(points, chosen, off, normals)
        points = points - off[:, None] * normals
    return points, normals


def beams(solid, n, rng, tilt=0.6):
    """Surface points that straight paths from outside meet first, with the directions of those paths."""
    surface, curved = _both(solid)
    points, directions = np.zeros((0, 3)), np.zeros((0, 3))
    while len(points) < n:
        p, normal = surface_points(surface, 4 * n, rng)
        d = -normal + tilt * rng.normal(size=p.shape)
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        facing = np.sum(d * normal, axis=1) < -0.3
        hits = surface.cast(p - REACH * d, d)
        ok = facing & (np.abs(hits.distances - REACH) < 1e-7)
        p = _exact(curved, p, d, normal, hits.triangles)
        points, directions = np.concatenate([points, p[ok]]), np.concatenate([directions, d[ok]])
    return points[:n], directions[:n]


def _exact(curved, p, d, normals, triangles):
    """Return points of a mesh moved along directions onto the exact faces."""
    for _ in range(3 if curved is not None else 0):
        off, n_there = np.zeros(len(p)), np.array(normals)
        curved.replace(p, np.maximum(triangles, 0), off, n_there)
        p = p - (off / np.minimum(np.sum(d * n_there, axis=1), -0.1))[:, None] * d
    return p


def fan_hits(solid, angles, distance, n, rng):
    """Return poses of a fan of beams about a part, and the index and range of each beam that meets it within 60 deg.

    The beams leave the origin of a pose in its x-z plane at some angles from z.
    """
    surface, curved = _both(solid)
    own = np.stack([np.sin(angles), np.zeros(len(angles)), np.cos(angles)], axis=1)
    centre, Ts, beams, ranges = solid.part.centroid, np.zeros((0, 4, 4)), np.zeros(0, dtype=int), np.zeros(0)
    while len(Ts) < n:
        z = rng.normal(size=3)
        z /= np.linalg.norm(z)
        x = np.cross(z, rng.normal(size=3))
        x /= np.linalg.norm(x)
        T = SE3.from_parts(np.stack([x, np.cross(z, x), z], axis=1), centre - distance * z)
        d = own @ T[:3, :3].T
        hits = surface.cast(np.tile(T[:3, 3], (len(d), 1)), d)
        rows = np.flatnonzero(np.isfinite(hits.distances))
        p, normals = T[:3, 3] + hits.distances[rows, None] * d[rows], surface.normals[hits.triangles[rows]]
        steep = np.sum(d[rows] * normals, axis=1) < -0.5
        p = _exact(curved, p, d[rows], normals, hits.triangles[rows])[steep]
        rows = rows[steep]
        Ts = np.concatenate([Ts, np.tile(T, (len(rows), 1, 1))])
        beams, ranges = np.append(beams, rows), np.append(ranges, np.linalg.norm(p - T[:3, 3], axis=1))
    return Ts[:n], beams[:n], ranges[:n]


def _both(solid):
    if not isinstance(solid, PreparedPart):
        return solid, None
    return solid.surface, exact_faces(solid.part, solid.surface.normals)


def touches_of(
    points, sd, *, radii=0.0, directions=None, normals=None, normal_sd=np.pi, reach=0.0, shared_jacobian=None
):
    """World points as touches with isotropic noise of that standard deviation (a number, or one a point)."""
    made = factors.surface_points(
        np.array(points, dtype=float), sd, radii=radii, directions=directions, normals=normals, normal_sds=normal_sd,
        reach=reach, shared_jacobian=shared_jacobian,
    )  # fmt: skip
    return replace(made, ids=tuple(map(str, range(len(points)))))


def oriented(target, n, rng, sd=3e-4, tilt=0.05):
    """Touches with sensed normals of a part at a random pose, even by area, and that pose; sd [m], tilt [rad]."""
    T = box_centred_pose(rng)
    p, normals = surface_points(target, n, rng)
    points = SE3.apply(T, p) + sd * rng.normal(size=p.shape)
    tilted = (SO3.exp(tilt * rng.normal(size=p.shape)) @ (normals @ T[:3, :3].T)[..., None])[..., 0]
    return touches_of(points, sd, normals=tilted, normal_sd=tilt), T


def scene(solid, T, sensing, n, rng, *, outlier=0.0, radius=0.1, bias_sd=0.0, base_sd=0.0):
    """Touches of a part at a pose, the rows that are outliers, and the shared errors.

    Args:
        solid: the part, a target or the surface of a mesh.
        T: pose of the part in the world.
        sensing: how.
        n: readings.
        rng: of all draws.
        outlier: share of readings that are anywhere: in a ball about the part, or along their beam.
        radius: of the ball, half of the length along the beam [m].
        bias_sd: of an error along the beam that all readings share [m].
        base_sd: of the place of the robot's base, which moves all readings [m].
    """
    if sensing.directed:
        p, d = beams(solid, n, rng)
        directions = d @ T[:3, :3].T
    else:
        p, directions = surface_points(solid, n, rng)[0], None
    points = SE3.apply(T, p) + sensing.sd * rng.normal(size=(n, 3))
    shared_jacobian, shared = None, ()
    if bias_sd:
        points = points - bias_sd * rng.normal() * directions
        shared_jacobian = bias_sd * directions[..., None]
        shared = (SharedError("bias", np.array([[bias_sd**2]]), "bias of the sensor along the beam [m]"),)
    if base_sd:
        points = points - base_sd * rng.normal(size=3)
        shared_jacobian = np.broadcast_to(base_sd * np.eye(3), (n, 3, 3))
        shared = (SharedError("base", base_sd**2 * np.eye(3), "place of the robot's base [m]"),)
    rows = np.flatnonzero(rng.permutation(n) < round(outlier * n))
    k = len(rows)
    if directions is None:
        out = rng.normal(size=(k, 3))
        out *= radius * rng.uniform(size=(k, 1)) ** (1 / 3) / np.linalg.norm(out, axis=1, keepdims=True)
        points[rows] = SE3.apply(T, _both(solid)[0].vertices.mean(axis=0)) + out
    else:
        points[rows] += rng.uniform(-radius, radius, (k, 1)) * directions[rows]
    touches = touches_of(
        points,
        sensing.sd,
        directions=directions,
        reach=REACH if sensing.directed else 0,
        shared_jacobian=shared_jacobian,
    )
    return touches, rows, shared


def with_tip_off(target, T, z, n, rng, sd=5e-5, off=3e-3):
    """Touches square on; the tip is off by ``off * z`` in the frame of the hand ``(3,)`` [m]."""
    p, normals = surface_points(target, n, rng)
    along = -normals @ T[:3, :3].T
    x = np.cross(along, rng.normal(size=p.shape))
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    J = off * np.stack([x, np.cross(along, x), along], axis=-1)
    return touches_of(SE3.apply(T, p) - J @ z + sd * rng.normal(size=p.shape), sd, shared_jacobian=J)


def mounted(target, T, n, rng, sd=3e-4, off=2e-3, turned=0.0175):
    """Return beams of a sensor with a mounting error, one draw for all, from 50 to 250 mm away.

    Args:
        target: the part.
        T: its pose in the world.
        n: readings.
        rng: of all draws.
        sd: noise of a range [m].
        off: standard deviation of where the sensor sits, each axis [m].
        turned: standard deviation of the rotation of the mounting about each axis [rad].
    """
    mount = SE3.exp(np.repeat([off, turned], 3) * rng.normal(size=6))
    points, directions, shared_jacobian = [], [], []
    while len(points) < n:
        (p,), (d,) = beams(target, 1, rng, 0.3)
        side = np.cross(d, rng.normal(size=3))
        side /= np.linalg.norm(side)
        T_sensor = SE3.from_parts(np.stack([side, np.cross(d, side), d], axis=-1), p - rng.uniform(0.05, 0.25) * d)
        really = T_sensor @ mount
        distance = target.surface.cast(really[None, :3, 3], really[None, :3, 2]).distances[0]
        if distance < 0.3:
            at, R = np.array([0.0, 0.0, distance + sd * rng.normal()]), T[:3, :3] @ T_sensor[:3, :3]
            points.append(SE3.apply(T @ T_sensor, at))
            directions.append(R[:, 2])
            shared_jacobian.append(R @ np.concatenate([off * np.eye(3), -turned * SO3.hat(at)], axis=1))
    return touches_of(np.array(points), sd, directions=np.array(directions), shared_jacobian=np.array(shared_jacobian))


def thin_beams(target, T, n, rng, sd=3e-3):
    """Return ranges of beams without width and with a stated noise along them only, as the program makes touches of
    them."""
    p, d = beams(target, n, rng)
    directions, ranges = d @ T[:3, :3].T, REACH + sd * rng.normal(size=n)
    points = SE3.apply(T, p) + (ranges - REACH)[:, None] * directions
    readings = Readings.from_columns(points, directions=directions, ranges=ranges)
    return as_contact_points(measure(readings, sd=sd, beam_half_angle=0.0), reach=Column.from_rows(ranges))


def box_centred_pose(rng, spread=0.5):
    q = rng.normal(size=4)
    return SE3.from_parts(SO3.from_quaternion(q / np.linalg.norm(q)), rng.uniform(-spread, spread, 3))


def holds(target, maxima, one):
    """Return whether a maximum is among others, up to symmetry."""
    information = pose_information(one.information)[0]
    gaps = SE3.inverse(one.Ts[0]) @ (maxima.Ts[:, None] @ target.part.symmetry.Ts)
    xi = SE3.log(without_symmetric_rotation(target.part, gaps) if target.part.symmetry.continuous else gaps)
    return np.einsum("nsi,ij,nsj->ns", xi, information, xi).min(initial=np.inf) < 20


def nees(part, T, covariance, truth):
    """Squared Mahalanobis distance of the truth, the closest symmetric image, and its degrees of freedom."""
    gaps = SE3.inverse(T) @ (truth @ part.symmetry.Ts)
    dof = 6
    if part.symmetry.continuous:
        gaps, dof = without_symmetric_rotation(part, gaps), 3 if part.symmetry.spherical else 5
    xi = SE3.log(gaps)
    return float(np.einsum("si,ij,sj->s", xi, np.linalg.pinv(covariance, rcond=1e-12), xi).min()), dof


def off(part, T, truth):
    """Distance of the part's centre [m] and angle [rad] between two poses, up to symmetry."""
    gaps = SE3.inverse(truth) @ (T @ part.symmetry.Ts)
    if part.symmetry.continuous:
        gaps = without_symmetric_rotation(part, gaps)
    angles = np.linalg.norm(SE3.log(gaps)[:, 3:], axis=1)
    moved = np.linalg.norm(SE3.apply(gaps, part.centroid) - part.centroid, axis=1)
    k = int(np.argmin(angles + moved / part.diagonal))
    return float(moved[k]), float(angles[k])


def inside(value, dof, level=0.95):
    """Return whether a squared Mahalanobis distance is inside the region of a given probability."""
    return value <= chi2.ppf(level, dof)


def no_paths():
    return FreeRays.none()
