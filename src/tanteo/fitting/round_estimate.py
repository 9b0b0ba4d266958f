"""Maximum likelihood fits of round features over batches, from several starts, with the second-best fit.

The iteration is compiled (``_core``, ``rounds.hpp``); ``math.md`` section 8 derives it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from tanteo import _core
from tanteo.errors import InputError
from tanteo.features import chi2_limit, shared_root
from tanteo.features.kinds import CIRCLE, CONE, CYLINDER, SPHERE, FeatureKind
from tanteo.fitting.estimate import Estimate, SharedReadings, check_points, rigid_error
from tanteo.fitting.flatness import refuse_flat
from tanteo.geometry.limits import SUSPECT
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, Transforms, Vectors

_KINDS = (CIRCLE, CYLINDER, CONE, SPHERE)
SURFACES = {kind.name: number for number, kind in enumerate(_KINDS)}
"""Round kinds by their number in the core (``RoundKind``)."""

_ROWS = {kind.name: np.array(kind.rows, dtype=np.int32) for kind in _KINDS}
_NONE = np.zeros(0)


@dataclass(frozen=True, slots=True, eq=False)
class RoundEstimate:
    """Fitted round features over batches.

    Attributes:
        fit: frames, with ``P`` and ``shared_jacobian`` over the kind's rows and the size as last row.
        size: radius [m] or half angle [rad] ``(*batch,)``.
        rival: size of another feature that fits about equally well ``(*batch,)``; NaN if there is none.
        converged: whether the iteration converged ``(*batch,)``.
        condition: smallest eigenvalue of the information scaled to unit diagonal ``(*batch,)``; zero if the points
            leave a direction free.
        frame_gain: derivatives of frame and size by a prior frame ``(*batch, m, m - 1)``.
    """

    fit: Estimate
    size: FloatArray
    rival: FloatArray
    converged: BoolArray
    condition: FloatArray
    frame_gain: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class KnownFrame:
    """Prior frame of a round feature.

    Attributes:
        T: the frame ``(4, 4)``.
        information: information on its error over the kind's rows ``(m, m)``.
        shared_jacobian: its derivatives by the whitened shared errors of the points ``(m, D)``.
    """

    T: Transforms
    information: FloatArray
    shared_jacobian: FloatArray


_NO_FRAME = KnownFrame(_NONE, _NONE, _NONE)


def round_ml(
    kind: FeatureKind,
    points: Vectors,
    covs: Covariances,
    *,
    size: float | None = None,
    size_sd: float = 0.0,
    normals: Vectors | None = None,
    normal_sds: FloatArray | None = None,
    outward: Vectors | None = None,
    shared: SharedReadings = (),
) -> RoundEstimate:
    """Fit circles (rims), cylinders, cones or spheres to ``(*batch, n, 3)`` points by maximum likelihood.

    ``chi2`` has one degree of freedom for each point (two on a rim) and two for each sensed normal, less the unknowns.
    Unobservable features are not refused here, but by :func:`fit_cylinder` and the like: see ``condition``, ``P`` and
    ``rival``.

    Args:
        kind: circle, cylinder, cone or sphere.
        points: points of the surface, or of the rim, in the world [m].
        covs: their independent covariances ``(*batch, n, 3, 3)``, positive definite [m^2].
        size: radius [m] or half angle [rad], if it is known.
        size_sd: its standard deviation; 0 holds it.
        normals: sensed normals away from the axis (centre) ``(*batch, n, 3)``; zero rows without one.
        normal_sds: standard deviations of the normals [rad] ``(*batch, n)``; infinite without one.
        outward: vectors ``(*batch, n, 3)`` that all point away from the axis, or all towards it; zero if unknown.
        shared: errors that the points of each fit share, with Jacobians ``(n, 3, d)``. Points that an error moves
            against each other get less weight, as in the full covariance of all points.

    Raises:
        InputError: for too few points, or shapes that do not fit.
        DegenerateError: if the points lie on a line, or in a plane where they must not.
    """
    points, covs = check_points(points, covs, unknowns(kind, size, size_sd), kind.name)
    check_positive(covs, kind.name)
    refuse_flat(points, 2 if kind is CIRCLE else 3, kind.name)
    return solved(
        kind, points, covs, size=size, size_sd=size_sd, normals=normals, normal_sds=normal_sds, outward=outward,
        shared_jacobian=weighing(points, shared),
    )  # fmt: skip


def weighing(points: Vectors, shared: SharedReadings) -> FloatArray:
    """Return the effect of whitened shared errors on the points ``(n, 3, D)``, without rigid motions of all.

    A rigid motion of all points moves the feature with them, so it does not affect the weights.
    """
    n = points.shape[-2]
    blocks = [
        np.asarray(J, dtype=np.float64) @ shared_root([error])
        for error, J in shared
        if rigid_error(points.reshape(-1, n, 3)[0], error, J) is None
    ]
    return np.concatenate([np.zeros((n, 3, 0)), *blocks], axis=-1)


def check_positive(covs: Covariances, name: str) -> None:
    """Refuse covariances of points that are not positive definite.

    Raises:
        InputError: if one is.
    """
    try:
        np.linalg.cholesky(covs)
    except np.linalg.LinAlgError:
        raise InputError(
            f"{name}, covs: expected positive definite covariances, got a singular one. Give the noise."
        ) from None


def unknowns(kind: FeatureKind, size: float | None, size_sd: float) -> int:
    """Return the least number of points that determine a feature, whose size may be given."""
    if kind is CIRCLE:
        return 3
    return kind.size + (size is None or size_sd > 0)


def solved(
    kind: FeatureKind,
    points: Vectors,
    covs: Covariances,
    *,
    surface: FeatureKind | None = None,
    size: float | None = None,
    size_sd: float = 0.0,
    normals: Vectors | None = None,
    normal_sds: FloatArray | None = None,
    outward: Vectors | None = None,
    side: int | None = None,
    shared_jacobian: FloatArray = _NONE,
    known: KnownFrame | None = None,
) -> RoundEstimate:
    """Return the estimate of checked points.

    Args:
        kind: kind of the feature.
        points: points ``(*batch, n, 3)``.
        covs: covariances ``(*batch, n, 3, 3)``.
        surface: surface of the points, if it is not the feature itself: the wall of a circle.
        size: known size, see :func:`round_ml`.
        size_sd: its standard deviation.
        normals: sensed normals.
        normal_sds: standard deviations of the normals.
        outward: vectors away from the axis, or towards it.
        side: 1 where ``outward`` has to point away from the axis, -1 towards it.
        shared_jacobian: derivatives of the points by whitened shared errors ``(n, 3, D)``.
        known: prior frame.
    """
    surface = surface or kind
    batch, n = points.shape[:-2], points.shape[-2]
    sds = _NONE if normal_sds is None else np.where(np.isfinite(normal_sds), normal_sds, 0.0)
    dof = _dof(kind, surface, n, sds, size, size_sd, known)
    frame = _NO_FRAME if known is None else known
    D = shared_jacobian.shape[-1] if shared_jacobian.ndim == 3 else 0
    Ts, sizes, P, gains, frame_gains, off, standardised, chi2, rivals, converged, conditions = _core.fit_rounds(
        SURFACES[kind.name], SURFACES[surface.name], _ROWS[kind.name], _rows(points, n, 3), _rows(covs, n, 3, 3),
        _NONE if normals is None else _rows(np.broadcast_to(normals, points.shape), n, 3),
        _NONE if normals is None else _rows(np.broadcast_to(sds, points.shape[:-1]), n),
        _NONE if outward is None else _rows(np.broadcast_to(outward, points.shape), n, 3),
        side or 0, shared_jacobian if D else np.zeros((n, 3, 0)), 0.0 if size is None else float(size), float(size_sd),
        frame.T, frame.information, frame.shared_jacobian, _limit(dof),
    )  # fmt: skip

    def back(array: FloatArray) -> FloatArray:
        return array.reshape((*batch, *array.shape[1:]))

    fit = Estimate(back(Ts), back(P), back(chi2), dof, back(off), back(standardised), back(gains))
    return RoundEstimate(
        fit, back(sizes), back(rivals), converged.reshape(batch) != 0, back(conditions), back(frame_gains)
    )


def _rows(array: FloatArray, *shape: int) -> FloatArray:
    return np.ascontiguousarray(array, dtype=np.float64).reshape(-1, *shape)


def _dof(
    kind: FeatureKind,
    surface: FeatureKind,
    n: int,
    sds: FloatArray,
    size: float | None,
    size_sd: float,
    known: KnownFrame | None,
) -> int:
    """Return degrees of freedom: residuals and priors, less the unknowns."""
    residuals = n * (2 if surface is CIRCLE else 1) + 2 * int(np.count_nonzero(sds.reshape(-1, n)[:1]))
    unknown = kind.size + (size is None or size_sd > 0)
    frame = 0 if known is None else int(np.any(known.information != 0, axis=-1).sum())
    return residuals - unknown + frame + (size is not None and size_sd > 0)


@lru_cache(maxsize=256)
def _limit(dof: int) -> float:
    """Return the largest sum of squares that the joint test accepts."""
    return float(chi2_limit(SUSPECT, dof)) if dof > 0 else 0.0


class RoundDistances(NamedTuple):
    """Distances of points from a round feature, in its frame; ``k`` rows for each point, two for a rim.

    Attributes:
        F: signed distances ``(n, k)`` [m], positive outside of the round body.
        G: derivatives by the points ``(n, k, 3)``; the last is the outward normal of a surface.
        by_size: derivatives by radius or half angle ``(n, k)``.
    """

    F: FloatArray
    G: FloatArray
    by_size: FloatArray


def round_distances(kind: FeatureKind, local: Vectors, size: float) -> RoundDistances:
    """Return distances of points ``(n, 3)`` in the frame of a feature of that kind and size."""
    return RoundDistances(*_core.round_distances(SURFACES[kind.name], np.ascontiguousarray(local), float(size)))
