"""Hand-eye calibration: the pose of a camera on the hand, or beside the robot, with its covariance.

A robot reports poses ``T_base_hand``, and a camera reports poses ``T_camera_target`` of a target that does not move.
With ``A = T_base_hand`` for a camera on the hand, and its inverse for a fixed camera whose target is on the hand,

    ``A_i X B_i = Y``,

where ``X`` is the pose of the camera in the frame that carries it and ``Y`` that of the target in the other frame. Both
are estimated by maximum likelihood from the deviations of the observed from the predicted target poses. The standard
deviations of an observation across and along the optical axis and of its rotation are estimated, too, as variance
components, so nothing needs to be stated. Samples that contradict the others are excluded by a test
that includes the error of the estimated variances.

Sources: Shah (2013), Solving the robot-world/hand-eye calibration problem using the Kronecker product, J. Mechanisms
and Robotics 5(3), for the start; Strobl and Hirzinger (2006), Optimal hand-eye calibration, IROS, for the weights; Chen
(1991), A screw motion approach to uniqueness analysis of head-eye geometry, CVPR, for the unobserved motions; Cook and
Weisberg (1982), Residuals and Influence in Regression, for the excluded samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import beta, f

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3, check_transforms, maximize
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, Transforms
from tanteo.values import Value

_LEAST = 3
"""Least number of samples: two relative motions with different axes determine the calibration (Chen 1991)."""

_USELESS = 0.02, float(np.radians(2.0))
"""Standard deviations above which a direction of the camera's pose is not observed [m, rad]: a ruler is better."""

_STARTS = 100
"""Number of triples of samples from which a start is computed: with 30 % outliers all triples fail once in 10^18."""

_PASSES = 30
"""Limit of the passes of Gauss-Newton and of the variance components; both end when nothing changes."""

_LEVEL = 0.01
"""Probability that a set of samples without outliers loses a sample."""

_FOLLOWED = 1e-9
"""Numerical: variance of a deviation, over that of a sample, below which the estimate follows the sample entirely."""

_FLOOR = 1e-6, 1e-6, 1e-6
"""Smallest standard deviations of the components: across, along the axis [m], rotation [rad]. Files round there."""

_TURN = float(np.radians(35.0))
"""Rotation of a proposed pose of the hand about an axis through the target [rad]: targets are detected up to about 60
degrees, and the information grows with the square of the angle."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class HandEye(Value):
    """Result of a hand-eye calibration.

    Attributes:
        status: ``calibrated``, or ``insufficient`` if the motions leave a direction of the camera's pose free.
        mounted: ``hand`` if the camera is on the hand, ``world`` if it is fixed beside the robot.
        T_mount_camera: pose of the camera ``(4, 4)`` [m] in the hand's frame, or in the base's if it is fixed.
        covariance: its covariance ``(6, 6)``, order x y z rx ry rz, camera frame, right perturbation [m, rad].
        T_other_target: pose of the target ``(4, 4)`` [m] in the base's frame, or in the hand's if the camera is fixed.
        covariance_target: its covariance ``(6, 6)``, target frame, right perturbation.
        sds: estimated standard deviations of one observation of the target: across and along the optical axis [m],
            rotation about each axis [rad].
        deviations: observed minus predicted target of each sample ``(n, 6)``: position in the camera's frame [m],
            rotation in the target's frame [rad].
        used: mask of the samples that were not excluded ``(n,)``.
        unobserved: directions that the motions leave free, with what to do, as text.
        T_next: pose ``T_base_hand`` ``(4, 4)`` [m] that is expected to reduce the uncertainty most.
        next_motion: the same as text.
    """

    status: Literal["calibrated", "insufficient"]
    mounted: Literal["hand", "world"]
    T_mount_camera: Transforms
    covariance: Covariances
    T_other_target: Transforms
    covariance_target: Covariances
    sds: tuple[float, float, float]
    deviations: FloatArray
    used: BoolArray
    unobserved: tuple[str, ...]
    T_next: Transforms
    next_motion: str

    @property
    def message(self) -> str:
        """Result as text, with what to do."""
        sds = np.sqrt(np.diag(self.covariance))
        frame = "hand" if self.mounted == "hand" else "base"
        gone = [str(k + 1) for k in np.flatnonzero(~self.used)]
        text = (
            f"The camera is known in the frame of the {frame} to {1e3 * sds[:3].max():.3g} mm and "
            f"{np.degrees(sds[3:].max()):.2g} deg (largest sds)."
        )
        if self.unobserved:
            text = f"The motions do not determine the camera's pose: {'; '.join(self.unobserved)}."
        if gone:
            text += f" Samples that contradict the others, and are excluded: {', '.join(gone)}. Check them."
        how = "" if self.mounted == "hand" else ", relative to the hand, by moving the hand"
        return f"{text} Next: {self.next_motion}{how}."


def calibrate_hand_eye(
    Ts_base_hand: Transforms,
    Ts_camera_target: Transforms,
    *,
    mounted: Literal["hand", "world"] = "hand",
    seed: int = 0,
) -> HandEye:
    """Calibrate a camera on a hand, or beside a robot, from poses of the hand and of a target.

    Args:
        Ts_base_hand: poses of the hand that the robot reported ``(n, 4, 4)`` [m].
        Ts_camera_target: poses of the target that the camera reported at the same time ``(n, 4, 4)`` [m].
        mounted: where the camera is: on the ``hand``, with the target fixed in the world; or fixed in the ``world``,
            with the target on the hand.
        seed: seed of the random triples of the start.

    Returns:
        The poses with covariances, the samples that were excluded, what is not observed, and the next pose.

    Raises:
        InputError: there are fewer than three samples, the numbers of poses differ, or one is no rigid motion.

    Example:
        >>> import numpy as np
        >>> rng = np.random.default_rng(0)
        >>> X = SE3.exp(np.array([0.05, 0.0, 0.1, 0.0, 0.2, 0.0]))  # camera in the hand
        >>> Y = SE3.exp(np.array([0.6, 0.1, 0.0, 0.0, 0.0, 1.0]))  # target in the base
        >>> A = SE3.exp(rng.normal(size=(12, 6)) * 0.4)
        >>> B = SE3.inverse(A @ X) @ Y @ SE3.exp(rng.normal(size=(12, 6)) * 1e-4)
        >>> found = calibrate_hand_eye(A, B)
        >>> found.status, bool(np.abs(found.T_mount_camera - X).max() < 1e-3)
        ('calibrated', True)
    """
    A = check_transforms("Ts_base_hand", Ts_base_hand)
    B = check_transforms("Ts_camera_target", Ts_camera_target)
    if A.ndim != 3 or A.shape != B.shape:
        raise InputError(
            f"samples: expected one pose of the target for each pose of the hand, got shapes {A.shape} and {B.shape}."
        )
    if len(A) < _LEAST:
        raise InputError(f"samples: expected {_LEAST} or more, got {len(A)}. Rotate the hand about two axes.")
    if mounted not in ("hand", "world"):
        raise InputError(f"mounted: expected hand or world, got '{mounted}'. State where the camera is.")
    A = A if mounted == "hand" else SE3.inverse(A)
    X, Y, used = _start(A, B, np.random.default_rng(seed))
    sds = _robust_sds(A, B, X, Y)
    for _ in range(len(A)):
        X, Y, sds, C = _fitted(A[used], B[used], X, Y, sds)
        kept = _consistent(A, B, X, Y, sds, used)
        if np.array_equal(kept, used) or kept.sum() < _LEAST:
            break
        used = kept
    unobserved = _unobserved(C)
    T, words = _next(A[used], X, Y, sds, C)
    return HandEye(
        status="insufficient" if unobserved else "calibrated",
        mounted=mounted,
        T_mount_camera=X,
        covariance=C[:6, :6],
        T_other_target=Y,
        covariance_target=C[6:, 6:],
        sds=(float(sds[0]), float(sds[1]), float(sds[2])),
        deviations=_deviations(A, B, X, Y),
        used=used,
        unobserved=unobserved,
        T_next=T if mounted == "hand" else SE3.inverse(T),
        next_motion=words,
    )


def _deviations(A: Transforms, B: Transforms, X: Transforms, Y: Transforms) -> FloatArray:
    """Return observed minus predicted targets ``(n, 6)``: position, camera frame; rotation, target frame."""
    P = SE3.inverse(A @ X) @ Y
    turns = SO3.log(np.swapaxes(P[:, :3, :3], 1, 2) @ B[:, :3, :3])
    return np.concatenate([B[:, :3, 3] - P[:, :3, 3], turns], axis=1)


def _jacobians(A: Transforms, X: Transforms, Y: Transforms) -> FloatArray:
    """Return the derivatives of the predicted target by right perturbations of ``X`` and ``Y`` ``(n, 6, 12)``.

    ``P = X^-1 A^-1 Y`` becomes ``exp(-dx) P exp(dy) = P exp(dy - Ad(P^-1) dx)``. The position is taken in the camera's
    frame.
    """
    P = SE3.inverse(A @ X) @ Y
    J = np.concatenate([-SE3.adjoint_inverse(P), np.broadcast_to(np.eye(6), (len(P), 6, 6))], axis=2)
    J[:, :3] = P[:, :3, :3] @ J[:, :3]
    return J


def _per_row(sds: FloatArray) -> FloatArray:
    return np.array([sds[0], sds[0], sds[1], sds[2], sds[2], sds[2]])


_ROWS = (np.array([0, 1]), np.array([2]), np.array([3, 4, 5]))
"""Rows of a deviation that each component describes."""


def _fitted(
    A: Transforms, B: Transforms, X: Transforms, Y: Transforms, sds: FloatArray
) -> tuple[Transforms, Transforms, FloatArray, Covariances]:
    """Return the maximum of the likelihood, the variance components and the covariance ``(12, 12)``.

    A component is the sum of its squared deviations over their number minus their leverage (restricted maximum
    likelihood). The covariance has the factor of Student's distribution for estimated variances, ``v / (v - 2)``.
    """
    for _ in range(_PASSES):
        weights = 1 / _per_row(sds) ** 2

        def linearize(
            state: tuple[Transforms, Transforms], weights: FloatArray = weights
        ) -> tuple[FloatArray, FloatArray]:
            J, r = _jacobians(A, *state), _deviations(A, B, *state)
            return np.einsum("nij,i,nik->jk", J, weights, J), np.einsum("nij,i,ni->j", J, weights, r)

        def moved(state: tuple[Transforms, Transforms], step: FloatArray) -> tuple[Transforms, Transforms]:
            return state[0] @ SE3.exp(step[:6]), state[1] @ SE3.exp(step[6:])

        (X, Y), _ = maximize((X, Y), linearize, moved, passes=_PASSES, tolerance=1e-10)
        J, r = _jacobians(A, X, Y), _deviations(A, B, X, Y)
        C = _inverse(np.einsum("nij,i,nik->jk", J, weights, J))
        leverage = np.einsum("nij,jk,nik,i->ni", J, C, J, weights)
        free = np.array([max(len(rows) * len(A) - leverage[:, rows].sum(), 1e-3) for rows in _ROWS])
        new = np.sqrt([np.sum(r[:, rows] ** 2) / one for rows, one in zip(_ROWS, free, strict=True)])
        # a sample more or less has no degrees of freedom left: then the component keeps its value
        new = np.where(free < 1.0, sds, np.maximum(new, _FLOOR))
        done = bool(np.all(np.abs(new / sds - 1) < 1e-4))
        sds = new
        if done:
            break
    inflated = _per_row(sds * np.sqrt(np.where(free > 2.5, free / np.maximum(free - 2, 0.5), 5.0)))
    return X, Y, sds, _inverse(np.einsum("nij,i,nik->jk", J, 1 / inflated**2, J))


def _inverse(H: FloatArray) -> Covariances:
    """Return the inverse of an information matrix; directions without information get a very large variance."""
    d = 1 / np.sqrt(np.maximum(np.diag(H), 1e-30))
    values, vectors = np.linalg.eigh(H * d[:, None] * d)
    values = np.maximum(values, 1e-13)
    scaled = vectors * d[:, None]
    return np.asarray((scaled / values) @ scaled.T)


def _start(A: Transforms, B: Transforms, rng: np.random.Generator) -> tuple[Transforms, Transforms, BoolArray]:
    """Return the best start over random triples of samples and all of them, and the samples that agree with it."""
    n = len(A)
    sets = [np.arange(n)] + [rng.choice(n, _LEAST, replace=False) for _ in range(_STARTS if n > _LEAST else 0)]
    best, least = None, np.inf
    for chosen in sets:
        X, Y = _closed_form(A[chosen], B[chosen])
        r = _deviations(A, B, X, Y)
        cost = float(np.median(np.linalg.norm(r[:, :3], axis=1)) + 0.3 * np.median(np.linalg.norm(r[:, 3:], axis=1)))
        if cost < least:
            best, least = (X, Y), cost
    assert best is not None
    sds = _robust_sds(A, B, *best)
    far = np.abs(_deviations(A, B, *best) / _per_row(sds)).max(axis=1)
    near = far <= max(8.0, float(np.sort(far)[_LEAST - 1]))
    return *best, near


def _robust_sds(A: Transforms, B: Transforms, X: Transforms, Y: Transforms) -> FloatArray:
    """Return standard deviations from medians: 1.483 is their ratio for normal deviations."""
    r = np.abs(_deviations(A, B, X, Y))
    return np.maximum([1.483 * np.median(r[:, rows]) for rows in _ROWS], _FLOOR)


def _closed_form(A: Transforms, B: Transforms) -> tuple[Transforms, Transforms]:
    """Return ``X`` and ``Y`` of ``A X B = Y``: rotations by singular vectors (Shah 2013), then linear positions."""
    RA, RB = A[:, :3, :3], B[:, :3, :3]
    K = sum(np.kron(b.T, a) for a, b in zip(RA, RB, strict=True))  # vec(RA RX RB) = (RB' x RA) vec(RX), by columns
    U, _, Vt = np.linalg.svd(np.asarray(K))
    RX = _rotation_of(Vt[0].reshape(3, 3, order="F"))
    RY = _rotation_of(U[:, 0].reshape(3, 3, order="F"))
    pair = np.einsum("nij,jk,nkl->nil", RA, RX, RB)
    if np.sum(pair * RY) < 0:
        RX = RX @ np.diag([-1.0, -1.0, 1.0])
    RY = _rotation_of(np.einsum("nij,jk,nkl->il", RA, RX, RB))
    left = np.concatenate([RA, np.broadcast_to(-np.eye(3), RA.shape)], axis=2).reshape(-1, 6)
    right = -(A[:, :3, 3] + np.einsum("nij,jk,nk->ni", RA, RX, B[:, :3, 3])).reshape(-1)
    x = np.linalg.lstsq(left, right, rcond=None)[0]
    return SE3.from_parts(RX, x[:3]), SE3.from_parts(RY, x[3:])


def _rotation_of(M: FloatArray) -> FloatArray:
    """Return the rotation nearest to a multiple of it."""
    M = M * np.sign(np.linalg.det(M) or 1.0)
    U, _, Vt = np.linalg.svd(M)
    return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt)


def _consistent(
    A: Transforms, B: Transforms, X: Transforms, Y: Transforms, sds: FloatArray, used: BoolArray
) -> BoolArray:
    """Return the samples that agree with the others: one more or one fewer than before at a time.

    Let ``S`` be the covariance of a sample, ``J`` its derivatives, ``C`` the inverse information of the used samples.
    A used sample has pulled the estimate towards itself: its deviation has the covariance ``S - J C J'``. That of an
    excluded one is independent of the estimate and has ``S + J C J'``. The variances are estimated, for a used sample
    with its own deviation. With ``v`` degrees of freedom and ``T`` the sum of ``k`` squared normalized deviations,
    ``T / v`` then has the distribution Beta(k / 2, (v - k) / 2), and never exceeds 1. For an excluded sample ``T / k``
    has Fisher's F(k, v) (Cook and Weisberg 1982, chapter 2). Both are exact if the ratios of the variance components
    are known.
    """
    J, r = _jacobians(A, X, Y), _deviations(A, B, X, Y)
    variance = _per_row(sds) ** 2
    C = _inverse(np.einsum("nij,i,nik->jk", J[used], 1 / variance, J[used]))
    spread = np.einsum("nij,jk,nlk->nil", J, C, J)
    sign = np.where(used, -1.0, 1.0)[:, None, None]
    leverage = np.einsum("nii,i->n", spread[used], 1 / variance)
    k, v = 6, 6 * int(used.sum()) - float(leverage.sum())
    values, vectors = np.linalg.eigh((np.diag(variance) + sign * spread) / np.sqrt(np.outer(variance, variance)))
    along = np.einsum("nij,ni->nj", vectors, r / np.sqrt(variance))
    # a direction in which the estimate follows a sample entirely has no evidence
    squared = np.sum(np.where(values > _FOLLOWED, along**2 / np.maximum(values, _FOLLOWED), 0.0), axis=1)
    inner = beta.logsf(np.minimum(squared / v, 1.0), k / 2, max(v - k, 1.0) / 2)
    log_p = np.where(used, inner, f.logsf(squared / k, k, v))
    limit, kept = float(np.log(_LEVEL / len(A))), used.copy()
    worst = int(np.argmin(np.where(used, log_p, np.inf)))
    if log_p[worst] < limit:
        kept[worst] = False
        return kept
    back = np.where(used, -np.inf, log_p)
    if not used.all() and back.max() > 0.7 * limit:
        kept[int(np.argmax(back))] = True
    return kept


def _unobserved(C: Covariances) -> tuple[str, ...]:
    """Return the directions of the camera's pose that the motions leave free, as text."""
    found = []
    for block, worst, unit, what in (
        (C[:3, :3], _USELESS[0], 1e3, "position along"),
        (C[3:6, 3:6], _USELESS[1], float(np.degrees(1.0)), "rotation about"),
    ):
        values, vectors = np.linalg.eigh(block)
        for value, vector in zip(values, vectors.T, strict=True):
            sd = float(np.sqrt(value))
            if sd > worst:
                x, y, z = vector * np.sign(vector[np.argmax(np.abs(vector))])
                amount = "free" if sd > 50 * worst else f"sd {unit * sd:.3g} {'mm' if unit == 1e3 else 'deg'}"
                found.append(f"{what} ({x:.2f}, {y:.2f}, {z:.2f}) of the camera's frame ({amount})")
    if found:
        found[-1] += "; the axes of the rotations are too parallel, or the rotations too small"
    return tuple(found)


def _next(A: Transforms, X: Transforms, Y: Transforms, sds: FloatArray, C: Covariances) -> tuple[Transforms, str]:
    """Return the sample, rotated about an axis through the target, that gives the most information on ``X``."""
    weights = 1 / _per_row(sds) ** 2
    poses, words = [], []
    for k in np.unique(np.linspace(0, len(A) - 1, min(len(A), 6)).astype(int)):
        camera = A[k] @ X
        target = SE3.inverse(camera) @ Y
        for axis in range(3):
            for sign in (1.0, -1.0):
                turn = np.eye(4)
                turn[:3, :3] = SO3.axis_rotation(axis, sign * _TURN)
                about = np.eye(4)
                if axis < 2:  # about the target, which stays in the middle; about the optical axis the camera rolls
                    about[:3, 3] = target[:3, 3]
                poses.append(camera @ about @ turn @ SE3.inverse(about) @ SE3.inverse(X))
                where = "its z axis" if axis == 2 else f"the target, parallel to its {'xy'[axis]} axis"
                angle = f"{np.degrees(sign * _TURN):.0f} deg"
                words.append(f"from the pose of sample {k + 1}, rotate the camera by {angle} about {where}")
    J = _jacobians(np.stack(poses), X, Y)
    gain = np.array([np.linalg.slogdet(_inverse(_inverse(C) + (one.T * weights) @ one)[:6, :6])[1] for one in J])
    best = int(np.argmin(gain))
    return poses[best], words[best]
