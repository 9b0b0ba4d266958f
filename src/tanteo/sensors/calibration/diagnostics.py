"""Name the parameters of a beam that a log does not determine."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import qr

from tanteo.geometry.typing import FloatArray
from tanteo.sensors.calibration.geometry import BEAM, WEAK

_UNDETERMINED = 0.5
"""Ratio of posterior to prior variance above which a direction is undetermined."""

_PART = 0.2
"""Squared component above which a parameter is named in an undetermined direction."""

_ADVICE = "Turn the hand about two axes across the beam between readings, by 20 degrees or more, and change the range."

_POSE = 5
"""Number of pose parameters of a beam, which come first; scale and slant follow."""

_NAMES = (
    "the origin across the beam (x)",
    "the origin across the beam (y)",
    "the offset along the beam",
    "the beam's direction (turn about x)",
    "the beam's direction (turn about y)",
    "the scale",
)


def undetermined(cov: FloatArray, prior: FloatArray) -> tuple[str, ...]:
    """Return the directions in a beam's parameters that the log does not determine, as text.

    The comparison uses coordinates in which the prior covariance is the identity, so it does not depend on units.

    Args:
        cov: posterior covariance of the parameters ``(7, 7)``.
        prior: prior covariance ``(7, 7)``.
    """
    vectors = _unmoved(cov, prior, len(BEAM) - 1)
    words = []
    for vector in _plain(vectors).T:
        shares = vector**2
        words.append(_joined([_NAMES[i] for i in np.argsort(-shares) if shares[i] > _PART]))
    return tuple(words)


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


def _joined(parts: Sequence[str]) -> str:
    if len(parts) == 1:
        return parts[0]
    return f"{parts[0]} apart from {' and '.join(parts[1:])}"


def status_of(names: Sequence[str], words: Sequence[tuple[str, ...]], lost: Sequence[bool]) -> tuple[str, str]:
    """Return status and message of a calibration.

    Args:
        names: names of the sensors.
        words: undetermined parameters of each sensor, as text.
        lost: whether the pose of each beam is undetermined.
    """
    unknown = [f"{'; nor '.join(w)} of '{name}'" for name, w in zip(names, words, strict=True) if w]
    if any(lost):
        status, first = "insufficient", f"This log does not determine {'; nor '.join(unknown)}."
    elif unknown:
        status = "calibrated"
        first = (
            f"Calibrated {', '.join(names)}, but this log adds little on {'; nor '.join(unknown)}: the prior is kept."
        )
    else:
        return "calibrated", f"Calibrated {', '.join(names)}."
    return status, f"{first} {_ADVICE}"
