"""Compute on SE(3).

Rigid motions ``(*batch, 4, 4)`` and tangents ``[v, w]`` ``(*batch, 6)``, translation first [m, rad].

Source: Barfoot and Furgale (2014) for ``Exp``, ``Log``, ``Ad`` and the right Jacobian. Below one radian, where the
closed forms of its coefficients cancel, their power series are used.
"""

from __future__ import annotations

import math

import numpy as np

from tanteo.geometry import so3
from tanteo.geometry.typing import Adjoints, FloatArray, Rotations, Tangents, Transforms, Vectors

_SERIES_TERMS = 12

_k = np.arange(1, 13)
_BERNOULLI = np.array([
    1 / 12, -1 / 720, 1 / 30240, -1 / 1209600, 1 / 47900160, -691 / 1307674368000, 1 / 74724249600,
    -3.3896802963225827e-13, 8.586062056277845e-15, -2.174868698558062e-16, 5.5090028283602295e-18,
    -1.3954464685812522e-19,
])  # fmt: skip
"""Bernoulli numbers over factorials, ``B_2k / (2 k)!``."""

_INVERSE = np.stack([(2 - _k) * _BERNOULLI, _k * np.append(_BERNOULLI[1:], 0.0)], axis=1)
"""Power series of the two coefficients of the inverse right Jacobian, in the negative squared angle ``(12, 2)``."""


def from_parts(R: Rotations, p: Vectors) -> Transforms:
    """Return the motion ``x -> R x + p`` ``(*batch, 4, 4)``.

    Args:
        R: rotations ``(*batch, 3, 3)``.
        p: translations ``(*batch, 3)`` [m].
    """
    R = np.asarray(R, dtype=np.float64)
    p = np.asarray(p, dtype=np.float64)
    T = np.zeros((*np.broadcast_shapes(R.shape[:-2], p.shape[:-1]), 4, 4))
    T[..., :3, :3], T[..., :3, 3], T[..., 3, 3] = R, p, 1.0
    return T


def rotation(T: Transforms) -> Rotations:
    """Return the rotation block ``(*batch, 3, 3)``.

    Args:
        T: motions ``(*batch, 4, 4)``.
    """
    return T[..., :3, :3]


def translation(T: Transforms) -> Vectors:
    """Return the translation column ``(*batch, 3)``.

    Args:
        T: motions ``(*batch, 4, 4)``.
    """
    return T[..., :3, 3]


def inverse(T: Transforms) -> Transforms:
    """Return ``T_b_a`` of ``T_a_b``, by transposition.

    Args:
        T: motions ``(*batch, 4, 4)``.
    """
    Rt = so3.inverse(T[..., :3, :3])
    return from_parts(Rt, -apply(Rt, T[..., :3, 3]))


def apply(R_or_T: FloatArray, points: Vectors) -> Vectors:
    """Map points by a motion, or rotate vectors; batches broadcast.

    Args:
        R_or_T: motion ``(*batch, 4, 4)`` or rotation ``(*batch, 3, 3)``.
        points: points or vectors ``(*batch, 3)``.
    """
    out = np.einsum("...ij,...j->...i", R_or_T[..., :3, :3], points)
    return out + R_or_T[..., :3, 3] if R_or_T.shape[-1] == 4 else out


def exp(xi: Tangents) -> Transforms:
    """Return the exponential: the motion of the twist ``[v, w]`` over unit time ``(*batch, 4, 4)``.

    Args:
        xi: tangents ``(*batch, 6)``.
    """
    xi = np.asarray(xi, dtype=np.float64)
    v = xi[..., :3]
    w = xi[..., 3:]
    a, b, c = so3.sinc_terms(np.linalg.norm(w, axis=-1))
    W = so3.hat(w)
    R = np.eye(3) + a[..., None, None] * W + b[..., None, None] * (W @ W)
    wv = so3.cross(w, v)
    return from_parts(R, v + b[..., None] * wv + c[..., None] * so3.cross(w, wv))


def log(T: Transforms) -> Tangents:
    """Return the inverse of :func:`exp` with a rotation of at most pi ``(*batch, 6)``; accurate from 0 to pi.

    Args:
        T: motions ``(*batch, 4, 4)``.
    """
    w = so3.log(T[..., :3, :3])
    k = so3.inverse_coefficient(np.linalg.norm(w, axis=-1))  # V^-1 = I - [w]x / 2 + k [w]x^2
    v = T[..., :3, 3]
    wv = so3.cross(w, v)
    return np.concatenate([v - 0.5 * wv + k[..., None] * so3.cross(w, wv), w], axis=-1)


def adjoint(T: Transforms) -> Adjoints:
    """Return ``Ad(T)`` with ``T exp(xi) T^-1 = exp(Ad(T) xi)``, which is the paper's ``WJF`` for ``T = T_W_F``.

    Args:
        T: motions ``(*batch, 4, 4)``.
    """
    return _adjoint_blocks(T[..., :3, :3], T[..., :3, 3])


def adjoint_inverse(T: Transforms) -> Adjoints:
    """Return ``Ad(T^-1)``, which is the paper's ``FJW`` for ``T = T_W_F`` (section 2).

    Args:
        T: motions ``(*batch, 4, 4)``.
    """
    Rt = so3.inverse(T[..., :3, :3])
    return _adjoint_blocks(Rt, -apply(Rt, T[..., :3, 3]))


def _adjoint_blocks(R: Rotations, p: Vectors) -> Adjoints:
    Ad = np.zeros((*R.shape[:-2], 6, 6))
    Ad[..., :3, :3] = Ad[..., 3:, 3:] = R
    # rows of [p]x R, written out for speed: all propagation of errors calls this
    x = p[..., 0, None]
    y = p[..., 1, None]
    z = p[..., 2, None]
    Ad[..., 0, 3:] = y * R[..., 2, :] - z * R[..., 1, :]
    Ad[..., 1, 3:] = z * R[..., 0, :] - x * R[..., 2, :]
    Ad[..., 2, 3:] = x * R[..., 1, :] - y * R[..., 0, :]
    return Ad


def ad(xi: Tangents) -> Adjoints:
    """Return the Lie bracket matrix ``ad(xi)``, with ``Ad(exp(xi)) = expm(ad(xi))``.

    Args:
        xi: tangents ``(*batch, 6)``.
    """
    xi = np.asarray(xi, dtype=np.float64)
    out = np.zeros((*xi.shape, 6))
    out[..., :3, :3] = out[..., 3:, 3:] = so3.hat(xi[..., 3:])
    out[..., :3, 3:] = so3.hat(xi[..., :3])
    return out


def right_jacobian(xi: Tangents) -> Adjoints:
    """Return the right Jacobian ``Jr`` with ``exp(xi + d) ~ exp(xi) exp(Jr d)``.

    Args:
        xi: tangents ``(*batch, 6)``.
    """
    xi = np.asarray(xi, dtype=np.float64)
    A = ad(-xi)
    coefficients = _jacobian_coefficients(np.linalg.norm(xi[..., 3:], axis=-1))
    J = np.eye(6) + np.zeros_like(A)
    power = np.eye(6)
    for c in coefficients:
        power = power @ A
        J = J + c[..., None, None] * power
    return J


def right_jacobian_inverse(xi: Tangents) -> Adjoints:
    """Return the inverse of :func:`right_jacobian`: ``log(exp(xi) exp(d)) ~ xi + Jr^-1 d``.

    Singular at an angle of 2 pi.

    It is ``x / (1 - exp(-x))`` of ``x = ad(xi)``. By the Cayley-Hamilton theorem only the powers 1, 2 and 4 are needed.

    Args:
        xi: tangents ``(*batch, 6)``.
    """
    xi = np.asarray(xi, dtype=np.float64)
    A = ad(xi)
    b, c = _inverse_coefficients(np.linalg.norm(xi[..., 3:], axis=-1)[..., None, None])
    square = A @ A
    return np.eye(6) + 0.5 * A + b * square + c * (square @ square)


def _inverse_coefficients(t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the coefficients of ``ad(xi)^2`` and ``ad(xi)^4`` in the inverse at rotation angle ``t``."""
    small = t < 1.0
    u = -(np.where(small, t, 0.0) ** 2)
    b, c = np.zeros((2, *u.shape))
    for of_b, of_c in _INVERSE[::-1]:
        b = b * u + of_b
        c = c * u + of_c
    if small.all():
        return b, c
    s = np.where(small, 1.0, t)
    sin = np.sin(s)
    less = 4 * s * (1 - np.cos(s))
    return np.where(small, b, 2 / s**2 - (s + 3 * sin) / less), np.where(small, c, (s**-2 - (s + sin) / less) / s**2)


def _jacobian_coefficients(t: FloatArray) -> list[FloatArray]:
    """Return the four coefficients of ``ad(-xi)^1..4`` at rotation angle ``t``."""
    small = t < 1.0
    u = np.where(small, t, 0.0) ** 2
    s = np.where(small, 1.0, t)
    sin = np.sin(s)
    cos = np.cos(s)
    closed = [
        (4 - s * sin - 4 * cos) / (2 * s**2),
        (4 * s - 5 * sin + s * cos) / (2 * s**3),
        (2 - s * sin - 2 * cos) / (2 * s**4),
        (2 * s - 3 * sin + s * cos) / (2 * s**5),
    ]
    series = [_series(u, 1, 4, 0), _series(u, 1, 4, 1), _series(u, 2, 2, 0), _series(u, 2, 2, 1)]
    return [np.where(small, a, b) for a, b in zip(series, closed, strict=True)]


def _series(u: FloatArray, first: int, shift: int, odd: int) -> FloatArray:
    """Return ``1/2 sum_m (-1)^m (2 m - shift) / (2 m + odd)! u^(m - first)`` by Horner's scheme."""
    total = np.zeros_like(u)
    for m in range(first + _SERIES_TERMS, first - 1, -1):
        total = total * u + 0.5 * (-1) ** m * (2 * m - shift) / math.factorial(2 * m + odd)
    return total
