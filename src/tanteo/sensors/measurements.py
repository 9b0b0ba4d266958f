"""Measurements made of readings: points in the world with covariance and shared errors; free-space rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.features import SharedError, shared_root, stacked_covariance
from tanteo.frames import check_covariances, freeze, frozen_array
from tanteo.sensors.noise import beam_cov
from tanteo.typing import Covariances, FloatArray, IntArray, Vectors


@dataclass(frozen=True, slots=True, eq=False)
class FreeBeams:
    """Beams that met nothing: the space along them is empty. World frame, metres.

    With the shared errors ``c_k`` of the measurements, the true origin ``i`` is ``origins[i] + sum_k jacobians[k][i] @
    c_k``, and the true direction ``directions[i] + sum_k turns[k][i] @ c_k``.

    Attributes:
        ids: Names of the readings.
        origins: Where the beams start, ``(m, 3)``.
        directions: Unit directions, ``(m, 3)``.
        lengths: How far they were free, ``(m,)``.
        half_angles: Half angles of the cones [rad], 0 where unknown, ``(m,)``.
        max_incidences: Incidence up to which a surface is answered to [rad], a right angle where unknown and for a
            touch, ``(m,)``.
        jacobians: One ``(m, 3, d)`` a shared error of the measurements: how the origins move with it.
        turns: The same of the directions.
    """

    ids: tuple[str, ...]
    origins: Vectors
    directions: Vectors
    lengths: FloatArray
    half_angles: FloatArray
    max_incidences: FloatArray
    jacobians: tuple[FloatArray, ...]
    turns: tuple[FloatArray, ...]

    def __post_init__(self) -> None:
        freeze(self, "origins", "directions", "lengths", "half_angles", "max_incidences")
        for name in ("jacobians", "turns"):
            object.__setattr__(self, name, tuple(frozen_array(J) for J in getattr(self, name)))

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(frozen=True, slots=True, eq=False)
class PointMeasurements:
    """``n`` sensed points in the world [m], each with an independent covariance and its part in shared errors.

    The true point ``i`` is ``points[i] + e_i + sum_k jacobians[k][i] @ c_k`` with ``e_i ~ N(0, covs[i])`` independent
    and ``c_k ~ N(0, shared[k].covariance)`` common to all the points.

    Attributes:
        ids: Names of the readings.
        points: Surface points where ``radii`` is 0, else centres of the tip's ball, ``(n, 3)``.
        covs: Independent part, positive definite, ``(n, 3, 3)``.
        radii: The surface is this far from ``points`` along its unknown normal [m], ``(n,)``.
        directions: Unit directions of beam or touch, into the material; NaN rows where unknown, ``(n, 3)``.
        normals: Unit outward surface normals where they were sensed, else NaN, ``(n, 3)``.
        normal_sds: Their standard deviation about each tilt [rad], NaN where unknown, ``(n,)``.
        features: Labels of the readings, ``''`` for none.
        kinds: as of :class:`Readings`.
        shared: The errors that the points have in common.
        jacobians: One ``(n, 3, d)`` a shared error: how the points move with it.
        rows: Row of each point in the readings, ``(n,)``.
        free: The beams that met nothing.
        taken_off: Radius of the tip that was taken off along the sensed normal [m], ``(n,)``; 0 where it was not.
        sizes: Radius [m] or half angle [rad] of the round feature of which each is the centre; None if not reported.
        material_sides: 1 for the centre of a hole, -1 of a boss, 0 where unknown or no centre.
    """

    ids: tuple[str, ...]
    points: Vectors
    covs: Covariances
    radii: FloatArray
    directions: Vectors
    normals: Vectors
    normal_sds: FloatArray
    features: tuple[str, ...]
    kinds: tuple[str, ...]
    shared: tuple[SharedError, ...]
    jacobians: tuple[FloatArray, ...]
    rows: IntArray
    free: FreeBeams
    taken_off: FloatArray
    sizes: tuple[float | None, ...]
    material_sides: tuple[int, ...]

    def __post_init__(self) -> None:
        n = len(self.ids)
        for name in ("points", "radii", "directions", "normals", "normal_sds", "taken_off"):
            array = frozen_array(getattr(self, name))
            if array.shape[0] != n:
                raise InputError(f"{name}: expected {n} rows, one a measurement, got {array.shape[0]}.")
            object.__setattr__(self, name, array)
        rows = np.array(self.rows, dtype=np.int64)
        rows.flags.writeable = False
        object.__setattr__(self, "rows", rows)
        object.__setattr__(self, "covs", check_covariances("covs", self.covs, 3))
        for error, J in zip(self.shared, self.jacobians, strict=True):
            if J.shape != (n, 3, len(error.covariance)):
                raise InputError(
                    f"jacobians of '{error.name}': expected shape {(n, 3, len(error.covariance))}, got {J.shape}."
                )
        object.__setattr__(self, "jacobians", tuple(frozen_array(J) for J in self.jacobians))

    def __len__(self) -> int:
        return len(self.ids)

    def total_covs(self) -> Covariances:
        """Marginal covariances of the points, shared errors included, ``(n, 3, 3)`` [m^2]."""
        out = np.array(self.covs)
        for error, J in zip(self.shared, self.jacobians, strict=True):
            out += J @ error.covariance @ np.swapaxes(J, -1, -2)
        return out

    def joint_cov(self) -> Covariances:
        """Covariance of all the points together, ``(3 n, 3 n)`` [m^2]; for few points."""
        n = len(self)
        out = np.zeros((n, 3, n, 3))
        out[np.arange(n), :, np.arange(n), :] = self.covs
        for error, J in zip(self.shared, self.jacobians, strict=True):
            out += np.einsum("iab,bc,jdc->iajd", J, error.covariance, J)
        return out.reshape(3 * n, 3 * n)

    def centres(self) -> tuple[Vectors, Covariances, FloatArray]:
        """The points before a radius was taken off along a sensed normal, whose tilt moves them no more.

        Returns:
            Centres of the tip's ball, or points of a sharp one ``(n, 3)`` [m], their independent covariances
            ``(n, 3, 3)``, and how far the surface is from them ``(n,)`` [m].
        """
        off = self.taken_off > 0
        points, covs = np.array(self.points), np.array(self.covs)
        points[off] += self.taken_off[off, None] * self.normals[off]
        slip = (self.taken_off * np.nan_to_num(self.normal_sds))[off] ** 2
        covs[off] -= beam_cov(self.normals[off], np.zeros_like(slip), slip)
        return points, covs, self.radii + self.taken_off

    def stacked(self) -> tuple[FloatArray, Covariances]:
        """All shared errors as one vector ``c``: the Jacobians ``(n, 3, D)`` and the covariance ``(D, D)``."""
        J = np.concatenate([np.zeros((len(self), 3, 0)), *self.jacobians], axis=-1)
        return J, stacked_covariance(self.shared)

    def whitened(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Gains by all shared errors as unit normal ones ``z``, where what is true is what is measured + gain z.

        Returns:
            Of points ``(n, 3, D)``, and of origins and directions of free-space rays ``(m, 3, D)``.
        """
        root, none = shared_root(self.shared), np.zeros((len(self.free), 3, 0))
        origins, turns = (np.concatenate([none, *Js], axis=-1) for Js in (self.free.jacobians, self.free.turns))
        return self.stacked()[0] @ root, origins @ root, turns @ root
