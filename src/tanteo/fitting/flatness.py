"""Points that do not spread in as many directions as a round feature needs."""

from __future__ import annotations

import numpy as np

from tanteo.errors import DegenerateError
from tanteo.typing import FloatArray, Vectors

_FLAT = 1e-6
"""Points spread less than this share of their largest spread do not spread at all."""


def spreads(points: Vectors) -> tuple[Vectors, FloatArray, FloatArray]:
    """Mean ``(*batch, 3)``, principal directions as columns and spreads along them, least first."""
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
