"""Directions in the parameters of a beam that a log does not determine, and the status of a calibration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import qr

from tanteo.geometry.typing import FloatArray
from tanteo.sensors.calibration.geometry import BEAM, WEAK
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

    Judged in the coordinates that make the prior a unit ball: what a unit is does not matter.
    """
    vectors = _unmoved(cov, prior, len(BEAM) - 1)
    found = []
    for vector in _plain(vectors).T:
        shares = vector**2
        names = tuple(_NAMES[i] for i in np.argsort(-shares) if shares[i] > _PART)
        found.append(Undetermined(sensor, names))
    return tuple(found)


def is_lost(cov: FloatArray) -> bool:
    """Return whether neither the log nor a rig determines the pose of a beam better than somewhere on the hand.

    Args:
        cov: posterior covariance of the parameters ``(7, 7)``.
    """
    return _unmoved(cov, np.diag([WEAK[term] ** 2 for term in BEAM]), _POSE).shape[1] > 0


def _unmoved(cov: FloatArray, prior: FloatArray, n: int) -> FloatArray:
    """Return the directions whose variance is about that of the prior ``(n, k)``."""
    L = np.linalg.cholesky(prior[:n, :n])
    whitened = np.linalg.solve(L, np.linalg.solve(L, cov[:n, :n]).T)
    values, vectors = np.linalg.eigh(0.5 * (whitened + whitened.T))
    return np.asarray(vectors[:, values > _UNDETERMINED])


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
    names: Sequence[str], undetermined: Sequence[Undetermined], lost: Sequence[bool]
) -> tuple[str, Calibrated | BeamsUndetermined]:
    """Return the status of a calibration and its verdict.

    Args:
        names: names of the sensors.
        undetermined: what the log does not determine, of all sensors.
        lost: whether the beam of each sensor has no place at all.
    """
    if any(lost):
        return "insufficient", BeamsUndetermined(tuple(undetermined))
    return "calibrated", Calibrated(tuple(names), tuple(undetermined))
