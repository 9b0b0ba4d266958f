"""Directions in the parameters of a beam that a log does not determine, and the status of a calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import qr

from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray
from tanteo.sensors.calibration.fit import Fit
from tanteo.sensors.calibration.geometry import BEAM, FIXED, PLANE, WEAK, predict
from tanteo.sensors.calibration.log import PlaneLog
from tanteo.words.findings import BeamsUndetermined, Calibrated, Undetermined

_UNDETERMINED = 0.5
"""Ratio of posterior to prior variance above which a direction is undetermined."""

_PART = 0.2
"""Squared component above which a parameter is named in an undetermined direction."""

_POSE = 5
"""Number of pose parameters of a beam, which come first; scale and slant follow."""

_NAMES = "x", "y", "offset", "rx", "ry", "scale"


def undetermined(sensor: str, cov: FloatArray, prior: FloatArray) -> tuple[Undetermined, ...]:
    """Return the directions in the parameters of a sensor's beam that the log does not determine.

    The comparison uses coordinates in which the prior covariance is the identity, so it does not depend on units.

    Args:
        sensor: name of the sensor.
        cov: posterior covariance of the parameters ``(7, 7)``.
        prior: prior covariance ``(7, 7)``.
    """
    vectors = _unmoved(cov, prior, len(BEAM) - 1)
    found = []
    for vector in _plain(vectors).T:
        shares = vector**2
        names = tuple(_NAMES[i] for i in np.argsort(-shares) if shares[i] > _PART)
        found.append(Undetermined(sensor, names))
    return tuple(found)


_OF_DEVICE = (0, 1, 2, 3, 4, 5, 6, 7)
_DEVICE_NAMES = "x", "y", "z", "rx", "ry", "rz", "offset", "scale"


def undetermined_of_device(device: str, cov: FloatArray, prior: FloatArray) -> tuple[Undetermined, ...]:
    """Return the directions in the parameters of a multi-zone device that the log does not determine.

    Args:
        device: name of the device.
        cov: posterior covariance of its parameters ``(10, 10)``.
        prior: prior covariance ``(10, 10)``.
    """
    found = []
    for vector in _plain(_unmoved(cov, prior, len(_OF_DEVICE))).T:
        shares = vector**2
        found.append(Undetermined(device, tuple(_DEVICE_NAMES[i] for i in np.argsort(-shares) if shares[i] > _PART)))
    return tuple(found)


_KNOWN_TILT = 0.1
"""Definition: standard deviation of a plane's tilt before the log up to which it counts as known [rad]."""


def untold_tilts(planes: Sequence[str], cov: FloatArray, precision: FloatArray) -> list[Undetermined]:
    """Return the planes whose tilts the log does not determine.

    Args:
        planes: names of the planes, whose parameters are the last.
        cov: posterior covariance of all parameters.
        precision: prior precision of all parameters.
    """
    at = len(cov) - len(PLANE) * len(planes) + len(PLANE) * np.arange(len(planes))[:, None] + np.arange(2)
    after, before = np.diag(cov)[at], 1 / np.diag(precision)[at]
    untold = (after > _UNDETERMINED * before).any(axis=1) & (before > _KNOWN_TILT**2).all(axis=1)
    return [Undetermined(name, ("tilt",)) for name, open_ in zip(planes, untold, strict=True) if open_]


_MOVES = {
    "turn it by 20 degrees about its x axis": (0.0, 0.0, 0.0, 0.35, 0.0, 0.0),
    "turn it by 20 degrees about its y axis": (0.0, 0.0, 0.0, 0.0, 0.35, 0.0),
    "turn it by 20 degrees the other way about its x axis": (0.0, 0.0, 0.0, -0.35, 0.0, 0.0),
    "turn it by 20 degrees the other way about its y axis": (0.0, 0.0, 0.0, 0.0, -0.35, 0.0),
    "move it 50 mm nearer": (0.0, 0.0, 0.05, 0.0, 0.0, 0.0),
    "move it 50 mm away": (0.0, 0.0, -0.05, 0.0, 0.0, 0.0),
}
"""Motions of a device in its own frame from its middle place [m, rad], by words; definition of what may be advised."""


def advice(fit: Fit, log: PlaneLog, device: int) -> str:
    """Return the motion of a device, from its middle place, whose reading would reduce the uncertainty most.

    Args:
        fit: fit of the log.
        log: stations.
        device: number of the device.
    """
    mine = np.flatnonzero(log.of == device)
    middle = mine[np.argsort(log.ranges[mine])[len(mine) // 2]]
    T_hand = fit.setup.T_hand_devices[device]
    gains = {}
    for words, twist in _MOVES.items():
        T = log.Ts_world_hand[middle] @ T_hand @ SE3.exp(np.array(twist)) @ SE3.inverse(T_hand)
        there = replace(log, beam=log.beam[[middle]], plane=log.plane[[middle]], Ts_world_hand=T[None])
        J = predict(fit.setup, there).jacobian[0]
        gains[words] = float(J @ fit.cov @ J) / float(fit.variances[middle])
    return max(gains, key=lambda words: gains[words])


def is_lost(cov: FloatArray) -> bool:
    """Return whether neither the log nor a rig determines the pose of a beam better than somewhere on the hand.

    Args:
        cov: posterior covariance of the parameters ``(7, 7)``.
    """
    return _unmoved(cov, np.diag([WEAK[term] ** 2 for term in BEAM]), _POSE).shape[1] > 0


def _unmoved(cov: FloatArray, prior: FloatArray, n: int) -> FloatArray:
    """Return the directions whose variance is about that of the prior, without fixed parameters ``(n, k)``."""
    open_ = np.flatnonzero(np.diag(prior)[:n] > (10 * FIXED) ** 2)
    L = np.linalg.cholesky(prior[np.ix_(open_, open_)])
    whitened = np.linalg.solve(L, np.linalg.solve(L, cov[np.ix_(open_, open_)]).T)
    values, vectors = np.linalg.eigh(0.5 * (whitened + whitened.T))
    out = np.zeros((n, int(np.sum(values > _UNDETERMINED))))
    out[open_] = vectors[:, values > _UNDETERMINED]
    return out


def _plain(vectors: FloatArray) -> FloatArray:
    """Return a basis of the same space with one parameter of its own in each vector, for readable names."""
    if vectors.shape[1] == 0:
        return vectors
    # columns with pivots: each pivot parameter gets a vector of its own
    _, _, order = qr(vectors.T, pivoting=True)
    pivots = order[: vectors.shape[1]]
    basis = vectors @ np.linalg.inv(vectors[pivots])
    return np.asarray(basis / np.linalg.norm(basis, axis=0))


def status_of(
    names: Sequence[str], undetermined: Sequence[Undetermined], lost: Sequence[bool], *, by_distances: bool = False
) -> tuple[str, Calibrated | BeamsUndetermined]:
    """Return the status of a calibration and its verdict.

    Args:
        names: names of the sensors.
        undetermined: directions of the sensors' poses that the log does not determine.
        lost: whether the beam of each sensor has no place at all.
        by_distances: whether the log has known distances, not poses of the hand.
    """
    if any(lost):
        return "insufficient", BeamsUndetermined(tuple(undetermined), by_distances)
    return "calibrated", Calibrated(tuple(names), tuple(undetermined), by_distances)
