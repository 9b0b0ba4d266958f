"""Register the kinds of features: which perturbations of the frame matter, and which map the feature onto itself.

Rows index the tangent ``(x, y, z, wx, wy, wz)``. The rows of a kind are its perturbation coordinates. The other rows
are its free directions: motions along them leave the feature unchanged and carry no information (paper section 2,
``math.md`` section 2).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry.typing import FloatArray, Transforms

Shape: TypeAlias = Literal["plane", "line", "point", "axis", "centre"]
"""Role of a feature in constraints: a plane, line or point; a round feature has an axis, a centre, or both."""

_SHAPES: dict[tuple[int, ...], Shape] = {(0, 1): "plane", (0,): "line", (2,): "line", (3, 4, 5): "point"}


@dataclass(frozen=True, slots=True)
class FeatureKind:
    """Kind of features; all properties of a kind follow from these entries.

    Attributes:
        name: name in lower case, as in readings files.
        rows: tangent rows that matter, in the order of the covariance ``P``.
        frame: meaning of the frame's axes.
        flip: half turn (as rotation diagonal) that maps the undirected feature onto itself; None if there is none.
        min_readings: smallest number of readings that determine it; 0 if readings are never labelled with this kind.
        faces: number of faces of the part that meet at the feature.
        size_name: name of a round feature's size: ``radius`` [m] or ``half angle`` [rad]; empty for other kinds.
    """

    name: str
    rows: tuple[int, ...]
    frame: str
    flip: tuple[float, float, float] | None = None
    min_readings: int = 0
    faces: int = 1
    size_name: str = ""

    @property
    def size(self) -> int:
        """Number of perturbation coordinates."""
        return len(self.rows)

    @property
    def free(self) -> tuple[int, ...]:
        """Tangent rows of the continuous symmetry, the degrees of freedom of the frame."""
        return tuple(i for i in range(6) if i not in self.rows)

    @property
    def shape(self) -> Shape | None:
        """Plane, line or point, by the free translations; None for other kinds (cone, circle)."""
        slides = tuple(i for i in self.free if i < 3)
        return _SHAPES.get(slides or self.free)

    @property
    def aspects(self) -> tuple[Shape, ...]:
        """Roles in constraints: the shape; for a round kind its axis, its centre (apex), or both.

        Example:
            >>> tanteo.features.kinds.CIRCLE.aspects
            ('axis', 'centre')
        """
        if not self.size_name:
            return () if self.shape is None else (self.shape,)
        axis: tuple[Shape, ...] = () if self.axis is None else ("axis",)
        return (*axis, "centre") if {0, 1, 2} <= set(self.rows) else axis

    @property
    def axis(self) -> int | None:
        """Frame axis of the only free rotation, which is the feature's direction.

        None if there is no or more than one.
        """
        turns = [i - 3 for i in self.free if i >= 3]
        return turns[0] if len(turns) == 1 else None

    @property
    def B(self) -> FloatArray:
        """Selection (binding) matrix ``(size, 6)``: ``p = B e``."""
        return np.eye(6)[list(self.rows)]

    @property
    def symmetries(self) -> Transforms:
        """Discrete symmetries as motions of the feature frame ``(k, 4, 4)``, identity first."""
        motions = [np.eye(4)]
        if self.flip is not None:
            motions.append(np.diag([*self.flip, 1.0]))
        return np.stack(motions)


KINDS: dict[str, FeatureKind] = {}
"""All kinds by name, in the order of registration."""


def register_kind(kind: FeatureKind) -> FeatureKind:
    """Register a kind for readings, constraints and localization, and return it.

    Args:
        kind: kind to register.

    Raises:
        InputError: another kind has that name.
    """
    if KINDS.setdefault(kind.name, kind) != kind:
        raise InputError(f"kind: expected a name of its own, got {kind.name!r}, which is taken. Choose another name.")
    return kind


PLANE = register_kind(FeatureKind("plane", (2, 3, 4), "z is the outward normal", min_readings=3))
EDGE = register_kind(FeatureKind("edge", (1, 2, 4, 5), "x along the edge", (-1.0, -1.0, 1.0), min_readings=2, faces=2))
VERTEX = register_kind(FeatureKind("vertex", (0, 1, 2), "origin at the point", min_readings=1, faces=3))
HALF_EDGE = register_kind(FeatureKind("half_edge", (1, 2, 3, 4, 5), "x along the edge, z out of the labelled face"))
CYLINDER = register_kind(
    FeatureKind(
        "cylinder", (0, 1, 3, 4), "origin and z on the axis", (1.0, -1.0, -1.0), min_readings=5, size_name="radius"
    )
)
CONE = register_kind(
    FeatureKind("cone", (0, 1, 2, 3, 4), "origin at the apex, z into the cone", min_readings=6, size_name="half angle")
)
CIRCLE = register_kind(
    FeatureKind(
        "circle",
        (0, 1, 2, 3, 4),
        "origin at the centre, z along its axis",
        (1.0, -1.0, -1.0),
        min_readings=3,
        faces=2,
        size_name="radius",
    )
)
SPHERE = register_kind(FeatureKind("sphere", (0, 1, 2), "origin at the centre", min_readings=4, size_name="radius"))


def feature_kind(name: str) -> FeatureKind:
    """Return the kind with a given name.

    Args:
        name: name of the kind.

    Raises:
        InputError: the name is unknown; the message lists the known ones.
    """
    if name not in KINDS:
        raise InputError(f"kind: expected one of {', '.join(KINDS)}, got {name!r}.")
    return KINDS[name]


def binding(kind: FeatureKind | str) -> FloatArray:
    """Return the selection (binding) matrix ``B`` ``(size, 6)`` of a kind.

    Args:
        kind: kind, or its name.
    """
    return (feature_kind(kind) if isinstance(kind, str) else kind).B
