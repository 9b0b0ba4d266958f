"""Side from which the readings of a label, or of a round feature, were sensed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.errors import InputError, SideError
from tanteo.geometry.typing import FloatArray, Vectors
from tanteo.sensors import PointMeasurements

_ALONG = 0.05
"""A direction with a smaller cosine to the normal lies in the surface and does not determine its outward side."""


def known_side(measured: PointMeasurements, rows: Sequence[int]) -> dict[str, FloatArray]:
    """Return the vectors that determine the outward side of rows, by their name.

    Returns:
        ``normals`` or ``directions`` with its array ``(n, 3)``; empty if no row has either.
    """
    index = np.array(rows)
    for name, vectors in (("normals", measured.normals[index]), ("directions", measured.directions[index])):
        if np.isfinite(vectors).all(axis=1).any():
            return {name: vectors}
    return {}


def most_opposed(measured: PointMeasurements, rows: Sequence[int]) -> tuple[int, float]:
    """Return the row whose direction or normal is most opposed to the sum of all, and the cosine between them.

    The cosine is 1 if no side is known.
    """
    for vectors in known_side(measured, rows).values():
        total = np.nansum(vectors, axis=0)
        cosines = np.nan_to_num(vectors @ total / max(float(np.linalg.norm(total)), 1e-300), nan=1.0)
        return rows[int(np.argmin(cosines))], float(cosines.min())
    return rows[0], 1.0


def outward_vectors(directions: Vectors | None, normals: Vectors | None, n: int) -> Vectors:
    """Return unit vectors out of the material ``(n, 3)`` from normals or directions; zero if unknown."""
    for side, sign in ((normals, 1.0), (directions, -1.0)):
        if side is None:
            continue
        vectors = sign * np.nan_to_num(np.asarray(side, dtype=np.float64).reshape(n, 3))
        length = np.linalg.norm(vectors, axis=1, keepdims=True)
        if length.any():
            return np.asarray(vectors / np.where(length > 0, length, 1.0))
    return np.zeros((n, 3))


def side_of(N: Vectors, outward: Vectors, stated: int | None, name: str) -> int | None:
    """Return 1 if outward vectors point away from the axis, -1 if towards it; the stated side if unknown.

    Raises:
        SideError: if they contradict each other, or what is stated.
    """
    known = outward.any(axis=1)
    along = np.sum(N * outward, axis=1)[known]
    if not len(along) or np.all(np.abs(along) < _ALONG):
        return stated
    mean = float(along.mean())
    if abs(mean) < _ALONG or np.any(along * np.sign(mean) < -0.2):
        raise SideError(
            f"{name}: expected the readings to agree on which side is outside, got vectors with components "
            f"{along.min():.2f} to {along.max():.2f} away from its axis. Check directions, normals and label."
        )
    side = 1 if mean > 0 else -1
    if stated is not None and side != stated:
        got, wanted = ("a boss", "a bore") if side > 0 else ("a bore", "a boss")
        raise SideError(f"{name}: expected {wanted}, got directions or normals of {got}. Check convex, or the columns.")
    return side


def require_side(side: int | None, touched: bool, name: str, got: str) -> None:
    """Refuse a ball that touched from an unknown side.

    Raises:
        SideError: if it did.
    """
    if touched and side is None:
        raise SideError(
            f"{name}: expected to know whether the ball touched a boss from outside or a bore from inside, got {got}. "
            "Give the direction of each touch (into the material), or convex."
        )


def check_spread(what: str, sd: float, name: str) -> None:
    """Refuse a standard deviation that is none.

    Raises:
        InputError: if it is negative or not finite.
    """
    if not (np.isfinite(sd) and sd >= 0):
        raise InputError(f"{name}, {what}: expected zero or more, got {sd}.")
