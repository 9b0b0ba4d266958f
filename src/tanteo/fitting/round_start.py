"""Where the fit of a round feature begins: algebraic circles and spheres, axes among even directions or of normals."""

from __future__ import annotations

import numpy as np

from tanteo.errors import DegenerateError
from tanteo.fitting.round_steps import RoundState
from tanteo.lie import SO3
from tanteo.typing import FloatArray, IntArray, Vectors

_DIRECTIONS = 100
_STARTS = {"cylinder": 5, "cone": 8}
_LARGE = 25.0
"""A radius that is larger than so many spreads of the points is that of a plane."""
_LEAST_SLOPE = 0.02
"""Of the radius of a cone along its axis, at the start."""
_FLAT = 1e-6
"""Points spread less than this share of their largest spread do not spread at all."""
_APART = float(np.cos(np.radians(15.0)))
"""Axes that two starts make are farther from each other."""


def _directions() -> Vectors:
    """Even directions on half a sphere, a Fibonacci lattice ``(_DIRECTIONS, 3)``."""
    k = np.arange(_DIRECTIONS)
    z, turn = (k + 0.5) / _DIRECTIONS, k * np.pi * (3 - np.sqrt(5.0))
    rho = np.sqrt(1 - z * z)
    return np.stack([rho * np.cos(turn), rho * np.sin(turn), z], axis=-1)


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


def algebraic(flat: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least squares of ``|p|^2 = 2 c p + r^2 - |c|^2``: centres ``(*batch, d)`` and radii of ``(*batch, n, d)``."""
    mean = flat.mean(axis=-2, keepdims=True)
    p = flat - mean
    scale = np.sqrt(np.mean(np.sum(p * p, axis=-1), axis=-1))[..., None, None]
    p = p / np.maximum(scale, 1e-300)
    A = np.concatenate([2 * p, np.ones((*p.shape[:-1], 1))], axis=-1)
    At = np.swapaxes(A, -1, -2)
    ridge = 1e-12 * np.eye(A.shape[-1])
    x = np.linalg.solve(At @ A + ridge, At @ np.sum(p * p, axis=-1)[..., None])[..., 0]
    centre = x[..., :-1]
    r = np.sqrt(np.maximum(x[..., -1] + np.sum(centre * centre, axis=-1), 1e-12))
    return mean[..., 0, :] + centre * scale[..., 0], r * scale[..., 0, 0]


def circle_start(points: Vectors, R: FloatArray | None = None) -> RoundState:
    """The circle in the points' own plane, or in that of the frames ``R``."""
    mean, vectors, _ = spreads(points)
    R = SO3.frame_from_axis(vectors[..., 0], 2) if R is None else R
    flat = (points - mean[..., None, :]) @ R[..., :2]
    centre, r = algebraic(flat)
    return RoundState(R, mean + (R[..., :2] @ centre[..., None])[..., 0], r)


def sphere_start(points: Vectors) -> RoundState:
    """The algebraic sphere."""
    centre, r = algebraic(points)
    return RoundState(np.broadcast_to(np.eye(3), (*r.shape, 3, 3)), centre, r)


def on_either_side(points: Vectors, start: RoundState, size: float, across: bool) -> RoundState:
    """Starts of a known radius on both sides of the points, ``(*batch, 2 starts)``: a short arc fits from either.

    Args:
        points: ``(*batch, 1, n, 3)``.
        start: ``(*batch, starts)``.
        size: the radius [m].
        across: whether centres move across z only, as those of circles and cylinders.
    """
    mean = points.mean(axis=-2)
    local = (points - mean[..., None, :]) @ start.R
    d = 2 if across else 3
    flat = local[..., :d]
    values, vectors = np.linalg.eigh(np.swapaxes(flat, -1, -2) @ flat / flat.shape[-2])
    arm = np.sqrt(np.maximum(size**2 - values.sum(axis=-1), 0.0))
    shift = (start.R[..., :d] @ vectors[..., :1])[..., 0] * arm[..., None]
    u = start.R[..., 2]
    height = np.sum((start.c - mean) * u, axis=-1, keepdims=True) * u if across else np.zeros_like(shift)
    c = np.concatenate([mean + height + shift, mean + height - shift], axis=-2)
    return RoundState(np.concatenate([start.R] * 2, axis=-3), c, np.concatenate([start.s] * 2, axis=-1))


def axis_starts(kind: str, points: Vectors, normals: Vectors | None) -> RoundState:
    """Starts of cylinders or cones ``(*batch, starts)``: the best axes among even directions; one of sensed normals."""
    axes = np.broadcast_to(_directions(), (*points.shape[:-2], _DIRECTIONS, 3))
    axes = np.concatenate([axes, np.swapaxes(spreads(points)[1], -1, -2)], axis=-2)
    if normals is not None and np.count_nonzero(normals.any(axis=-1)) >= (2 if kind == "cylinder" else 3) * max(
        1, int(np.prod(points.shape[:-2]))
    ):
        axes = np.concatenate([axes, _axis_of_normals(kind, normals)[..., None, :]], axis=-2)
    on_axes = _cylinders_on if kind == "cylinder" else _cones_on
    state, misfit = on_axes(points[..., None, :, :], SO3.frame_from_axis(axes, 2))
    chosen = _best_apart(state.R[..., 2], misfit, _STARTS[kind])
    return RoundState(
        np.take_along_axis(state.R, chosen[..., None, None], axis=-3),
        np.take_along_axis(state.c, chosen[..., None], axis=-2),
        np.take_along_axis(state.s, chosen, axis=-1),
    )


def _axis_of_normals(kind: str, normals: Vectors) -> Vectors:
    """The direction with which all sensed normals make the same angle, a right one for cylinders."""
    known = normals.any(axis=-1, keepdims=True)
    mean = np.sum(normals, axis=-2, keepdims=True) / np.maximum(np.sum(known, axis=-2, keepdims=True), 1)
    n = normals if kind == "cylinder" else np.where(known, normals - mean, 0.0)
    return np.asarray(np.linalg.eigh(np.swapaxes(n, -1, -2) @ n)[1][..., :, 0])


def _cylinders_on(points: Vectors, R: FloatArray) -> tuple[RoundState, FloatArray]:
    """The circle across each axis, and how far the points miss it."""
    mean = points.mean(axis=-2)
    local = (points - mean[..., None, :]) @ R
    centre, r = algebraic(local[..., :2])
    off = np.linalg.norm(local[..., :2] - centre[..., None, :], axis=-1) - r[..., None]
    misfit = np.sqrt(np.mean(off * off, axis=-1))
    size = np.sqrt(np.mean(np.sum(local * local, axis=-1), axis=-1))
    misfit = np.where(r > _LARGE * size, np.inf, misfit)
    return RoundState(R, mean + (R[..., :2] @ centre[..., None])[..., 0], np.minimum(r, _LARGE * size)), misfit


def _cones_on(points: Vectors, R: FloatArray) -> tuple[RoundState, FloatArray]:
    """The cone on each axis: its place from ``x^2 + y^2 = 2 a x + 2 b y + m z + n``, then ``rho = k z + l``.

    Also two rings of points, where a term in ``z^2`` is not determined, have both.
    """
    mean = points.mean(axis=-2)
    p = (points - mean[..., None, :]) @ R
    scale = np.sqrt(np.mean(np.sum(p * p, axis=-1), axis=-1))[..., None, None]
    x, y, z = np.moveaxis(p / scale, -1, 0)
    f = _least_squares(np.stack([2 * x, 2 * y, z, np.ones_like(z)], axis=-1), x * x + y * y)
    rho = np.hypot(x - f[..., :1], y - f[..., 1:2])
    line = _least_squares(np.stack([z, np.ones_like(z)], axis=-1), rho)
    into = np.where(line[..., 0] < 0, -1.0, 1.0)
    k = np.clip(np.abs(line[..., 0]), _LEAST_SLOPE, 1 / _LEAST_SLOPE)
    apex = np.clip(-into * line[..., 1] / k, -_LARGE, _LARGE)
    s, along = np.arctan(k), (z - apex[..., None]) * into[..., None]
    off = rho * np.cos(s)[..., None] - along * np.sin(s)[..., None]
    c = mean + (R @ (np.stack([f[..., 0], f[..., 1], apex], axis=-1) * scale[..., 0])[..., None])[..., 0]
    misfit = np.sqrt(np.mean(off * off, axis=-1)) * scale[..., 0, 0]
    turn = np.stack([np.ones_like(into), into, into], axis=-1)
    return RoundState(R * turn[..., None, :], c, s), np.where(np.max(np.abs(f[..., :2]), -1) > _LARGE, np.inf, misfit)


def _least_squares(A: FloatArray, b: FloatArray) -> FloatArray:
    At = np.swapaxes(A, -1, -2)
    return np.asarray(np.linalg.solve(At @ A + 1e-10 * np.eye(A.shape[-1]), At @ b[..., None])[..., 0])


def _best_apart(axes: Vectors, misfit: FloatArray, count: int) -> IntArray:
    """Indices ``(*batch, count)`` of the best axes that are apart from each other."""
    left, chosen = misfit.copy(), []
    for _ in range(count):
        k = np.argmin(left, axis=-1)[..., None]
        near = np.abs(np.sum(axes * np.take_along_axis(axes, k[..., None], axis=-2), axis=-1)) > _APART
        left = np.where(near, np.maximum(left, 1e100), left)
        chosen.append(k)
    return np.concatenate(chosen, axis=-1)
