"""The kinds of feature, one registry entry each: which perturbations of the frame matter, which map it onto itself.

Rows index the tangent ``(x, y, z, wx, wy, wz)``. The rows of a kind are its perturbation coordinates; the others are
its degrees of freedom, along which it may be re-framed at will and carries no information (paper section 2,
``math.md`` section 2).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from tanteo.errors import InputError
from tanteo.typing import FloatArray, Transforms

Shape: TypeAlias = Literal["plane", "line", "point", "axis", "centre"]
"""What a feature is to other features: a plane, a line or a point; a round one is an axis, a centre, or both."""

_SHAPES: dict[tuple[int, ...], Shape] = {(0, 1): "plane", (0,): "line", (2,): "line", (3, 4, 5): "point"}


@dataclass(frozen=True, slots=True)
class FeatureKind:
    """One kind of feature; all that other rooms ask about a kind follows from these entries.

    Attributes:
        name: lower case, as in readings files.
        rows: tangent rows that matter, in the order of the covariance ``P``.
        frame: what the frame's axes mean, in words.
        flip: a half turn (as rotation diagonal) that maps the undirected feature onto itself, if there is one.
        min_readings: how many readings of one label determine it; 0 if readings are never labelled with this kind.
        faces: how many faces of the part meet there.
        size_name: of a round kind, what its one number is: ``radius`` [m] or ``half angle`` [rad]; empty for others.
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
        """Tangent rows of the continuous symmetry: the degrees of freedom of the frame."""
        return tuple(i for i in range(6) if i not in self.rows)

    @property
    def shape(self) -> Shape | None:
        """Plane, line or point, by the translations that are free; None for others (cone, circle)."""
        slides = tuple(i for i in self.free if i < 3)
        return _SHAPES.get(slides or self.free)

    @property
    def aspects(self) -> tuple[Shape, ...]:
        """As what it enters constraints: its shape; a round kind as its axis, its centre (apex), or both.

        Example:
            >>> tanteo.features.CIRCLE.aspects
            ('axis', 'centre')
        """
        if not self.size_name:
            return () if self.shape is None else (self.shape,)
        axis: tuple[Shape, ...] = () if self.axis is None else ("axis",)
        return (*axis, "centre") if {0, 1, 2} <= set(self.rows) else axis

    @property
    def axis(self) -> int | None:
        """Axis of the frame about which the feature is free to turn: its direction; None if there is not just one."""
        turns = [i - 3 for i in self.free if i >= 3]
        return turns[0] if len(turns) == 1 else None

    @property
    def B(self) -> FloatArray:
        """Binding (selection) matrix ``(size, 6)``: ``p = B e``."""
        return np.eye(6)[list(self.rows)]

    @property
    def symmetries(self) -> Transforms:
        """Discrete symmetries as motions of the feature frame ``(k, 4, 4)``, identity first."""
        motions = [np.eye(4)]
        if self.flip is not None:
            motions.append(np.diag([*self.flip, 1.0]))
        return np.stack(motions)


KINDS: dict[str, FeatureKind] = {}
"""All kinds by name, in the order of their registration."""


def register_kind(kind: FeatureKind) -> FeatureKind:
    """Make a kind known under its name: to readings, constraints and localization.

    Raises:
        InputError: if another kind has that name.
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
    """The kind of that name.

    Raises:
        InputError: for an unknown name; the message lists the known ones.
    """
    if name not in KINDS:
        raise InputError(f"kind: expected one of {', '.join(KINDS)}, got {name!r}.")
    return KINDS[name]


def binding(kind: FeatureKind | str) -> FloatArray:
    """Binding matrix ``B`` ``(size, 6)`` of a kind or of its name."""
    return (feature_kind(kind) if isinstance(kind, str) else kind).B
