"""Compute on SO(3): rotations ``(*batch, 3, 3)`` and rotation vectors ``(*batch, 3)`` [rad]."""

from __future__ import annotations

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry.typing import FloatArray, Rotations, Vectors

_SERIES_BELOW = 1e-2
"""Angle [rad] below which quotients of sine and cosine are computed by their series (error below 1e-16)."""


def cross(a: Vectors, b: Vectors) -> Vectors:
    """Return cross products over the last axis; several times faster than ``np.cross`` on small arrays.

    Args:
        a: vectors ``(*batch, 3)``.
        b: vectors ``(*batch, 3)``.
    """
    out = np.empty(np.broadcast_shapes(np.shape(a), np.shape(b)))
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out


def hat(w: Vectors) -> FloatArray:
    """Return skew-symmetric matrices ``[w]x`` ``(*batch, 3, 3)`` with ``hat(w) @ v == cross(w, v)``.

    Args:
        w: vectors ``(*batch, 3)``.
    """
    w = np.asarray(w, dtype=np.float64)
    out = np.zeros((*w.shape, 3))
    x = w[..., 0]
    y = w[..., 1]
    z = w[..., 2]
    out[..., 0, 1], out[..., 0, 2] = -z, y
    out[..., 1, 0], out[..., 1, 2] = z, -x
    out[..., 2, 0], out[..., 2, 1] = -y, x
    return out


def vee(W: FloatArray) -> Vectors:
    """Return the vector of the skew-symmetric part of ``W``, the inverse of :func:`hat`.

    Args:
        W: matrices ``(*batch, 3, 3)``.
    """
    W = np.asarray(W, dtype=np.float64)
    pairs = ((2, 1), (0, 2), (1, 0))
    return 0.5 * np.stack([W[..., i, j] - W[..., j, i] for i, j in pairs], axis=-1)


def sinc_terms(angle: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return ``sin t / t``, ``(1 - cos t) / t^2`` and ``(t - sin t) / t^3``, accurate at every angle.

    Args:
        angle: angles ``t`` [rad].
    """
    t = np.asarray(angle, dtype=np.float64)
    t2 = t * t
    small = t < _SERIES_BELOW
    safe = np.where(small, 1.0, t)
    half = np.sin(0.5 * safe)
    a = np.where(small, 1 - t2 / 6 * (1 - t2 / 20 * (1 - t2 / 42)), np.sin(safe) / safe)
    b = np.where(small, 0.5 - t2 / 24 * (1 - t2 / 30 * (1 - t2 / 56)), 2 * (half / safe) ** 2)
    c = np.where(small, 1 / 6 - t2 / 120 * (1 - t2 / 42 * (1 - t2 / 72)), (safe - np.sin(safe)) / safe**3)
    return a, b, c


def exp(w: Vectors) -> Rotations:
    """Return the rotation by the angle ``|w|`` about the axis ``w`` (Rodrigues' formula).

    Args:
        w: rotation vectors ``(*batch, 3)`` [rad].
    """
    w = np.asarray(w, dtype=np.float64)
    a, b, _ = sinc_terms(np.linalg.norm(w, axis=-1))
    W = hat(w)
    return np.eye(3) + a[..., None, None] * W + b[..., None, None] * (W @ W)


def log(R: Rotations) -> Vectors:
    """Return the rotation vector of ``R``, of length at most pi; accurate from 0 to pi by the quaternion.

    Args:
        R: rotations ``(*batch, 3, 3)``.
    """
    q = as_quaternion(R)
    w = q[..., 0]
    v = q[..., 1:]
    n = np.linalg.norm(v, axis=-1)
    tiny = n < 1e-9  # there w is 1 to the last digit
    scale = np.where(tiny, 2.0, 2 * np.arctan2(n, w) / np.where(tiny, 1.0, n))
    return scale[..., None] * v


def inverse(R: Rotations) -> Rotations:
    """Return the transpose over the last two axes.

    Args:
        R: rotations ``(*batch, 3, 3)``.
    """
    return np.swapaxes(np.asarray(R, dtype=np.float64), -1, -2)


def right_jacobian(w: Vectors) -> FloatArray:
    """Return the right Jacobian ``Jr`` ``(*batch, 3, 3)`` with ``exp(w + d) ~ exp(w) exp(Jr d)``.

    Args:
        w: rotation vectors ``(*batch, 3)`` [rad].
    """
    w = np.asarray(w, dtype=np.float64)
    _, b, c = sinc_terms(np.linalg.norm(w, axis=-1))
    W = hat(w)
    return np.eye(3) - b[..., None, None] * W + c[..., None, None] * (W @ W)


def right_jacobian_inverse(w: Vectors) -> FloatArray:
    """Return the inverse of :func:`right_jacobian` ``(*batch, 3, 3)``; singular at an angle of 2 pi.

    Args:
        w: rotation vectors ``(*batch, 3)`` [rad].
    """
    w = np.asarray(w, dtype=np.float64)
    W = hat(w)
    k = inverse_coefficient(np.linalg.norm(w, axis=-1))
    return np.eye(3) + 0.5 * W + k[..., None, None] * (W @ W)


def inverse_coefficient(angle: FloatArray) -> FloatArray:
    """Return the coefficient of ``hat(w)^2`` in the inverse of the right Jacobian.

    Args:
        angle: angles ``|w|`` [rad].
    """
    t = np.asarray(angle, dtype=np.float64)
    a, b, _ = sinc_terms(t)
    small = t < _SERIES_BELOW
    return np.where(small, (1 + t * t / 60 * (1 + t * t / 42)) / 12, (1 - a / (2 * b)) / np.where(small, 1.0, t * t))


def as_quaternion(R: Rotations) -> FloatArray:
    """Return unit quaternions ``(w, x, y, z)`` with ``w >= 0``, from the largest of the four components.

    Args:
        R: rotations ``(*batch, 3, 3)``.
    """
    R = np.asarray(R, dtype=np.float64)
    q = np.empty((*R.shape[:-2], 4))
    q[..., 0] = 1 + R[..., 0, 0] + R[..., 1, 1] + R[..., 2, 2]
    for k, (i, j) in enumerate(((2, 1), (0, 2), (1, 0)), start=1):
        q[..., k] = R[..., i, j] - R[..., j, i]
    far = q[..., 0] < 1.0  # rotations of more than 120 degrees: another component may be the largest
    if far.any():
        q[far] = _from_largest(R[far])
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(q[..., :1] < 0, -q, q)


def _from_largest(R: Rotations) -> FloatArray:
    """Return unnormalized quaternions ``(n, 4)``, each from the row of its largest component."""
    xx = R[:, 0, 0]
    yy = R[:, 1, 1]
    zz = R[:, 2, 2]
    wx = R[:, 2, 1] - R[:, 1, 2]
    wy = R[:, 0, 2] - R[:, 2, 0]
    wz = R[:, 1, 0] - R[:, 0, 1]
    xy = R[:, 0, 1] + R[:, 1, 0]
    xz = R[:, 0, 2] + R[:, 2, 0]
    yz = R[:, 1, 2] + R[:, 2, 1]
    rows = [
        [1 + xx + yy + zz, wx, wy, wz],
        [wx, 1 + xx - yy - zz, xy, xz],
        [wy, xy, 1 - xx + yy - zz, yz],
        [wz, xz, yz, 1 - xx - yy + zz],
    ]
    table = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    best = np.argmax(np.diagonal(table, axis1=-2, axis2=-1), axis=-1)
    return np.asarray(table[np.arange(len(R)), best])


def from_quaternion(q: FloatArray) -> Rotations:
    """Return the rotation of the quaternion ``(w, x, y, z)``, which is normalized first.

    Args:
        q: quaternions ``(*batch, 4)`` of any length except zero.

    Raises:
        InputError: a quaternion is not finite or has length zero.
    """
    q = np.asarray(q, dtype=np.float64)
    n = np.linalg.norm(q, axis=-1, keepdims=True)
    if not np.all(np.isfinite(n) & (n > 0)):
        raise InputError("quaternion: expected four finite numbers (w, x, y, z), not all zero, got another value.")
    w, x, y, z = np.moveaxis(q / n, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def axis_rotation(axis: int, angle: FloatArray | float) -> Rotations:
    """Return the rotation about a coordinate axis ``(*batch, 3, 3)``.

    Args:
        axis: coordinate axis 0, 1 or 2.
        angle: angles ``(*batch,)`` [rad].
    """
    w = np.zeros((*np.shape(angle), 3))
    w[..., axis] = angle
    return exp(w)


def align(source: Vectors, target: Vectors, weights: FloatArray | None = None) -> Rotations:
    """Return the rotation that best maps directions ``source`` onto ``target`` (Wahba's problem, solved by SVD).

    Args:
        source: unit vectors ``(*batch, n, 3)`` in the frame that the result maps from.
        target: unit vectors ``(*batch, n, 3)`` in the frame that the result maps to.
        weights: weights ``(*batch, n)``; None for 1.

    Returns:
        Rotations ``(*batch, 3, 3)`` of determinant +1 that minimize ``sum w |target - R source|^2``. With fewer than
        two independent directions it is one of several minimizers.
    """
    w = np.ones(np.shape(source)[:-1]) if weights is None else weights
    U, _, Vt = np.linalg.svd(np.einsum("...n,...ni,...nj->...ij", w, target, source))
    sign = np.sign(np.linalg.det(U @ Vt))
    U = np.concatenate([U[..., :2], U[..., 2:] * sign[..., None, None]], axis=-1)
    return U @ Vt


def frame_from_axis(direction: Vectors, axis: int) -> Rotations:
    """Return right-handed frames with a given coordinate axis; the rotation about it is arbitrary but deterministic.

    Args:
        direction: directions ``(*batch, 3)`` of any length except zero.
        axis: coordinate axis 0, 1 or 2 that points along ``direction``.
    """
    d = np.asarray(direction, dtype=np.float64)
    d = d / np.linalg.norm(d, axis=-1, keepdims=True)
    helper = np.eye(3)[np.argmin(np.abs(d), axis=-1)]
    e = cross(d, helper)
    e = e / np.linalg.norm(e, axis=-1, keepdims=True)
    columns = [d, e, cross(d, e)]
    return np.stack(columns[-axis:] + columns[:-axis] if axis else columns, axis=-1)
