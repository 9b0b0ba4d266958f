"""Propagate body covariances when frames are composed, inverted and related, on arrays with batches.

With ``T = T_mean exp(e)``, ``e ~ N(0, C)``, and ``A = Ad(T2^-1)`` or ``A = Ad(T12^-1)``:

- composing: ``e = A e1 + e2``,
- inverting: ``e' = -Ad(T) e``,
- relating: ``e12 = e2 - A e1``, equation (26) of the paper with the sign of its section 2 (``math.md`` section 3).

All are of first order in the errors (second order in the covariance). :func:`compose_fourth_order` adds the next order,
which matters only for tilts above about 0.1 rad.
"""

from __future__ import annotations

import numpy as np

from tanteo.geometry import se3 as SE3
from tanteo.geometry.typing import Adjoints, Covariances, FloatArray, Transforms

_CHUNK = 1024
"""Number of pairs processed at once; their work arrays fit a cache of 1 MB."""


def congruence(A: Adjoints, C: Covariances) -> Covariances:
    """Return ``A C A'`` over batches.

    Args:
        A: matrices ``(*batch, m, n)``.
        C: covariances ``(*batch, n, n)``.
    """
    return A @ C @ np.swapaxes(A, -1, -2)


def compose_arrays(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, cross: FloatArray | None = None
) -> tuple[Transforms, Covariances]:
    """Return ``T1 T2`` and its body covariance; batches broadcast.

    Args:
        T1: ``T_a_b`` ``(*batch, 4, 4)`` [m].
        C1: body covariance of ``T1`` ``(*batch, 6, 6)``.
        T2: ``T_b_c`` ``(*batch, 4, 4)`` [m].
        C2: body covariance of ``T2`` ``(*batch, 6, 6)``.
        cross: ``E[e1 e2']`` ``(*batch, 6, 6)`` if the errors are correlated; None if independent.
    """
    A = SE3.adjoint_inverse(T2)
    C = congruence(A, C1) + C2
    if cross is not None:
        shared = A @ cross
        C = C + shared + np.swapaxes(shared, -1, -2)
    return T1 @ T2, C


def invert_arrays(T: Transforms, C: Covariances) -> tuple[Transforms, Covariances]:
    """Return ``T^-1`` and its body covariance ``Ad(T) C Ad(T)'``.

    Args:
        T: frames ``(*batch, 4, 4)`` [m].
        C: body covariances ``(*batch, 6, 6)``.
    """
    return SE3.inverse(T), congruence(SE3.adjoint(T), C)


def relate_arrays(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, cross: FloatArray | None = None
) -> tuple[Transforms, Covariances]:
    """Return frame 2 in frame 1, ``T12 = T1^-1 T2``, with its body covariance (paper, (26)); batches broadcast.

    Args:
        T1: ``T_world_f1`` ``(*batch, 4, 4)`` [m].
        C1: body covariance of ``T1`` ``(*batch, 6, 6)``.
        T2: ``T_world_f2`` ``(*batch, 4, 4)`` [m].
        C2: body covariance of ``T2`` ``(*batch, 6, 6)``.
        cross: ``E[e1 e2']`` ``(*batch, 6, 6)`` if the errors are correlated; None if independent.

    Returns:
        ``T12`` ``(*batch, 4, 4)`` and ``Ad C1 Ad' + C2 - Ad X - (Ad X)'`` ``(*batch, 6, 6)``, ``Ad = Ad(T12^-1)``,
        symmetric to rounding.
    """
    T1, T2, C1, C2 = (np.asarray(a, dtype=np.float64) for a in (T1, T2, C1, C2))
    batch = np.broadcast_shapes(T1.shape[:-2], T2.shape[:-2], C1.shape[:-2], C2.shape[:-2])
    T1, C1, T2, C2 = (np.broadcast_to(a, (*batch, *a.shape[-2:])).reshape(-1, *a.shape[-2:]) for a in (T1, C1, T2, C2))
    T12 = np.empty((len(T1), 4, 4))
    C = np.empty((len(T1), 6, 6))
    T12[:, 3] = 0.0, 0.0, 0.0, 1.0
    scratch = _Scratch(min(_CHUNK, len(T12)))
    for start in range(0, len(T12), _CHUNK):
        chunk = slice(start, start + _CHUNK)
        scratch.relate(T1[chunk], C1[chunk], T2[chunk], C2[chunk], T12[chunk], C[chunk])
    T12 = T12.reshape(*batch, 4, 4)
    C = C.reshape(*batch, 6, 6)
    if cross is not None:
        shared = SE3.adjoint_inverse(T12) @ cross
        C = C - shared - np.swapaxes(shared, -1, -2)
    return T12, C


class _Scratch:
    """Work arrays of :func:`relate_arrays`, allocated once per call."""

    def __init__(self, size: int) -> None:
        self.shifted = np.empty((size, 3, 4))
        self.hat = np.zeros((size, 3, 3))
        self.A = np.zeros((size, 6, 6))
        self.AC = np.empty((size, 6, 6))

    def relate(
        self, T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, T12: Transforms, C: Covariances
    ) -> None:
        """Fill the upper rows of ``T12`` and ``C`` of one chunk without allocation."""
        shifted, H, A, AC = (a[: len(T12)] for a in (self.shifted, self.hat, self.A, self.AC))
        shifted[:] = T2[:, :3]
        shifted[:, :, 3] -= T1[:, :3, 3]
        np.matmul(np.swapaxes(T1[:, :3, :3], -1, -2), shifted, out=T12[:, :3])
        # A = Ad(T12^-1) = [R', -R'[p]x; 0, R']
        Rt = np.swapaxes(T12[:, :3, :3], -1, -2)
        p = T12[:, :3, 3]
        H[:, 0, 1], H[:, 1, 2], H[:, 2, 0] = p[:, 2], p[:, 0], p[:, 1]
        for i, j in ((0, 1), (1, 2), (2, 0)):
            np.negative(H[:, i, j], out=H[:, j, i])
        A[:, :3, :3] = A[:, 3:, 3:] = Rt
        np.matmul(Rt, H, out=A[:, :3, 3:])
        np.matmul(A, C1, out=AC)
        np.matmul(AC, np.swapaxes(A, -1, -2), out=C)
        C += C2


def compose_fourth_order(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances
) -> tuple[Transforms, Covariances]:
    """Return ``T1 T2`` and its body covariance to fourth order, for independent errors (Barfoot and Furgale, 2014).

    With ``Q = A C1 A'`` and ``M(S) = E[ad(e)^2]``, ``e ~ N(0, S)``, it adds to the second order
    ``(M(Q) C2 + M(C2) Q + transposes) / 12 + E[uu'] / 4``, ``u = ad(a) b``, ``a ~ N(0, Q)``, ``b ~ N(0, C2)``.

    Args:
        T1: ``T_a_b`` ``(*batch, 4, 4)`` [m].
        C1: body covariance of ``T1`` ``(*batch, 6, 6)``.
        T2: ``T_b_c`` ``(*batch, 4, 4)`` [m].
        C2: body covariance of ``T2`` ``(*batch, 6, 6)``.
    """
    Q, C2 = np.broadcast_arrays(congruence(SE3.adjoint_inverse(T2), C1), np.asarray(C2, dtype=np.float64))
    twelfth = _squared_bracket(Q) @ C2 + _squared_bracket(C2) @ Q
    C = Q + C2 + (twelfth + np.swapaxes(twelfth, -1, -2)) / 12 + _bracket_moment(Q, C2) / 4
    return T1 @ T2, C


def _blocks(C: Covariances) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the four 3 x 3 blocks ``vv, vw, wv, ww`` of ``C``."""
    return C[..., :3, :3], C[..., :3, 3:], C[..., 3:, :3], C[..., 3:, 3:]


def _squared_bracket(C: Covariances) -> FloatArray:
    """Return ``E[ad(e)^2]`` for ``e ~ N(0, C)``, from ``E[[x]x [y]x] = E[y x'] - tr(E[y x']) I``."""
    _, vw, wv, ww = _blocks(C)
    M = np.zeros_like(C)
    for block, moment in ((M[..., :3, :3], ww), (M[..., :3, 3:], vw + wv), (M[..., 3:, 3:], ww)):
        block[...] = moment - np.trace(moment, axis1=-2, axis2=-1)[..., None, None] * np.eye(3)
    return M


def _bracket_moment(Q: Covariances, C: Covariances) -> FloatArray:
    """Return ``E[uu']`` of ``u = ad(a) b = (a_w x b_v + a_v x b_w, a_w x b_w)``, ``a ~ Q``, ``b ~ C`` independent."""
    (Qvv, Qvw, Qwv, Qww), (Cvv, Cvw, Cwv, Cww) = _blocks(Q), _blocks(C)
    out = np.empty_like(Q)
    out[..., :3, :3] = (
        _cross_moment(Qww, Cvv) + _cross_moment(Qwv, Cvw) + _cross_moment(Qvw, Cwv) + _cross_moment(Qvv, Cww)
    )
    out[..., :3, 3:] = _cross_moment(Qww, Cvw) + _cross_moment(Qvw, Cww)
    out[..., 3:, :3] = np.swapaxes(out[..., :3, 3:], -1, -2)
    out[..., 3:, 3:] = _cross_moment(Qww, Cww)
    return out


def _cross_moment(S: FloatArray, U: FloatArray) -> FloatArray:
    """Return ``E[(a x b)(c x d)']`` with ``S = E[a c']``, ``U = E[b d']`` and ``(a, c)`` independent of ``(b, d)``."""
    after = [1, 2, 0]
    before = [2, 0, 1]
    return np.cross(S[..., after], U[..., before], axis=-2) - np.cross(S[..., before], U[..., after], axis=-2)
