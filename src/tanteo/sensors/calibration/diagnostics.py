"""What a log does not tell about a beam, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import qr

from tanteo.geometry.typing import FloatArray
from tanteo.sensors.calibration.geometry import BEAM, WEAK

_UNTOLD = 0.5
"""A direction whose variance is still this share of what it was before the log has not been told."""

_PART = 0.2
"""A parameter is named where it has this share of such a direction."""

_ADVICE = "Turn the hand about two axes across the beam between readings, by 20 degrees or more, and change the range."

_POSE = 5
"""The first parameters of a beam: where it is. Then scale and slant."""

_NAMES = (
    "the origin across the beam (x)",
    "the origin across the beam (y)",
    "the offset along the beam",
    "the beam's direction (turn about x)",
    "the beam's direction (turn about y)",
    "the scale",
)


def undetermined(cov: FloatArray, prior: FloatArray) -> tuple[str, ...]:
    """Directions in a beam's parameters that the log did not tell.

    Judged in the coordinates that make the prior a unit ball: what a unit is does not matter.
    """
    vectors = _unmoved(cov, prior, len(BEAM) - 1)
    words = []
    for vector in _plain(vectors).T:
        shares = vector**2
        words.append(_joined([_NAMES[i] for i in np.argsort(-shares) if shares[i] > _PART]))
    return tuple(words)


def is_lost(cov: FloatArray) -> bool:
    """Whether neither the log nor a rig tells where a beam is: hardly better than somewhere on the hand."""
    return _unmoved(cov, np.diag([WEAK[term] ** 2 for term in BEAM]), _POSE).shape[1] > 0


def _unmoved(cov: FloatArray, prior: FloatArray, n: int) -> FloatArray:
    """Directions ``(n, k)`` whose variance is still that of the prior, or nearly."""
    L = np.linalg.cholesky(prior[:n, :n])
    whitened = np.linalg.solve(L, np.linalg.solve(L, cov[:n, :n]).T)
    values, vectors = np.linalg.eigh(0.5 * (whitened + whitened.T))
    return np.asarray(vectors[:, values > _UNTOLD])


def _plain(vectors: FloatArray) -> FloatArray:
    """Basis of the same space with as many zeros as there are independent directions: readable."""
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
    """Status and one sentence, from what the log does not tell of each sensor and which of their beams are lost."""
    told = [f"{'; nor '.join(w)} of '{name}'" for name, w in zip(names, words, strict=True) if w]
    if any(lost):
        status, first = "insufficient", f"This log does not tell {'; nor '.join(told)}."
    elif told:
        status = "calibrated"
        first = (
            f"Calibrated {', '.join(names)}, but this log adds little on {'; nor '.join(told)}: kept as known before."
        )
    else:
        return "calibrated", f"Calibrated {', '.join(names)}."
    return status, f"{first} {_ADVICE}"
