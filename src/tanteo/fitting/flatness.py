"""Refusal of points that do not spread in as many directions as a feature needs."""

from __future__ import annotations

import numpy as np

from tanteo.errors import DegenerateError
from tanteo.geometry.typing import FloatArray, Vectors

_FLAT = 1e-6
"""Spread, as a fraction of the largest one, below which a direction counts as without spread."""

_LEAST_SPREAD = 4.0
"""Least spread in standard deviations of a point: below, the noise determines the direction of the feature."""


def refuse_narrow(spread: FloatArray, R: FloatArray, message: str) -> None:
    """Refuse points whose spread is less than four standard deviations of their noise.

    Args:
        spread: root mean square of the points along the direction that needs it, in standard deviations ``(*batch,)``.
        R: axes of the features, x first ``(*batch, 3, 3)``.
        message: text with ``{least}`` for the spread that is needed, ``{spread}`` for the spread found and ``{along}``
            for the x axis.

    Raises:
        DegenerateError: the spread is smaller; the error has the text of ``message``.
    """
    if np.all(spread >= _LEAST_SPREAD):
        return
    k = int(np.argmin(spread))
    u, s = R.reshape(-1, 3, 3)[k, :, 0], np.ravel(spread)[k]
    values = {"least": f"{_LEAST_SPREAD:g}", "spread": f"{s:.2g}", "along": f"({u[0]:.3g}, {u[1]:.3g}, {u[2]:.3g})"}
    raise DegenerateError(message.format(**values))


def spreads(points: Vectors) -> tuple[Vectors, FloatArray, FloatArray]:
    """Return means ``(*batch, 3)``, principal directions as columns, and spreads along them, smallest first."""
    mean = points.mean(axis=-2)
    centred = points - mean[..., None, :]
    values, vectors = np.linalg.eigh(np.swapaxes(centred, -1, -2) @ centred / points.shape[-2])
    return mean, vectors, np.sqrt(np.maximum(values, 0.0))


def refuse_flat(points: Vectors, needed: int, what: str) -> None:
    """Refuse points that spread in fewer directions than needed.

    Args:
        points: points ``(*batch, n, 3)`` [m].
        needed: number of directions, 1 to 3.
        what: name of the feature in the message.

    Raises:
        DegenerateError: the points coincide, or lie on a line or in a plane; the message states which.
    """
    _, vectors, sizes = spreads(points)
    scale = np.maximum(sizes[..., 2], 1e-300)
    flat = (sizes[..., 3 - needed] <= _FLAT * scale) | (sizes[..., 2] <= 1e-9 * np.abs(points).max(initial=0.0))
    if not np.any(flat):
        return
    k = np.unravel_index(int(np.argmax(flat)), flat.shape) if flat.ndim else ()
    if sizes[(*k, 2)] <= 1e-9 * np.abs(points).max(initial=0.0):
        raise DegenerateError(f"{what}: expected points apart, got coincident ones. Touch it at other places.")
    line = bool(sizes[(*k, 1)] <= _FLAT * sizes[(*k, 2)])
    u = vectors[(*k, slice(None), 2 if line else 0)]
    at = f"({u[0]:.3g}, {u[1]:.3g}, {u[2]:.3g})"
    if line:
        raise DegenerateError(
            f"{what}: expected points around it, got all of them on one line along {at}. Touch it beside that line."
        )
    raise DegenerateError(
        f"{what}: expected points that spread in all directions, got all of them in one plane across {at}. Touch it "
        "above or below that plane."
    )
