"""Points on round features of known size, and how far an estimate is off, for tests and benchmarks."""

from __future__ import annotations

import numpy as np

from tanteo.features import KINDS
from tanteo.lie import SE3, SO3

RADIUS, HALF_ANGLE = 0.01, np.radians(25.0)


def size_of(kind):
    return HALF_ANGLE if kind == "cone" else RADIUS


def round_points(kind, arc, n):
    """``n`` points over ``arc`` degrees in the feature's frame, and unit vectors away from its axis or centre."""
    k = np.arange(n)
    turn = np.radians(arc) * ((k + 0.5) / n - 0.5)
    e = np.c_[np.cos(turn), np.sin(turn), 0 * turn]
    if kind == "circle":
        return RADIUS * e, e
    if kind == "cylinder":  # three rings
        return RADIUS * e + np.c_[0 * turn, 0 * turn, 0.012 * (k % 3 - 1)], e
    if kind == "cone":
        z = 0.015 + 0.01 * (k % 3)
        normal = e * np.cos(HALF_ANGLE) - np.array([0, 0, np.sin(HALF_ANGLE)])
        return z[:, None] * (np.tan(HALF_ANGLE) * e + np.array([0, 0, 1.0])), normal
    lowest = np.cos(np.radians(min(arc, 300.0)) / 2)  # a cap that is so wide; whole balls rest on something
    c, around = 1 - (1 - lowest) * (k + 0.5) / n, 2.399963 * k
    s = np.sqrt(1 - c * c)
    N = np.c_[s * np.cos(around), s * np.sin(around), c]
    return RADIUS * N, N


def random_frame(rng):
    return SE3.exp(np.r_[0.2 * rng.normal(size=3), rng.normal(size=3)])


def error_of(kind, T_hat, T, size_hat, size):
    """``(p, d size)`` of ``T = T_hat exp(B' p) S`` with ``S`` along the symmetries ``(*batch, size + 1)``."""
    gap = SE3.inverse(T_hat) @ T
    if kind in ("circle", "cylinder"):
        over = gap[..., 2, 2] < 0
        gap = np.where(over[..., None, None], gap @ np.diag([1.0, -1.0, -1.0, 1.0]), gap)
    c, u = gap[..., :3, 3], gap[..., :3, 2]
    off = (np.asarray(size) - size_hat)[..., None]
    if kind == "sphere":
        return np.concatenate([c, off], axis=-1)
    across = np.cross(np.array([0.0, 0.0, 1.0]), u)
    sine = np.linalg.norm(across, axis=-1)
    w = across / np.maximum(sine, 1e-300)[..., None] * np.arctan2(sine, u[..., 2])[..., None]
    if kind == "cylinder":
        c = c - u * (c[..., 2:] / u[..., 2:])
    xi = SE3.log(SE3.from_parts(SO3.exp(w), c))
    return np.concatenate([xi[..., list(KINDS[kind].rows)], off], axis=-1)


def nees(error, covariance):
    return np.sum(error * np.linalg.solve(covariance, error[..., None])[..., 0], axis=-1)
