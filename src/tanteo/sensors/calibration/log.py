"""Group the ranges of a calibration log by sensor, plane and hand pose, and compute outlier probabilities.

A good residual is normal with its own variance. An outlier is uniform over the range of the device. The limit between
them follows from the noise, this range and the estimated outlier fraction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import ReadingsError
from tanteo.features.kinds import PLANE
from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms
from tanteo.sensors.kinds import reading_kind
from tanteo.sensors.presets import NoiseLaw
from tanteo.sensors.readings import Readings
from tanteo.sensors.rig import Rig

_PASSES = 100
_CONVERGED = 1e-9
"""Change of the outlier fraction below which its iteration has converged."""

_LARGEST_SHARE = 0.5
"""Largest outlier fraction of a device."""


def outlier_probabilities(residuals: FloatArray, variances: FloatArray, width: FloatArray | float) -> FloatArray:
    """Return the outlier probability of each residual ``(n,)``.

    Args:
        residuals: measured minus expected ranges ``(n,)`` [m].
        variances: variances of good residuals ``(n,)`` [m^2].
        width: width of the interval of ranges that the device can report [m]; the density of an outlier is its inverse.
    """
    good = np.exp(-0.5 * residuals**2 / variances) / np.sqrt(2 * np.pi * variances)
    outlier = 1.0 / np.broadcast_to(width, good.shape)
    share = 0.5
    p = np.zeros_like(good)
    for _ in range(_PASSES):
        p = share * outlier / (share * outlier + (1 - share) * good)
        fresh = _share(p)
        if abs(fresh - share) < _CONVERGED:
            break
        share = fresh
    return np.asarray(p)


def _share(p: FloatArray) -> float:
    """Return the outlier fraction with Jeffreys' prior, at most one half."""
    return float(min((p.sum() + 0.5) / (len(p) + 1), _LARGEST_SHARE))


def mixture_log_likelihood(residuals: FloatArray, variances: FloatArray, width: FloatArray | float) -> float:
    """Return the log likelihood of residuals under the mixture, with the fraction of :func:`outlier_probabilities`.

    Args:
        residuals: measured minus expected ranges ``(n,)`` [m].
        variances: variances of good residuals ``(n,)`` [m^2].
        width: width of the interval of ranges that the device can report [m].
    """
    p = outlier_probabilities(residuals, variances, width)
    share = _share(p)
    good = np.exp(-0.5 * residuals**2 / variances) / np.sqrt(2 * np.pi * variances)
    return float(np.sum(np.log(share / np.broadcast_to(width, good.shape) + (1 - share) * good)))


_FEWEST_REPEATS = 5
"""Smallest number of repeats at one place among which an outlier can be detected."""

_REPEAT_PASSES = 50


@dataclass(frozen=True, slots=True, eq=False)
class Repeats:
    """Repeatability of a sensor at one place.

    Attributes:
        law: noise along the beam.
        cov: covariance of the squares of floor and proportional part ``(2, 2)``; NaN without repeats.
        dof: degrees of freedom of the estimate; 0 without repeats.
    """

    law: NoiseLaw
    cov: FloatArray
    dof: int


@dataclass(frozen=True, slots=True, eq=False)
class PlaneLog:
    """Log as ``m`` stations, each with all readings of one sensor on one plane at one hand pose.

    Attributes:
        beams: names of the beams: sensors, or zones of multi-zone devices.
        devices: names of the devices.
        device: index of the device of each beam ``(k,)``.
        T_device_beams: nominal poses of the beams in their device ``(k, 4, 4)`` [m].
        planes: names of the planes.
        beam: index of the sensor of each station ``(m,)``.
        plane: index of the plane of each station ``(m,)``.
        Ts_world_hand: hand poses ``(m, 4, 4)`` [m].
        ranges: mean ranges of the stations without outliers ``(m,)`` [m].
        counts: numbers of readings in these means ``(m,)``.
        station: station of each reading, -1 for an unused one ``(n,)``.
        is_outlier: mask of the readings that are outliers among their repeats ``(n,)``.
        readings: readings of the log.
        values: ranges along the beam ``(n,)`` [m]; NaN for unused readings.
        repeats: repeatability of each device.
        widths: width of each device's interval of ranges in the log ``(u,)`` [m].
        largest: largest range of each device ``(u,)`` [m].
    """

    beams: tuple[str, ...]
    devices: tuple[str, ...]
    device: IntArray
    T_device_beams: Transforms
    planes: tuple[str, ...]
    beam: IntArray
    plane: IntArray
    Ts_world_hand: Transforms
    ranges: FloatArray
    counts: IntArray
    station: IntArray
    is_outlier: BoolArray
    readings: Readings
    values: FloatArray
    repeats: tuple[Repeats, ...]
    widths: FloatArray
    largest: FloatArray

    def __len__(self) -> int:
        return len(self.ranges)

    @property
    def of(self) -> IntArray:
        """Return the device of each station ``(m,)``."""
        return self.device[self.beam]


def plane_log(readings: Readings, rig: Rig | None = None) -> PlaneLog:
    """Gather readings by sensor, plane and pose of the hand.

    Rows with one label of kind ``plane`` are on one plane, and all rows without a label on one plane. Rows of status
    ``none`` are ignored.

    Args:
        readings: ranges with sensor and hand pose.
        rig: rig that states which sensors report the distance along their optical axis; None if unknown.

    Raises:
        ReadingsError: there is no range, a range has no sensor or hand pose, or a reading is on an edge or vertex.
    """
    used = _usable(readings)
    beams, beam = _numbered(readings.sensors, used)
    planes, plane = _numbered(readings.features, used)
    rows = np.flatnonzero(used)
    hands = readings.Ts_world_hand[rows][:, :3].reshape(-1, 12)
    keys = np.concatenate([np.stack([beam, plane], axis=1), hands], axis=1)
    _, first, station = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(np.argsort(first))
    station, first = order[station.ravel()], np.sort(first)
    cosines = {s.name: s.axis_cosine for s in rig.sensors} if rig is not None else {}
    d = readings.ranges[rows] / np.array([cosines.get(name, 1.0) for name in beams])[beam]
    units = {s.name: s.device for s in rig.sensors} if rig is not None else {}
    names = [units.get(name, name) for name in beams]
    devices = tuple(dict.fromkeys(names))
    device = np.array([devices.index(name) for name in names], dtype=np.int64)
    of = device[beam]
    outliers, repeats = np.zeros(len(rows), dtype=bool), []
    for k in range(len(devices)):
        mine = of == k
        law, outliers[mine] = _repeat_noise(d[mine], station[mine], np.ptp(d[mine]))
        repeats.append(law)
    counts = np.bincount(station[~outliers], minlength=len(first))
    full_station, full_stray = np.full(len(readings), -1), np.zeros(len(readings), dtype=bool)
    full_station[rows], full_stray[rows] = station, outliers
    values = np.full(len(readings), np.nan)
    values[rows] = d
    return PlaneLog(
        beams=beams,
        devices=devices,
        device=device,
        T_device_beams=_in_device(beams, rig),
        planes=tuple(name or "plane" for name in planes),
        beam=beam[first],
        plane=plane[first],
        Ts_world_hand=readings.Ts_world_hand[rows[first]],
        ranges=np.bincount(station[~outliers], weights=d[~outliers], minlength=len(first)) / counts,
        counts=counts,
        station=full_station,
        is_outlier=full_stray,
        readings=readings,
        values=values,
        repeats=tuple(repeats),
        widths=np.array([max(np.ptp(d[of == k]), 1e-3) for k in range(len(devices))]),
        largest=np.array([d[of == k].max() for k in range(len(devices))]),
    )


def _in_device(beams: tuple[str, ...], rig: Rig | None) -> Transforms:
    """Return the nominal poses of the beams in their device ``(k, 4, 4)`` [m]; identities without a rig."""
    out = np.tile(np.eye(4), (len(beams), 1, 1))
    known = {} if rig is None else {s.name: s for s in rig.sensors}
    for k, name in enumerate(beams):
        if name in known:
            out[k] = SE3.inverse(known[name].T_hand_unit) @ known[name].T_hand_sensor
    return out


def _usable(readings: Readings) -> BoolArray:
    used = ~readings.is_free
    for i in np.flatnonzero(used):
        name = readings.ids[i]
        if not readings.ranges.given[i] or not readings.sensors[i] or not readings.Ts_world_hand.given[i]:
            raise ReadingsError(
                f"reading '{name}': expected a range with its sensor and the hand's pose, got less. Fill in range_mm, "
                "sensor and the hand_ columns."
            )
        if reading_kind(readings.kinds[i]).feature is not PLANE:
            raise ReadingsError(
                f"kind of reading '{name}': expected plane, got {readings.kinds[i]}. Calibrate on flat surfaces."
            )
    if not used.any():
        raise ReadingsError("readings: expected ranges of a plane, got none. Log some with the hand at many poses.")
    return used


def _numbered(names: tuple[str, ...], used: BoolArray) -> tuple[tuple[str, ...], IntArray]:
    mine = [name for name, take in zip(names, used, strict=True) if take]
    known = {name: i for i, name in enumerate(dict.fromkeys(mine))}
    return tuple(known), np.array([known[name] for name in mine], dtype=np.int64)


def _repeat_noise(d: FloatArray, station: IntArray, width: float) -> tuple[Repeats, BoolArray]:
    """Return the repeatability within stations, and the mask of readings that are outliers among their repeats."""
    _, local = np.unique(station, return_inverse=True)
    counts = np.bincount(local)
    outliers = np.zeros(len(d), dtype=bool)
    if counts.max() < 2:
        return Repeats(NoiseLaw.of(0.0), np.full((2, 2), np.nan), 0), outliers
    rows = [np.flatnonzero(local == s) for s in range(len(counts))]
    medians = np.array([np.median(d[r]) for r in rows])
    squares, cov = np.zeros(2), np.full((2, 2), np.nan)
    for _ in range(_REPEAT_PASSES):
        left = np.bincount(local[~outliers], minlength=len(counts)).astype(np.float64)
        sums = np.bincount(local[~outliers], weights=d[~outliers], minlength=len(counts))
        means = np.where(left > 0, sums / np.maximum(left, 1), medians)
        within = (d - means[local])[~outliers] ** 2
        scatter = np.bincount(local[~outliers], weights=within, minlength=len(counts)).astype(np.float64)
        squares, cov = _growth(scatter, np.maximum(left - 1.0, 0.0), means)
        away = d - medians[local]
        variance = squares[0] + squares[1] * medians[local] ** 2
        repeated = counts[local] >= _FEWEST_REPEATS
        fresh = repeated & (outlier_probabilities(away, np.maximum(variance, 1e-18), max(width, 1e-3)) > 0.5)
        if (fresh == outliers).all():
            break
        outliers = fresh
    kept = np.bincount(local[~outliers], minlength=len(counts))
    return Repeats(NoiseLaw.of(*np.sqrt(squares)), cov, int(np.maximum(kept - 1, 0).sum())), outliers


def _growth(scatter: FloatArray, dof: FloatArray, d: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Fit ``scatter_i ~ (a + b d_i^2) chi2(dof_i)`` by maximum likelihood; return ``a, b >= 0`` with covariance."""
    used = dof > 0
    scatter, dof = scatter[used], dof[used]
    basis = np.stack([np.ones(len(scatter)), d[used] ** 2], axis=1)
    pooled = max(scatter.sum() / dof.sum(), 1e-18)
    squares = np.array([pooled, 0.0]) if len(scatter) < 3 else np.array([0.5, 0.5 / np.mean(d[used] ** 2)]) * pooled
    for _ in range(200 if len(scatter) >= 3 else 1):
        variance = basis @ squares
        # multiplicative Fisher scoring keeps the parameters positive and increases the likelihood
        ratio = (basis.T @ (scatter / variance**2)) / (basis.T @ (dof / variance))
        squares = squares * np.sqrt(ratio) if len(scatter) >= 3 else squares
    variance = basis @ squares
    information = basis.T @ (0.5 * (dof / variance**2)[:, None] * basis)
    return squares, np.asarray(np.linalg.pinv(information, rcond=1e-14, hermitian=True))
