"""Measurements of a report, and their residuals for a part at the pose of a hypothesis.

A reading has one or more rows ``r = d' (q - c)``: its point ``q`` in the part frame minus the nearest point ``c`` of
the feature that it hit, along unit directions ``d``. A face has one row, an edge two, a corner three; a sensed normal
adds two tilts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.features import shared_root
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, IntArray, Vectors
from tanteo.parts import Part, Surface, named_feature, signed_distance
from tanteo.parts.faces import exact_faces
from tanteo.planning import Sensing
from tanteo.posterior import Hypothesis, PosePrior
from tanteo.sensors import Column, PointMeasurements, Readings, unstated_sd
from tanteo.sensors.error_states import made_surface


@dataclass(frozen=True, slots=True, eq=False)
class Sensed:
    """Readings of a report, world frame.

    Attributes:
        source: name of the readings' file.
        measured: points with covariance and shared errors, and free-space rays.
        repeatability: covariance of ``measured.covs`` that comes from the robot ``(n, 3, 3)`` [m^2].
        reach: length of the beam or motion before each point ``(n,)`` [m].
        tolerance: standard deviation of the real surface within a face [m]; offsets of faces are shared errors.
        prior: prior of the pose; None without one.
    """

    source: str
    measured: PointMeasurements
    repeatability: Covariances
    reach: Column
    tolerance: float = 0.0
    prior: PosePrior | None = None


def gather(readings: Readings, sensing: Sensing | None = None, prior: PosePrior | None = None) -> Sensed:
    """Convert readings as :func:`tanteo.identify` does, with the robot's part of the covariance separated.

    Args:
        readings: readings of the devices.
        sensing: noise model; None for the noise that the readings state.
        prior: prior of the pose; None without one.

    Raises:
        InputError: noise model and readings contradict each other.
        ReadingsError: a range is outside the limits of its device.
    """
    sensing = Sensing() if sensing is None else sensing
    unstated = unstated_sd(readings, sensor=sensing.sensor, sd=sensing.sd, rig=sensing.rig)
    sensing = sensing if unstated is None else replace(sensing, sd=unstated)
    measured = sensing.measured(readings)
    alone = measured if sensing.robot is None else replace(sensing, robot=None).measured(readings)
    reach = readings.ranges.take(measured.rows)
    own_sd = made_surface(sensing.tolerance)[1]
    return Sensed(readings.source, measured, measured.covs - alone.covs, reach, own_sd, prior)


@dataclass(frozen=True, slots=True, eq=False)
class Contacts:
    """Residuals of ``n`` readings on a part at a pose, with ``m`` rows.

    Attributes:
        faces: name of the feature that each reading hit ``(n,)``.
        used: flags of the readings that the hypothesis explains ``(n,)``.
        distances: distances from the surface, positive outside, at the most probable shared errors ``(n,)`` [m].
        sds: standard deviations of the distances by the noise of the readings ``(n,)`` [m].
        feet: nearest points of the nearest features, world frame ``(n, 3)`` [m].
        reading: index of the reading of each row ``(m,)``.
        rows: Jacobian of the rows over the pose, right perturbation ``(m, 6)``.
        noise: variance of each row from the sensor ``(m,)``.
        repeatability: variance of each row from the robot's repeatability ``(m,)``.
        shared_jacobian: Jacobian over each shared error ``(m, d)``.
        is_distance: flags of the rows that are distances and not tilts ``(m,)``.
    """

    faces: tuple[str, ...]
    used: BoolArray
    distances: FloatArray
    sds: FloatArray
    feet: Vectors
    reading: IntArray
    rows: FloatArray
    noise: FloatArray
    repeatability: FloatArray
    shared_jacobian: tuple[FloatArray, ...]
    is_distance: BoolArray


def find_contacts(sensed: Sensed, part: Part, hypothesis: Hypothesis) -> Contacts:
    """Return the residuals of the readings for a hypothesis.

    Args:
        sensed: readings of the answer.
        part: part of the hypothesis.
        hypothesis: hypothesis with its pose, pairings and outliers.
    """
    measured, T = sensed.measured, hypothesis.T_world_part
    R, q = T[:3, :3], SE3.apply(SE3.inverse(T), measured.points)
    paired = dict(hypothesis.pairings)
    used = np.array([i in paired for i in measured.ids], dtype=bool)
    faces, feet, axes = _targets(part, q, [paired.get(i, "") for i in measured.ids])
    reading, slot = np.nonzero(~np.isnan(axes[:, :, 0]))
    d = axes[reading, slot]
    radii = np.where(slot == 0, measured.radii[reading], 0.0)
    off = np.sum(d * (q - feet)[reading], axis=1) - radii
    in_world = d @ R.T
    noise = _along(in_world, (measured.covs - sensed.repeatability)[reading])
    repeatability = _along(in_world, sensed.repeatability[reading])
    shared_jacobian = [np.einsum("mi,mij->mj", in_world, J[reading]) for J in measured.jacobians]
    spread = noise + repeatability + sensed.tolerance**2
    off = off - _shared_shift(off, spread, shared_jacobian, sensed, used[reading])
    count = np.bincount(reading, minlength=len(q))
    size = np.sqrt(np.bincount(reading, off**2, minlength=len(q)))
    for name, distance in zip(hypothesis.outliers, hypothesis.outlier_distances, strict=False):
        size[[i == name for i in measured.ids]] = np.abs(distance)  # outliers have the distance of the answer
    sign = np.where((count == 1) & (np.bincount(reading, off, minlength=len(q)) < 0), -1.0, 1.0)
    rows = np.concatenate([d, np.cross(q[reading], d)], axis=1)
    tilts = _tilt_rows(sensed, R)
    return Contacts(
        faces=tuple(faces),
        used=used,
        distances=sign * size,
        sds=np.sqrt(np.bincount(reading, spread, minlength=len(q)) / np.maximum(count, 1)),
        feet=SE3.apply(T, feet),
        reading=np.concatenate([reading, tilts[0]]),
        rows=np.concatenate([rows, tilts[1]]),
        noise=np.concatenate([noise, tilts[2]]),
        repeatability=np.concatenate([repeatability, np.zeros(len(tilts[0]))]),
        shared_jacobian=tuple(np.concatenate([g, np.zeros((len(tilts[0]), g.shape[1]))]) for g in shared_jacobian),
        is_distance=np.arange(len(reading) + len(tilts[0])) < len(reading),
    )


def _targets(part: Part, q: Vectors, names: list[str]) -> tuple[list[str], Vectors, FloatArray]:
    """Return the feature that each reading hit, its nearest point, and directions of its rows ``(n, 3, 3)``, or NaN."""
    surface = Surface(part.vertices, part.triangles)
    distances, away = signed_distance(surface, q)
    triangles = surface.closest(q).triangles if len(q) else np.zeros(0, dtype=np.int64)
    if (curved := exact_faces(part, surface.normals)) is not None:
        curved.replace(q, triangles, distances, away)
    nearest = part.triangle_face[triangles]
    feet, axes = q - distances[:, None] * away, np.full((len(q), 3, 3), np.nan)
    axes[:, 0] = away
    faces = [name or part.faces[k].name for name, k in zip(names, nearest, strict=True)]
    for i, name in enumerate(names):
        feature = named_feature(part, name)
        if feature is not None and (found := feature.nearest(q[i])) is not None:
            feet[i], axes[i, : len(found[1])] = found
    return faces, feet, axes


def _along(d: Vectors, covs: FloatArray) -> FloatArray:
    """Return variances along directions ``(m,)``."""
    return np.einsum("mi,mij,mj->m", d, covs, d)


def _shared_shift(
    off: FloatArray, spread: FloatArray, shared_jacobian: list[FloatArray], sensed: Sensed, used: BoolArray
) -> FloatArray:
    """Return the effect of the most probable shared errors on each row ``(m,)``; 0 without shared errors."""
    if not shared_jacobian or not used.any():
        return np.zeros(len(off))
    L = np.concatenate(shared_jacobian, axis=1) @ shared_root(sensed.measured.shared)
    weighted = L[used] / spread[used, None]
    z = np.linalg.solve(np.eye(L.shape[1]) + weighted.T @ L[used], weighted.T @ off[used])
    return np.asarray(L @ z)


def _tilt_rows(sensed: Sensed, R_world_part: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the rows of sensed normals, two rotations each: index of the reading, derivative and variance."""
    known = np.flatnonzero(~np.isnan(sensed.measured.normal_sds) & ~np.isnan(sensed.measured.normals[:, 0]))
    if not len(known):
        return known, np.zeros((0, 6)), np.zeros(0)
    n = sensed.measured.normals[known] @ R_world_part
    rows = np.zeros((2 * len(known), 6))
    rows[:, 3:] = np.concatenate(np.moveaxis(SO3.frame_from_axis(n, 2)[..., :2], -1, 0))
    return np.tile(known, 2), rows, np.tile(sensed.measured.normal_sds[known] ** 2, 2)
