"""From a function of relative geometry to a value with variance: what all pairwise constraints share.

Seen from the first feature, the second has an origin ``p`` and an axis ``b`` (x of an edge, z of a plane). Every
constraint is a function ``f(p, b)``; with its partial derivatives ``q = df/dp`` and ``r = df/db`` its gradients over
the body errors of both features follow without Euler angles, so nothing is singular at theta = +-pi/2
(``math.md`` sections 3 and 4; in the paper, ``F* J2(+){x12, 0}`` of (12), (15), (17)).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.lie import SO3
from tanteo.typing import Covariances, FloatArray, Rotations, Transforms, Vectors

X_AXIS, Z_AXIS = 0, 2
AXIS_HATS = SO3.hat(np.eye(3))
"""``[e_k]x`` of the three coordinate axes."""


@dataclass(frozen=True, slots=True, eq=False)
class ScalarEstimate:
    """One number per pair.

    Attributes:
        value: ``(*batch,)`` [m or rad].
        variance: ``(*batch,)``, first order.
        g1: gradient over the body error of the first feature ``(*batch, 6)``.
        g2: the same of the second.
    """

    value: FloatArray
    variance: FloatArray
    g1: FloatArray
    g2: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class VectorEstimate:
    """Several numbers per pair, to be tested together.

    Attributes:
        value: ``(*batch, m)``.
        covariance: ``(*batch, m, m)``, first order.
        g1: gradients over the body error of the first feature ``(*batch, m, 6)``.
        g2: the same of the second.
    """

    value: FloatArray
    covariance: Covariances
    g1: FloatArray
    g2: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Relative:
    """Second feature seen from the first.

    Attributes:
        R: ``R12`` ``(*batch, 3, 3)``, columns ``n, o, a``.
        p: origin of the second, in the first frame ``(*batch, 3)`` [m], after the slide.
        slide: how far that origin was moved along the second feature's free directions, in the second frame [m].
    """

    R: Rotations
    p: Vectors
    slide: Vectors


def relative(T1: Transforms, T2: Transforms) -> Relative:
    """``T1^-1 T2`` with both origins where they are; differences are taken before rotating, to keep the digits."""
    R1, R2 = T1[..., :3, :3], T2[..., :3, :3]
    gap = T2[..., :3, 3] - T1[..., :3, 3]
    p = (gap[..., None, :] @ R1)[..., 0, :]
    return Relative(np.swapaxes(R1, -1, -2) @ R2, p, np.zeros_like(p))


def slide_to_middle(pair: Relative, free: Vectors) -> Relative:
    """Re-frame the second feature halfway to the first origin (``math.md`` section 13, rule 3).

    Second-order terms grow with the lever arms; halfway they are shortest for both. The first feature needs no
    re-framing: no constraint depends on where its origin lies along its own free directions.

    Args:
        pair: the geometry before.
        free: 1 on the translations that are free for the second kind, else 0: ``(1,0,0)`` edge, ``(1,1,0)`` plane.
    """
    slide = (-0.5 * pair.p[..., None, :] @ pair.R)[..., 0, :] * free
    return Relative(pair.R, pair.p + (pair.R @ slide[..., None])[..., 0], slide)


def pull_back(pair: Relative, axis_hat: FloatArray, q: FloatArray, r: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gradients over the two body errors of functions with partials ``q`` over ``p`` and ``r`` over the axis.

    ``g1 = -[q, p x q + b x r]`` and ``g2 = [R'q, s x R'q + e x R'r]`` (``math.md`` section 4, with ``X`` the second
    origin and ``s`` its slide).

    Args:
        pair: ``(*batch)`` pairs.
        axis_hat: ``[e]x`` of the second feature's axis in its own frame, ``(*batch, 3, 3)`` or ``(3, 3)``.
        q: ``(*batch, m, 3)``, in the first frame.
        r: the same.

    Returns:
        ``g1, g2``, each ``(*batch, m, 6)``.
    """
    Re = pair.R @ axis_hat
    # q' [p]x = (q x p)', so the minus signs of g1 are inside; R [e]x R' r = b x r
    g1_turn = q @ SO3.hat(pair.p) + r @ (Re @ np.swapaxes(pair.R, -1, -2))
    Rq = q @ pair.R
    g2_turn = -(Rq @ SO3.hat(pair.slide)) - r @ Re
    return np.concatenate([-q, g1_turn], axis=-1), np.concatenate([Rq, g2_turn], axis=-1)


def propagate(
    g1: FloatArray, g2: FloatArray, C1: Covariances, C2: Covariances, C12: FloatArray | None = None
) -> Covariances:
    """First-order covariance ``(*batch, m, m)`` of values with those gradients.

    The cross terms carry the sign of body errors, ``e12 = e2 - J e1``: the paper's appendix 2 turns it over and
    would double common errors instead of cancelling them (``math.md`` section 3).
    """
    g1t, g2t = np.swapaxes(g1, -1, -2), np.swapaxes(g2, -1, -2)
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
    """Assemble a scalar from its partials ``(q, r)`` ``(*batch, 3)``; ``None`` means zero."""
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
    """Assemble a vector from its partials ``(q, r)`` ``(*batch, m, 3)``; ``None`` means zero."""
    zero = np.zeros((*value.shape, 3))
    q = zero if partials[0] is None else partials[0]
    r = zero if partials[1] is None else partials[1]
    g1, g2 = pull_back(pair, AXIS_HATS[axis], q, r)
    return VectorEstimate(value, propagate(g1, g2, *covariances), g1, g2)
