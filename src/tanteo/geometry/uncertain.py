"""Define the uncertain frame, and compose, invert, relate and sample it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import se3 as SE3
from tanteo.geometry.covariances import check_covariances, symmetrised, unit_diagonal
from tanteo.geometry.propagation import compose_arrays, compose_fourth_order, invert_arrays, relate_arrays
from tanteo.geometry.typing import Covariances, FloatArray, Transforms
from tanteo.values import Value, lock

_RIGID = 1e-6


def check_transforms(name: str, T: Transforms) -> Transforms:
    """Return a read-only float64 copy of rigid motions ``(*batch, 4, 4)``.

    Args:
        name: name of the argument, for messages.
        T: matrices to check.

    Raises:
        InputError: a matrix is not finite, not orthonormal (to 1e-6), a reflection, or not homogeneous.
    """
    T = np.array(T, dtype=np.float64)
    if T.ndim < 2 or T.shape[-2:] != (4, 4):
        raise InputError(f"{name}: expected 4 x 4 matrices, got shape {T.shape}.")
    R = T[..., :3, :3]
    with np.errstate(invalid="ignore"):
        excess = np.abs(R @ np.swapaxes(R, -1, -2) - np.eye(3)).max(axis=(-1, -2), initial=0.0)
        rigid = (excess < _RIGID) & (np.linalg.det(R) > 0) & np.all(T[..., 3, :] == [0, 0, 0, 1], axis=-1)
        rigid &= np.all(np.isfinite(T), axis=(-1, -2))
    if not np.all(rigid):
        bad = T[~rigid][0]
        raise InputError(
            f"{name}: expected rigid motions (rotation of determinant +1, last row 0 0 0 1), got {bad.tolist()}."
        )
    T.setflags(write=False)
    return T


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class UncertainFrame(Value):
    """Frame with uncertainty: ``T_true = T exp(e)``, ``e ~ N(0, C)``. The batch axes of both fields broadcast.

    Attributes:
        T: ``T_a_b`` ``(*batch, 4, 4)`` [m].
        C: covariance of the body (right) error, translation first, in the axes of b ``(*batch, 6, 6)``
            [m^2, m rad, rad^2]; zero rows are certain.

    Raises:
        InputError: ``T`` is not a rigid motion.
        CovarianceError: ``C`` is not a covariance.

    Example:
        >>> import numpy as np
        >>> frame = tanteo.UncertainFrame(np.eye(4), np.diag([1e-6] * 6))
        >>> frame.C.shape
        (6, 6)
    """

    T: Transforms
    C: Covariances

    def __post_init__(self) -> None:
        self._keep(check_transforms("T", self.T), check_covariances("C", self.C, 6))
        lock(self)

    def _keep(self, T: Transforms, C: Covariances) -> None:
        batch = np.broadcast_shapes(T.shape[:-2], C.shape[:-2])
        object.__setattr__(self, "T", np.broadcast_to(T, (*batch, 4, 4)))
        object.__setattr__(self, "C", np.broadcast_to(C, (*batch, 6, 6)))

    @property
    def batch(self) -> tuple[int, ...]:
        """Shape of the batch: ``()`` for a single frame."""
        return self.T.shape[:-2]


def _propagated(T: Transforms, C: Covariances) -> UncertainFrame:
    """Return a frame from computed arrays, without the checks of the constructor."""
    frame = object.__new__(UncertainFrame)
    C = symmetrised(C)
    T.setflags(write=False)
    C.setflags(write=False)
    frame._keep(T, C)
    return frame


def compose(
    first: UncertainFrame, second: UncertainFrame, cross: FloatArray | None = None, *, order: int = 2
) -> UncertainFrame:
    """Return ``T_a_c`` from ``T_a_b`` and ``T_b_c``; batches broadcast.

    Args:
        first: ``T_a_b``.
        second: ``T_b_c``.
        cross: ``E[e1 e2']`` ``(*batch, 6, 6)`` if the errors are correlated; None if independent.
        order: order of the propagation: 2 (sufficient for tilts below 0.1 rad) or 4 (Barfoot and Furgale 2014), for
            independent errors only.

    Raises:
        InputError: the order is neither 2 nor 4, or it is 4 with correlated errors.
    """
    if order == 2:
        return _propagated(*compose_arrays(first.T, first.C, second.T, second.C, cross))
    if order != 4 or cross is not None:
        got = f"{order}" if order != 4 else "4 with a cross covariance"
        raise InputError(f"order: expected 2, or 4 for independent errors, got {got}. Use 2.")
    return _propagated(*compose_fourth_order(first.T, first.C, second.T, second.C))


def invert(frame: UncertainFrame) -> UncertainFrame:
    """Return ``T_b_a`` from ``T_a_b``; its error is expressed in the axes of a.

    Args:
        frame: ``T_a_b``.
    """
    return _propagated(*invert_arrays(frame.T, frame.C))


def relate(first: UncertainFrame, second: UncertainFrame, cross: FloatArray | None = None) -> UncertainFrame:
    """Return ``T_f1_f2`` from ``T_world_f1`` and ``T_world_f2``: ``e12 = e2 - Ad(T12^-1) e1`` (paper, (26)).

    The sign is that of section 2 of the paper, not of its printed equation (26), so that a common error cancels
    (``math.md`` section 3). Batches broadcast; :func:`relate_arrays` is the same on plain arrays.

    Args:
        first: ``T_world_f1``.
        second: ``T_world_f2``.
        cross: ``E[e1 e2']`` ``(*batch, 6, 6)`` if the errors are correlated; None if independent.
    """
    return _propagated(*relate_arrays(first.T, first.C, second.T, second.C, cross))


def sample(frame: UncertainFrame, rng: np.random.Generator, size: tuple[int, ...] = ()) -> Transforms:
    """Return samples of the true frame ``T exp(e)``, ``e ~ N(0, C)``; singular covariances are allowed.

    Args:
        frame: a single frame or a batch.
        rng: random number generator.
        size: leading axes of independent draws.

    Returns:
        Frames ``(*size, *batch, 4, 4)`` [m].
    """
    unit, d = unit_diagonal(frame.C)
    values, vectors = np.linalg.eigh(unit)
    root = d[..., None] * vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :]
    e = np.einsum("...ij,...j->...i", root, rng.standard_normal((*size, *frame.batch, 6)))
    return frame.T @ SE3.exp(e)
