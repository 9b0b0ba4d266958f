"""All measurements of an inference: factors with names, labels and shared errors; world frame, metres."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tanteo import _core
from tanteo.factors.factor import (
    Factor,
    MeasuredCone,
    MeasuredRow,
    SensedDirection,
    compile_factors,
    factor_class,
)
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, Indices, IntArray, Vectors
from tanteo.parts import Surface
from tanteo.sensors import Column, PointMeasurements

_ONE_BEAM, _PARALLEL = 1e-3, float(np.cos(np.radians(1)))
"""Largest lateral distance [m], and least cosine of the directions, of readings along the same beam."""

_WIDE = 2.0
"""Radius of the spot from which a cone is modelled [standard deviations along the beam] (benchmarks/wide_cones.py)."""
_WIDE_OF_ONE_RANGE = 0.5
"""The same for a response that predicts one range, which has its full density where an outline crosses the spot
(benchmarks/zones.py)."""

_LEAST_WIDTH = 0.3
"""Least standard deviation of a beam across it, as a fraction of that along it (decision 54)."""


@dataclass(frozen=True, slots=True, eq=False)
class ContactPoints:
    """Measurements of an inference, each a factor; the arrays below follow from the ``n`` factors.

    Attributes:
        ids: names of the readings.
        factors: the measurements.
        shared_jacobian: true place = place + jacobian z, with whitened shared errors z ``(n, 3, D)`` [m].
        tolerance: standard deviation of the made surface that the covariances contain [m]; one draw per face.
        places: number of the place of each, equal for readings of one beam ``(n,)``; None if each has its own.
        labels: name of the element on which each was sensed, ``''`` for none; measurements of one label share one
            element.
        kinds: kinds of reading, for the factor classes.
        turn_jacobian: true direction of a beam = direction + jacobian z ``(n, 3, D)``; empty if no factor needs it.
        rounding: standard deviation of rounded coordinates that the covariances contain [m]; the scale of the noise
            does not multiply it.
        one_sided: mask of the first shared errors that act on one side only, see :func:`one_sided`; others do not.
        points: sensed places in the world, centres of the ball where ``radii`` is positive ``(n, 3)`` [m].
        covs: independent covariances, with tolerance and rounding ``(n, 3, 3)`` [m^2].
        sd: largest standard deviation of each ``(n,)`` [m].
        radii: radius of the tip's ball ``(n,)`` [m].
        directions: direction of approach, zero if unknown ``(n, 3)``; ``directed`` states which are known.
        sides: approximate outward direction, zero if unknown ``(n, 3)``.
        normals: sensed normals and axes, zero if not sensed ``(n, 3)``; ``oriented`` states which were sensed.
        normal_sds: standard deviation of each of their tilts, pi if not sensed ``(n,)`` [rad].
        reach: length of the free-space ray before each ``(n,)`` [m]; 0 if unknown.
        variance: variance of all places in every direction if they are equal [m^2]; NaN otherwise.
    """

    ids: tuple[str, ...]
    factors: tuple[Factor, ...]
    shared_jacobian: FloatArray
    tolerance: float = 0.0
    places: IntArray | None = None
    labels: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    turn_jacobian: FloatArray = field(default_factory=lambda: np.zeros((0, 3, 0)))
    rounding: float = 0.0
    one_sided: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    points: Vectors = field(init=False, repr=False)
    covs: Covariances = field(init=False, repr=False)
    sd: FloatArray = field(init=False, repr=False)
    radii: FloatArray = field(init=False, repr=False)
    directions: Vectors = field(init=False, repr=False)
    sides: Vectors = field(init=False, repr=False)
    normals: Vectors = field(init=False, repr=False)
    normal_sds: FloatArray = field(init=False, repr=False)
    reach: FloatArray = field(init=False, repr=False)
    directed: BoolArray = field(init=False, repr=False)
    oriented: BoolArray = field(init=False, repr=False)
    variance: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        n, all_of = len(self.ids), self.factors
        if not self.labels:
            object.__setattr__(self, "labels", ("",) * n)
        if not self.kinds:
            object.__setattr__(self, "kinds", ("point",) * n)
        zero = np.zeros(3)
        arrays: dict[str, Any] = {
            "points": np.array([f.at for f in all_of], dtype=np.float64).reshape(n, 3),
            "covs": np.array([f.cov for f in all_of], dtype=np.float64).reshape(n, 3, 3),
            "radii": np.array([f.ball_radius for f in all_of], dtype=np.float64),
            "directions": _stacked([f.approach for f in all_of], zero),
            "sides": _stacked([f.outward for f in all_of], zero),
            "normals": _stacked([None if f.normal is None else f.normal.direction for f in all_of], zero),
            "normal_sds": np.array([np.pi if f.normal is None else f.normal.sd for f in all_of], dtype=np.float64),
            "reach": np.array([f.free_path for f in all_of], dtype=np.float64),
            "directed": np.array([f.approach is not None for f in all_of], dtype=np.bool_),
            "oriented": np.array([f.normal is not None for f in all_of], dtype=np.bool_),
        }
        arrays["sd"] = np.sqrt(np.linalg.eigvalsh(np.asarray(arrays["covs"], dtype=np.float64))[:, -1])
        for name, array in arrays.items():
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        v = float(self.covs[0, 0, 0]) if n else np.nan
        same = bool(np.all(np.abs(self.covs - v * np.eye(3)) <= 1e-9 * v)) if n else False
        object.__setattr__(self, "variance", v if same else float("nan"))

    @classmethod
    def none(cls) -> ContactPoints:
        """Return an empty set of measurements."""
        return cls((), (), np.zeros((0, 3, 0)))

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def centres(self) -> BoolArray:
        """Return which measurements are centres of round features and not points of the surface ``(n,)``."""
        return np.array([not factor.on_surface for factor in self.factors], dtype=np.bool_)

    @property
    def placed(self) -> BoolArray:
        """Return which measurements state all three coordinates ``(n,)``: all but centres at any height of an axis."""
        return np.array([f.on_surface or f.codimension == 3 for f in self.factors], dtype=np.bool_)

    @property
    def landmarks(self) -> Vectors:
        """Return the measured places of the part, such as the apex for a point of a cone's axis ``(n, 3)`` [m]."""
        return np.array([factor.landmark for factor in self.factors], dtype=np.float64).reshape(len(self), 3)

    @property
    def residual_sd(self) -> FloatArray:
        """Return the standard deviation of the residual of each ``(n,)`` [m]: of the range for a wide beam."""
        own = np.array([factor.residual_sd for factor in self.factors], dtype=np.float64)  # None becomes NaN
        return np.where(np.isnan(own), self.sd, own)

    @property
    def constrained(self) -> int:
        """Return the number of directions that all measurements constrain, at least one for each surface point."""
        return len(self) + sum(f.codimension - 1 for f in self.factors if not f.on_surface)

    @property
    def inward(self) -> Vectors:
        """Return directions into the material, from directions or sides ``(n, 3)``; zero if neither is known."""
        return np.where(self.directed[:, None], self.directions, -self.sides)

    def take(self, rows: Sequence[int] | IntArray) -> ContactPoints:
        """Return the measurements in some rows, in the order of the rows."""
        if np.array_equal(rows, np.arange(len(self))):
            return self
        places = None if self.places is None else self.places[rows]
        ids, labels, kinds = (tuple(values[i] for i in rows) for values in (self.ids, self.labels, self.kinds))
        factors = tuple(self.factors[i] for i in rows)
        turns = self.turn_jacobian[rows] if len(self.turn_jacobian) else self.turn_jacobian
        return ContactPoints(
            ids, factors, self.shared_jacobian[rows], self.tolerance, places, labels, kinds, turns, self.rounding,
            self.one_sided,
        )  # fmt: skip

    def with_places(self) -> ContactPoints:
        """Return the same measurements with ``places`` set: those along one beam share the place of the first."""
        places, d = np.arange(len(self)), self.directions
        later, earlier = np.nonzero(np.tril(d @ d.T > _PARALLEL, -1))
        away, d = self.points[earlier] - self.points[later], d[later]
        beside = np.linalg.norm(away - np.sum(away * d, axis=1, keepdims=True) * d, axis=1)
        later, earlier = later[beside < _ONE_BEAM], earlier[beside < _ONE_BEAM]
        for row, k in zip(*np.unique(later, return_index=True), strict=True):
            places[row] = places[earlier[k]]
        out = copy(self)
        object.__setattr__(out, "places", places)
        return out

    def compiled(
        self, log_outlier: FloatArray, furniture: Sequence[Surface] = ()
    ) -> list[tuple[_core.FactorList, Indices]]:
        """Return the factors for the core: one block per kind, with the rows of its factors.

        Args:
            log_outlier: log density of each measurement as an outlier ``(n,)``.
            furniture: surfaces beside the part in the world.
        """
        factors = [factor.before(furniture) for factor in self.factors]
        return compile_factors(factors, float(np.hypot(self.tolerance, self.rounding)), log_outlier)


def _stacked(vectors: Sequence[Vectors | None], none: Vectors) -> Vectors:
    return np.array([none if v is None else v for v in vectors], dtype=np.float64).reshape(-1, 3)


def surface_points(
    points: Vectors,
    sds: FloatArray | float,
    *,
    covs: Covariances | None = None,
    radii: FloatArray | float = 0.0,
    directions: Vectors | None = None,
    normals: Vectors | None = None,
    normal_sds: FloatArray | float = np.pi,
    reach: FloatArray | float = 0.0,
    outward: Vectors | None = None,
    shared_jacobian: FloatArray | None = None,
    tolerance: float = 0.0,
    labels: Sequence[str] = (),
    kind: str = "point",
) -> ContactPoints:
    """Return points of the surface from arrays.

    Args:
        points: places in the world, centres of the ball where ``radii`` is positive ``(n, 3)`` [m].
        sds: standard deviation in every direction ``(n,)`` [m], or one for all; the tolerance included.
        covs: covariances instead of ``sds`` ``(n, 3, 3)`` [m^2].
        radii: radius of the tip's ball ``(n,)`` [m], or one for all.
        directions: directions of approach ``(n, 3)``.
        normals: sensed outward normals ``(n, 3)``.
        normal_sds: standard deviation of each of their tilts ``(n,)`` [rad], or one for all.
        reach: length of the free-space ray before each ``(n,)`` [m], or one for all.
        outward: rough outward directions, where only the side of the material is known ``(n, 3)``.
        shared_jacobian: derivative of the places by the whitened shared errors ``(n, 3, D)`` [m].
        tolerance: standard deviation of the made surface that the covariances contain [m].
        labels: name of the element on which each was sensed, ``''`` for none ``(n,)``.
        kind: kind of reading of all of them.

    Example:
        >>> from tanteo.factors.points import surface_points
        >>> len(surface_points(np.zeros((4, 3)), 1e-4))
        4
    """
    n = len(points)
    if covs is None:
        covs = np.broadcast_to(sds, (n,))[:, None, None] ** 2 * np.eye(3)
    cls: Any = factor_class(kind)
    radii, normal_sds, reach = (np.broadcast_to(a, (n,)) for a in (radii, normal_sds, reach))
    factors = tuple(
        cls(
            at=points[k], cov=covs[k], ball_radius=float(radii[k]),
            approach=None if directions is None else directions[k],
            normal=None if normals is None else SensedDirection(normals[k], float(normal_sds[k])),
            outward=None if outward is None else outward[k], free_path=float(reach[k]),
        )
        for k in range(n)
    )  # fmt: skip
    jacobian = np.zeros((n, 3, 0)) if shared_jacobian is None else shared_jacobian
    ids, kinds = tuple(map(str, range(1, n + 1))), (kind,) * n
    return ContactPoints(ids, factors, jacobian, tolerance, labels=tuple(labels), kinds=kinds)


def as_contact_points(
    measured: PointMeasurements, tolerance: float = 0.0, reach: Column | None = None
) -> ContactPoints:
    """Return measurements as factors; the covariance of a beam has a least lateral width (decision 54).

    Args:
        measured: points in the world.
        tolerance: standard deviation of the made surface against its CAD [m].
        reach: lengths of the free-space rays before the points ``(n,)`` [m]: the ranges of beams.

    Raises:
        InputError: contact of a ball with an edge or corner, whose place on the ball is unknown.
    """
    points, independent, radii = measured.centres()
    on_surface = np.array([factor_class(kind).on_surface for kind in measured.kinds], dtype=np.bool_)
    # the approach of a device to a centre carries no information about it
    directions = np.where(on_surface[:, None], np.nan_to_num(measured.directions), 0.0)
    covs = _widen_beams(independent, directions) + (tolerance**2 + measured.rounding**2) * np.eye(3)
    lengths = np.zeros(len(measured)) if reach is None else reach.only(on_surface).filled(0.0)
    normal_sds = np.nan_to_num(measured.normal_sds, nan=np.pi)
    cones = _cones(measured, covs, directions)
    directed = np.any(directions != 0, axis=1).tolist()
    approaches = [row if there else None for row, there in zip(directions, directed, strict=True)]
    unsensed = np.isnan(measured.normals[:, 0]).tolist()
    sensed = [
        None if none else SensedDirection(normal, sd)
        for normal, sd, none in zip(measured.normals, normal_sds.tolist(), unsensed, strict=True)
    ]
    columns = (
        measured.features, measured.kinds, points, covs, radii.tolist(), approaches, sensed, lengths.tolist(),
        measured.sizes, measured.material_sides, cones,
    )  # fmt: skip
    factors = list[Factor]()
    for row in map(MeasuredRow, *columns):
        cls = factor_class(row.kind)
        factors.append((cls.wide_beam if row.cone and cls.wide_beam else cls).from_row(row))
    jacobian, _, _, turns = measured.whitened()
    return ContactPoints(
        measured.ids, tuple(factors), jacobian, tolerance, labels=measured.features, kinds=measured.kinds,
        turn_jacobian=turns if any(cones) else np.zeros((0, 3, 0)), rounding=measured.rounding,
        one_sided=np.repeat([e.one_sided for e in measured.shared], [len(e.covariance) for e in measured.shared]),
    )  # fmt: skip


def _cones(measured: PointMeasurements, covs: Covariances, directions: Vectors) -> list[MeasuredCone | None]:
    """Return the cones of beams whose spot is wide for their noise; None for the others."""
    cones = measured.cones
    sds = np.sqrt(np.einsum("ni,nij,nj->n", directions, covs, directions))
    least = np.where(np.isin(cones.responses, ("mean", "strongest", "nearest")), _WIDE_OF_ONE_RANGE, _WIDE)
    wide = cones.ranges * np.tan(cones.half_angles) > least * sds  # False for NaN
    wide &= directions.any(axis=1) & np.isnan(measured.normals[:, 0]) & (measured.radii == 0)
    return [
        MeasuredCone(
            float(cones.ranges[k]),
            float(cones.half_angles[k]),
            float(cones.max_incidences[k]),
            cones.responses[k],
            None if np.isnan(cones.half_axes[k, 0, 0]) else cones.half_axes[k],
        )
        if wide[k]
        else None
        for k in range(len(measured))
    ]


def _widen_beams(covs: Covariances, directions: Vectors) -> Covariances:
    """Return covariances whose standard deviation across a beam is at least a fraction of that along it.

    Where a thin beam passes an edge the posterior is discontinuous: maximizations stop there and the sampler rejects
    its steps. Readings without direction remain unchanged.
    """
    along = np.einsum("ni,nij,nj->n", directions, covs, directions)
    across = 0.5 * (np.trace(covs, axis1=1, axis2=2) - along)
    missing = np.maximum(_LEAST_WIDTH**2 * along - across, 0.0)
    beside = np.eye(3) - directions[:, :, None] * directions[:, None]
    return np.asarray(covs + missing[:, None, None] * beside)
