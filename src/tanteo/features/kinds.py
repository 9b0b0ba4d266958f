"""The kinds of feature: which perturbations of its frame matter, and which motions map it onto itself.

Rows index the tangent ``(x, y, z, wx, wy, wz)``. The rows of a kind are its perturbation coordinates; the others are
its degrees of freedom, along which it may be re-framed at will and carries no information (paper section 2,
``math.md`` section 2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.typing import FloatArray, Transforms


@dataclass(frozen=True, slots=True)
class FeatureKind:
    """One row of the table of kinds.

    Attributes:
        name: lower case, as in readings files.
        rows: tangent rows that matter, in the order of the covariance ``P``.
        frame: what the frame's axes mean, in words.
        flip: a half turn (as rotation diagonal) that maps the undirected feature onto itself, if there is one.
    """

    name: str
    rows: tuple[int, ...]
    frame: str
    flip: tuple[float, float, float] | None = None

    @property
    def size(self) -> int:
        """Number of perturbation coordinates."""
        return len(self.rows)

    @property
    def free(self) -> tuple[int, ...]:
        """Tangent rows of the continuous symmetry: the degrees of freedom of the frame."""
        return tuple(i for i in range(6) if i not in self.rows)

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


VERTEX = FeatureKind("vertex", (0, 1, 2), "origin at the point")
EDGE = FeatureKind("edge", (1, 2, 4, 5), "x along the edge", flip=(-1.0, -1.0, 1.0))
PLANE = FeatureKind("plane", (2, 3, 4), "z is the outward normal")
HALF_EDGE = FeatureKind("half_edge", (1, 2, 3, 4, 5), "x along the edge, z out of the labelled face")
CYLINDER = FeatureKind("cylinder", (1, 2, 4, 5), "x along the axis", flip=(-1.0, -1.0, 1.0))
CONE = FeatureKind("cone", (0, 1, 2, 4, 5), "origin at the apex, x along the axis")
CIRCLE = FeatureKind("circle", (0, 1, 2, 3, 4), "origin at the centre, z normal", flip=(1.0, -1.0, -1.0))
SPHERE = FeatureKind("sphere", (0, 1, 2), "origin at the centre")

KINDS: dict[str, FeatureKind] = {
    kind.name: kind for kind in (VERTEX, EDGE, PLANE, HALF_EDGE, CYLINDER, CONE, CIRCLE, SPHERE)
}


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
