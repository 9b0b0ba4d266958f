"""Define measurements: points in the world with covariance and shared errors, and free-space rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.features import SharedError, shared_root, stacked_covariance
from tanteo.geometry import check_covariances, freeze, frozen_array
from tanteo.geometry.typing import Covariances, FloatArray, IntArray, Vectors
from tanteo.sensors.error_states import UnstatedError
from tanteo.sensors.noise import beam_cov


@dataclass(frozen=True, slots=True, eq=False)
class FreeBeams:
    """Beams that hit nothing, so that the space along them is empty; world frame.

    With the shared errors ``c_k`` of the measurements, the true origin ``i`` is ``origins[i] + sum_k jacobians[k][i] @
    c_k``, and the true direction ``directions[i] + sum_k turns[k][i] @ c_k``.

    Attributes:
        ids: names of the readings.
        origins: starts of the beams ``(m, 3)`` [m].
        directions: unit directions ``(m, 3)``.
        lengths: free lengths of the beams ``(m,)`` [m].
        half_angles: half angles of the cones ``(m,)`` [rad]; 0 if unknown.
        max_incidences: largest incidence at which the device detects a surface ``(m,)`` [rad]; a right angle if unknown
            and for a touch probe.
        jacobians: derivative of the origins by each shared error, each ``(m, 3, d)``.
        turns: derivative of the directions by each shared error, each ``(m, 3, d)``.
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
class BeamCones:
    """Cones of the beams of ``n`` points; world frame.

    Attributes:
        ranges: ranges along the beams ``(n,)`` [m]; NaN for a reading without range.
        half_angles: half angles ``(n,)`` [rad]; NaN if unknown.
        half_axes: half axes of rectangular beams at distance one ``(n, 2, 3)``; NaN for circles.
        max_incidences: largest incidence at which the device detects a surface ``(n,)`` [rad].
        responses: what the device reports of its cone; empty if unknown.
        turns: derivative of the directions by each shared error, each ``(n, 3, d)``.
    """

    ranges: FloatArray
    half_angles: FloatArray
    half_axes: FloatArray
    max_incidences: FloatArray
    responses: tuple[str, ...]
    turns: tuple[FloatArray, ...]

    def __post_init__(self) -> None:
        freeze(self, "ranges", "half_angles", "half_axes", "max_incidences")
        object.__setattr__(self, "turns", tuple(frozen_array(J) for J in self.turns))


@dataclass(frozen=True, slots=True, eq=False)
class PointMeasurements:
    """``n`` sensed points in the world, each with an independent covariance and a gain by shared errors.

    The true point ``i`` is ``points[i] + e_i + sum_k jacobians[k][i] @ c_k`` with independent ``e_i ~ N(0, covs[i])``
    and ``c_k ~ N(0, shared[k].covariance)`` common to all points.

    Attributes:
        ids: names of the readings.
        points: surface points where ``radii`` is 0, otherwise centres of the tip's ball ``(n, 3)`` [m].
        covs: independent covariances, positive definite ``(n, 3, 3)`` [m^2].
        radii: distances of the surface from ``points`` along its unknown normal ``(n,)`` [m].
        directions: unit directions of beam or approach, into the material; NaN if unknown ``(n, 3)``.
        normals: sensed unit outward surface normals; NaN if not sensed ``(n, 3)``.
        normal_sds: standard deviations of the normals for each tilt component ``(n,)`` [rad]; NaN if unknown.
        features: labels of the readings; empty for none.
        kinds: kinds of the readings, see :class:`Readings`.
        shared: errors common to the points.
        jacobians: derivative of the points by each shared error, each ``(n, 3, d)``.
        rows: row of each point in the readings ``(n,)``.
        free: beams that hit nothing.
        cones: cones of the beams.
        subtracted_radii: tip radius subtracted along the sensed normal ``(n,)`` [m]; 0 if none was.
        sizes: radii [m] or half angles [rad] of the round features whose centres the points are; None if not
            reported.
        material_sides: 1 for the centre of a hole, -1 of a boss, 0 where unknown or no centre.
        rounding: standard deviation of each coordinate by the rounding of its file [m], in addition to ``covs``.
        unstated: errors that the points are assumed to share because the user states none.
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
    cones: BeamCones
    subtracted_radii: FloatArray
    sizes: tuple[float | None, ...]
    material_sides: tuple[int, ...]
    rounding: float = 0.0
    unstated: tuple[UnstatedError, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.ids)
        for name in ("points", "radii", "directions", "normals", "normal_sds", "subtracted_radii"):
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
        """Return marginal covariances of the points, including shared errors ``(n, 3, 3)`` [m^2]."""
        out = np.array(self.covs)
        for error, J in zip(self.shared, self.jacobians, strict=True):
            out += J @ error.covariance @ np.swapaxes(J, -1, -2)
        return out

    def joint_cov(self) -> Covariances:
        """Return the joint covariance of all points ``(3 n, 3 n)`` [m^2]; suitable for few points."""
        n = len(self)
        out = np.zeros((n, 3, n, 3))
        out[np.arange(n), :, np.arange(n), :] = self.covs
        for error, J in zip(self.shared, self.jacobians, strict=True):
            out += np.einsum("iab,bc,jdc->iajd", J, error.covariance, J)
        return out.reshape(3 * n, 3 * n)

    def centres(self) -> tuple[Vectors, Covariances, FloatArray]:
        """Return the points before the tip radius was subtracted along a sensed normal.

        Returns:
            Centres of the tip's ball, or points of a sharp tip ``(n, 3)`` [m]; their independent covariances ``(n, 3,
            3)`` without the normals' tilt; and the distances of the surface ``(n,)`` [m].
        """
        off = self.subtracted_radii > 0
        points = np.array(self.points)
        covs = np.array(self.covs)
        points[off] += self.subtracted_radii[off, None] * self.normals[off]
        slip = (self.subtracted_radii * np.nan_to_num(self.normal_sds))[off] ** 2
        covs[off] -= beam_cov(self.normals[off], np.zeros_like(slip), slip)
        return points, covs, self.radii + self.subtracted_radii

    def stacked(self) -> tuple[FloatArray, Covariances]:
        """Return all shared errors as one vector ``c``: Jacobians ``(n, 3, D)`` and covariance ``(D, D)``."""
        J = np.concatenate([np.zeros((len(self), 3, 0)), *self.jacobians], axis=-1)
        return J, stacked_covariance(self.shared)

    def whitened(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return the gains ``G`` by shared errors written as standard normal variables ``z``.

        True = measured + ``G z``.

        Returns:
            Gains of points ``(n, 3, D)``, of origins and of directions of free-space rays ``(m, 3, D)``, and of the
            directions of the points' beams ``(n, 3, D)``.
        """
        root = shared_root(self.shared)
        none = np.zeros((len(self.free), 3, 0))
        origins, turns = (np.concatenate([none, *Js], axis=-1) for Js in (self.free.jacobians, self.free.turns))
        aims = np.concatenate([np.zeros((len(self), 3, 0)), *self.cones.turns], axis=-1)
        return self.stacked()[0] @ root, origins @ root, turns @ root, aims @ root
