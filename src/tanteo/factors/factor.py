"""Base class of all measurement factors, and their registry.

A factor is one measurement of one kind, with the fields of this kind and no others. Its likelihood is compiled:
``_core/factors/`` has one source for each kind, registered under :attr:`Factor.core`. Each property that depends on the
kind is an attribute or method of its class; no other code compares kinds.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias, TypeVar

import numpy as np

from tanteo import _core
from tanteo.errors import InputError
from tanteo.features import Feature
from tanteo.geometry.typing import Covariances, FloatArray, Indices, Vectors
from tanteo.parts import Part, Surface

_Class = TypeVar("_Class", bound="type[Factor]")


@dataclass(frozen=True, slots=True, eq=False)
class SensedDirection:
    """Sensed outward normal, or sensed axis of a round feature.

    Attributes:
        direction: unit vector in the world ``(3,)``.
        sd: standard deviation of each of its two tilts [rad].
    """

    direction: Vectors
    sd: float


@dataclass(frozen=True, slots=True, eq=False)
class SensedSize:
    """Sensed radius, or half angle of a cone.

    Attributes:
        value: radius [m] or half angle [rad].
        sd: its standard deviation, with the tolerance of manufacture.
    """

    value: float
    sd: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Factor(ABC):
    """Measurement of one kind, whose density the posterior multiplies with those of the others.

    Attributes:
        at: sensed place in the world ``(3,)`` [m].
        cov: its independent covariance, with the tolerance of the part ``(3, 3)`` [m^2].
        normal: sensed normal of the surface, or axis of a round feature; None where none was sensed.
        core: name of the kind in the compiled core.
        codimension: number of directions in which an element of the part constrains the measurement.
        on_surface: whether the sensed place is on the part's surface.
        flat_face: whether a label of this kind names a flat face.
        round_face: whether a label of this kind names a face that is not flat.
        wide_beam: class of the same kind of reading by a wide beam; None for this class.
        feature_kinds: names of the kinds of sensed features that become factors of this class.
    """

    core: ClassVar[str]
    codimension: ClassVar[int]
    on_surface: ClassVar[bool] = True
    flat_face: ClassVar[bool] = False
    round_face: ClassVar[bool] = False
    feature_kinds: ClassVar[tuple[str, ...]] = ()
    wide_beam: ClassVar[type[Factor] | None] = None
    at: Vectors
    cov: Covariances
    normal: SensedDirection | None = None

    @property
    def ball_radius(self) -> float:
        """Return the radius of the ball whose centre is the sensed place [m]; 0 if the place is a point of the part."""
        return 0.0

    @property
    def approach(self) -> Vectors | None:
        """Return the unit direction of the beam or of the tip's motion, into the material ``(3,)``; None if unknown."""
        return None

    @property
    def other_responses(self) -> tuple[str, ...]:
        """Return what the device may report if not what its rig states; empty for kinds with one meaning."""
        return ()

    @property
    def outward(self) -> Vectors | None:
        """Return an approximate outward direction if only the material side is known ``(3,)``; None otherwise."""
        return None

    @property
    def free_path(self) -> float:
        """Return the length of the straight free-space ray before the place [m]; 0 if unknown."""
        return 0.0

    @property
    def residual_sd(self) -> float | None:
        """Return the standard deviation of the residual that is minimized [m]; None for the largest of the place."""
        return None

    @property
    def landmark(self) -> Vectors:
        """Return the measured place of the part, such as a cone's apex for a point of its axis ``(3,)`` [m]."""
        return self.at

    @property
    def sensed_size(self) -> SensedSize | None:
        """Return the sensed radius or half angle; None if unknown."""
        return None

    @property
    def material_side(self) -> int:
        """Return 1 for a hole, -1 for a boss, 0 if unknown or meaningless."""
        return 0

    def log_outlier(self, radius: float) -> float:
        """Return the log density of the measurement if it is an outlier or lies on an unknown object.

        Args:
            radius: radius of the ball of the workspace, in which an outlier is uniform [m].
        """
        log = -np.log(4 / 3 * np.pi * radius**3)
        return float(log if self.normal is None else log - np.log(4 * np.pi))

    def log_on(self, surface: Surface, sd: float) -> float | None:
        """Return the log density of the measurement on a surface in the world; None if its place is on the surface.

        Args:
            surface: surface of furniture in the world.
            sd: standard deviation of this surface along its normal [m].
        """
        return None

    def before(self, surfaces: Sequence[Surface]) -> Factor:
        """Return the factor of a device that also senses furniture beside the part; the same for most kinds.

        Args:
            surfaces: surfaces of furniture in the world.
        """
        return self

    @abstractmethod
    def columns(self) -> dict[str, Any]:
        """Return the numbers of this kind that the core needs, by the names of its columns.

        Place, covariance, direction and outlier density are common to all kinds; :func:`compile_factors` adds them.
        """

    @classmethod
    def from_feature(cls, view: tuple[Feature, ...], name: str, jacobian: FloatArray) -> FeaturePart:
        """Return factors that carry the same information about the part as a sensed feature.

        Args:
            view: the feature; twice, once for each side, where its outward side is unknown.
            name: name of the feature in messages.
            jacobian: derivative of its perturbations by the whitened shared errors ``(size, D)``.

        Raises:
            InputError: the feature does not determine its factors.
        """
        raise NotImplementedError(f"{cls.__name__}.feature_kinds is not empty, but from_feature is missing")

    @classmethod
    def landmarks(cls, part: Part) -> list[Landmark]:
        """Return the places of a part where measurements of this kind may be; empty for kinds on the surface."""
        return []

    @classmethod
    @abstractmethod
    def from_row(cls, row: MeasuredRow) -> Factor:
        """Make a factor of one row of measurements.

        Raises:
            InputError: the row has a field that this kind does not allow.
        """


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredCone:
    """Wide beam of a reading.

    Attributes:
        range: range along the beam [m].
        half_angle: half angle of the cone [rad].
        max_incidence: largest incidence at which the device detects a surface [rad].
        response: what the device reports of its cone, one of :data:`~tanteo.sensors.presets.RESPONSES`; empty if
            unknown.
        half_axes: half axes of a rectangular beam at distance one, in the world ``(2, 3)``; None for a circle.
    """

    range: float
    half_angle: float
    max_incidence: float
    response: str
    half_axes: Vectors | None = None


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredRow:
    """One row of point measurements, as :func:`tanteo.sensors.measure` returns them; None for what was not sensed.

    Attributes:
        label: name of the feature on which it was sensed, ``''`` for none.
        kind: kind of reading.
        at: place in the world ``(3,)`` [m], the centre of the ball of a tip.
        cov: independent covariance with the tolerance of the part ``(3, 3)`` [m^2].
        ball_radius: radius of the tip's ball [m].
        approach: direction of the beam or of the tip's motion ``(3,)``.
        normal: sensed normal or axis.
        free_path: length of the free-space ray before the place [m].
        size: sensed radius [m] or half angle [rad].
        material_side: 1 for a hole, -1 for a boss, 0 where unknown.
        cone: wide beam; None for a touch or a thin beam.
    """

    label: str
    kind: str
    at: Vectors
    cov: Covariances
    ball_radius: float = 0.0
    approach: Vectors | None = None
    normal: SensedDirection | None = None
    free_path: float = 0.0
    size: float | None = None
    material_side: int = 0
    cone: MeasuredCone | None = None


FeaturePart: TypeAlias = list[tuple[Factor, FloatArray]]
"""Factors with the information of one sensed feature about the part, each with the derivative of its place by the
whitened shared errors ``(3, D)``."""


@dataclass(frozen=True, slots=True, eq=False)
class Landmark:
    """Place of a part where a sensed centre may be: the axis of a hole or boss, the centre of a sphere.

    Attributes:
        ends: end points of an axis; for a point, the point and another one along its axis ``(2, 3)`` [m].
        sizes: smallest and largest size [m] or [rad].
        share: prior probability among all landmarks of its kind.
        hole: whether it is a hole, otherwise a boss.
        number: number among its kind, from 0; equal for several landmarks of one feature.
        name: name of the feature in messages.
        is_line: whether it is an axis.
        others: smallest and largest value of a second size.
    """

    ends: Vectors
    sizes: tuple[float, float]
    share: float
    hole: bool
    number: int
    name: str
    is_line: bool = False
    others: tuple[float, float] = (0.0, 0.0)


KINDS: dict[str, type[Factor]] = {}
"""Classes of factors by the kind of a reading (the column ``kind``)."""


def register_factor(*kinds: str) -> Callable[[_Class], _Class]:
    """Register a class of factors under the kinds of readings that it measures.

    Raises:
        InputError: another class has one of the kinds.
    """

    def register(cls: _Class) -> _Class:
        for kind in kinds:
            if KINDS.setdefault(kind, cls).__qualname__ != cls.__qualname__:
                raise InputError(
                    f"kind: expected a name of its own, got {kind!r}, which is taken. Choose another name."
                )
        return cls

    return register


def factor_class(kind: str) -> type[Factor]:
    """Return the class of factors for a kind of reading, such as ``'point'`` or ``'centre'``."""
    return KINDS[kind]


def compile_factors(
    factors: Sequence[Factor], fixed: float, log_outlier: FloatArray
) -> list[tuple[_core.FactorList, Indices]]:
    """Compile factors for the core: one block per kind, with the rows of its factors.

    Args:
        factors: ``n`` factors.
        fixed: standard deviation that the covariances contain and the scale of the noise does not multiply [m]: of the
            made surface, of rounded coordinates.
        log_outlier: log density of each as an outlier ``(n,)``.
    """
    rows_of = dict[str, list[int]]()
    for row, factor in enumerate(factors):
        rows_of.setdefault(factor.core, []).append(row)
    blocks = []
    for core, rows in rows_of.items():
        own = [factors[row] for row in rows]
        all_columns = [factor.columns() for factor in own]
        columns = {
            name: np.array([values[name] for values in all_columns], dtype=np.float64) for name in all_columns[0]
        }
        columns |= {
            "points": np.array([f.at for f in own]),
            "covs": np.array([f.cov for f in own]) - fixed**2 * np.eye(3),
            "extra": np.full(len(own), fixed**2),
            "log_outlier": np.ascontiguousarray(log_outlier[rows]),
            "normals": np.array([NO_DIRECTION if f.normal is None else f.normal.direction for f in own]),
            "normal_sds": np.array([np.pi if f.normal is None else f.normal.sd for f in own]),
        }
        blocks.append((_core.make_factors(core, columns), np.array(rows, dtype=np.int32)))
    return blocks


def landmark_rows(part: Part) -> FloatArray:
    """Return the landmarks of a part for the core ``(K, 15)``.

    A row has the two ends of an axis (of a point: the point and another one along its axis), least and largest size,
    share, side of the material, number, code of the kind, 1 for a line, least and largest second size.
    """
    codes, rows = _core.landmark_codes(), []
    for cls, number, one in numbered_landmarks(part):
        side = 1.0 if one.hole else -1.0
        rows.append([*one.ends.ravel(), *one.sizes, one.share, side, number, codes[cls.core], one.is_line, *one.others])
    return np.ascontiguousarray(np.array(rows, dtype=np.float64).reshape(-1, 15))


def numbered_landmarks(part: Part) -> list[tuple[type[Factor], int, Landmark]]:
    """Return the landmarks of a part of all kinds, each with its class and its number among all of them."""
    out, first = list[tuple[type[Factor], int, Landmark]](), 0
    for cls in dict.fromkeys(KINDS.values()):
        own = cls.landmarks(part)
        out += [(cls, first + one.number, one) for one in own]
        first += max((one.number + 1 for one in own), default=0)
    return out


NO_DIRECTION = np.zeros(3)
"""Value that the core reads as "no direction sensed"."""


@dataclass(frozen=True, slots=True, eq=False)
class CommonErrors:
    """Errors that several factors have in common, such as those of the mounting of a camera that takes many images.

    Attributes:
        source: source of the errors. Factors whose errors have the same source (the same object) have them in common.
        states: number of errors, each with a standard normal prior.
    """

    source: object
    states: int


def leaf_columns(factors: Sequence[Any], first: int) -> dict[int, list[int]]:
    """Return the columns of the shared errors of each factor, by its ``id``; those of groups have columns of their own.

    Args:
        factors: pose factors of one posterior.
        first: index of the first error.
    """
    out = dict[int, list[int]]()
    for factor, (own, common) in zip(factors, state_columns(factors, first)[0], strict=True):
        if groups := factor.alternatives():
            out |= leaf_columns([one for group in groups for one in group], own)
        else:
            shared = 0 if factor.common is None else factor.common.states
            out[id(factor)] = [*range(own, own + factor.states), *range(common, common + shared)]
    return out


def state_columns(factors: Sequence[Any], first: int) -> tuple[list[tuple[int, int]], int]:
    """Return where the shared errors of factors are: first the errors of each factor, then common errors once.

    Args:
        factors: pose factors of one posterior.
        first: index of the first error.

    Returns:
        For each factor the index of its first shared error and of its first common error; the number of all errors.
    """
    own, common = [], dict[int, int]()
    at = first
    for factor in factors:
        own.append(at)
        at += factor.states
    for factor in factors:
        errors = factor.common
        if errors is not None and id(errors.source) not in common:
            common[id(errors.source)] = at
            at += errors.states
    places = [0 if factor.common is None else common[id(factor.common.source)] for factor in factors]
    return list(zip(own, places, strict=True)), at - first
