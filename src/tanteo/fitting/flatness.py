"""Refusal of points that do not spread in as many directions as a feature needs."""

from __future__ import annotations

import numpy as np

from tanteo.errors import DegenerateError
from tanteo.geometry.typing import FloatArray, Vectors

_FLAT = 1e-6
"""Points spread less than this share of their largest spread do not spread at all."""

_LEAST_SPREAD = 4.0
"""Standard deviations of a point over which points have to spread: below, chance decides how their feature lies."""


def refuse_narrow(spread: FloatArray, R: FloatArray, message: str) -> None:
    """Refuse points that hardly spread beyond their noise.

    Args:
        spread: root mean square along the direction that matters, in standard deviations ``(*batch,)``.
        R: axes of the features, x first ``(*batch, 3, 3)``.
        message: with ``{least}`` for how far they have to spread, ``{spread}`` for how far they do and ``{along}`` for
            the x axis.

    Raises:
        DegenerateError: with the message.
    """
    if np.all(spread >= _LEAST_SPREAD):
        return
    k = int(np.argmin(spread))
    u, s = R.reshape(-1, 3, 3)[k, :, 0], np.ravel(spread)[k]
    said = {"least": f"{_LEAST_SPREAD:g}", "spread": f"{s:.2g}", "along": f"({u[0]:.3g}, {u[1]:.3g}, {u[2]:.3g})"}
    raise DegenerateError(message.format(**said))


def spreads(points: Vectors) -> tuple[Vectors, FloatArray, FloatArray]:
    """Return means ``(*batch, 3)``, principal directions as columns, and spreads along them, smallest first."""
    mean = points.mean(axis=-2)
    centred = points - mean[..., None, :]
    values, vectors = np.linalg.eigh(np.swapaxes(centred, -1, -2) @ centred / points.shape[-2])
    return mean, vectors, np.sqrt(np.maximum(values, 0.0))


def refuse_flat(points: Vectors, needed: int, what: str) -> None:
    """Refuse points that spread in fewer directions.

    Raises:
        DegenerateError: with what they are: one point, a line, a plane.
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
