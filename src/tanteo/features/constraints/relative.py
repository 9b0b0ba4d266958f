"""Propagate covariances through functions of the relative geometry of two features.

In the frame of the first feature, the second has an origin ``p`` and an axis ``b`` (x of an edge, z of a plane). Every
constraint is a function ``f(p, b)``. Its partial derivatives ``q = df/dp`` and ``r = df/db`` give its gradients over
the body errors of both features without Euler angles, so nothing is singular at theta = +-pi/2 (``math.md`` sections 3
and 4; in the paper, ``F* J2(+){x12, 0}`` of (12), (15), (17)).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry import SO3
from tanteo.geometry.typing import Covariances, FloatArray, Rotations, Transforms, Vectors

X_AXIS, Z_AXIS = 0, 2
AXIS_HATS = SO3.hat(np.eye(3))
"""Matrices ``[e_k]x`` of the three coordinate axes."""


@dataclass(frozen=True, slots=True, eq=False)
class ScalarEstimate:
    """One value per pair.

    Attributes:
        value: values ``(*batch,)`` [m or rad].
        variance: first-order variances ``(*batch,)``.
        g1: gradients over the body error of the first feature ``(*batch, 6)``.
        g2: gradients over the body error of the second feature ``(*batch, 6)``.
    """

    value: FloatArray
    variance: FloatArray
    g1: FloatArray
    g2: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class VectorEstimate:
    """Several values per pair, to be tested together.

    Attributes:
        value: values ``(*batch, m)``.
        covariance: first-order covariances ``(*batch, m, m)``.
        g1: gradients over the body error of the first feature ``(*batch, m, 6)``.
        g2: gradients over the body error of the second feature ``(*batch, m, 6)``.
    """

    value: FloatArray
    covariance: Covariances
    g1: FloatArray
    g2: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Relative:
    """Second feature in the frame of the first.

    Attributes:
        R: rotation ``R12`` ``(*batch, 3, 3)``, columns ``n, o, a``.
        p: origin of the second in the first frame ``(*batch, 3)`` [m], after re-framing.
        slide: displacement of that origin along the second feature's free directions, in the second frame
            ``(*batch, 3)`` [m].
    """

    R: Rotations
    p: Vectors
    slide: Vectors


def relative(T1: Transforms, T2: Transforms) -> Relative:
    """Return ``T1^-1 T2`` with both origins unchanged; positions are subtracted before rotation to preserve digits.

    Args:
        T1: frames of the first features ``(*batch, 4, 4)`` [m].
        T2: frames of the second features ``(*batch, 4, 4)`` [m].
    """
    R1 = T1[..., :3, :3]
    R2 = T2[..., :3, :3]
    gap = T2[..., :3, 3] - T1[..., :3, 3]
    p = (gap[..., None, :] @ R1)[..., 0, :]
    return Relative(np.swapaxes(R1, -1, -2) @ R2, p, np.zeros_like(p))


def slide_to_middle(pair: Relative, free: Vectors) -> Relative:
    """Re-frame the second feature halfway to the first origin (``math.md`` section 13, rule 3).

    Second-order terms grow with the lever arms, which are shortest for both features at the middle. The first feature
    needs no re-framing, because no constraint depends on its origin along its own free directions.

    Args:
        pair: relative geometry.
        free: mask of the second kind's free translations: ``(1,0,0)`` for an edge, ``(1,1,0)`` for a plane.
    """
    slide = (-0.5 * pair.p[..., None, :] @ pair.R)[..., 0, :] * free
    return Relative(pair.R, pair.p + (pair.R @ slide[..., None])[..., 0], slide)


def pull_back(pair: Relative, axis_hat: FloatArray, q: FloatArray, r: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return gradients over the two body errors of functions with partials ``q`` over ``p`` and ``r`` over the axis.

    ``g1 = -[q, p x q + b x r]`` and ``g2 = [R'q, s x R'q + e x R'r]`` (``math.md`` section 4, with ``X`` the second
    origin and ``s`` its slide).

    Args:
        pair: relative geometry of the pairs.
        axis_hat: ``[e]x`` of the second feature's axis in its own frame, ``(*batch, 3, 3)`` or ``(3, 3)``.
        q: partial derivatives by ``p`` in the first frame ``(*batch, m, 3)``.
        r: partial derivatives by the axis in the first frame ``(*batch, m, 3)``.

    Returns:
        Gradients ``g1, g2``, each ``(*batch, m, 6)``.
    """
    Re = pair.R @ axis_hat
    # q' [p]x = (q x p)' includes the minus sign of g1; R [e]x R' r = b x r
    g1_turn = q @ SO3.hat(pair.p) + r @ (Re @ np.swapaxes(pair.R, -1, -2))
    Rq = q @ pair.R
    g2_turn = -(Rq @ SO3.hat(pair.slide)) - r @ Re
    return np.concatenate([-q, g1_turn], axis=-1), np.concatenate([Rq, g2_turn], axis=-1)


def propagate(
    g1: FloatArray, g2: FloatArray, C1: Covariances, C2: Covariances, C12: FloatArray | None = None
) -> Covariances:
    """Return the first-order covariance ``(*batch, m, m)`` of values with given gradients.

    The cross terms have the sign of body errors, ``e12 = e2 - J e1``. The paper's appendix 2 reverses it and would
    double common errors instead of cancelling them (``math.md`` section 3).

    Args:
        g1: gradients over the first body error ``(*batch, m, 6)``.
        g2: gradients over the second body error ``(*batch, m, 6)``.
        C1: body covariances of the first features ``(*batch, 6, 6)``.
        C2: body covariances of the second features ``(*batch, 6, 6)``.
        C12: ``E[e1 e2']`` if the errors are correlated; None if independent.
    """
    g1t = np.swapaxes(g1, -1, -2)
    g2t = np.swapaxes(g2, -1, -2)
    S = g1 @ C1 @ g1t + g2 @ C2 @ g2t
    if C12 is not None:
        cross = g1 @ C12 @ g2t
        S = S + cross + np.swapaxes(cross, -1, -2)
    return S


def scalar_estimate(
    pair: Relative,
    axis: int,
    value: FloatArray,
    partials: tuple[FloatArray | None, FloatArray | None],
    covariances: tuple[Covariances, Covariances, FloatArray | None],
) -> ScalarEstimate:
    """Return a scalar estimate from values and partial derivatives.

    Args:
        pair: relative geometry of the pairs.
        axis: coordinate axis of the second feature.
        value: values ``(*batch,)``.
        partials: derivatives ``(q, r)`` by origin and axis, each ``(*batch, 3)``; None for zero.
        covariances: body covariances of both features, and their cross covariance or None.
    """
    full = vector_estimate(
        pair,
        axis,
        value[..., None],
        (
            None if partials[0] is None else partials[0][..., None, :],
            None if partials[1] is None else partials[1][..., None, :],
        ),
        covariances,
    )
    return ScalarEstimate(value, full.covariance[..., 0, 0], full.g1[..., 0, :], full.g2[..., 0, :])


def vector_estimate(
    pair: Relative,
    axis: int,
    value: FloatArray,
    partials: tuple[FloatArray | None, FloatArray | None],
    covariances: tuple[Covariances, Covariances, FloatArray | None],
) -> VectorEstimate:
    """Return a vector estimate from values and partial derivatives.

    Args:
        pair: relative geometry of the pairs.
        axis: coordinate axis of the second feature.
        value: values ``(*batch, m)``.
        partials: derivatives ``(q, r)`` by origin and axis, each ``(*batch, m, 3)``; None for zero.
        covariances: body covariances of both features, and their cross covariance or None.
    """
    zero = np.zeros((*value.shape, 3))
    q = zero if partials[0] is None else partials[0]
    r = zero if partials[1] is None else partials[1]
    g1, g2 = pull_back(pair, AXIS_HATS[axis], q, r)
    return VectorEstimate(value, propagate(g1, g2, *covariances), g1, g2)
