"""The sensed features as arrays, with the scalar bounds that the gates of the tree use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tanteo.errors import InputError
from tanteo.features import Feature, collect_shared, feature_covariance
from tanteo.typing import BoolArray, FloatArray, Vectors

if TYPE_CHECKING:
    from tanteo.fitting import Sides

KINDS_IN_TREE = ("plane", "edge", "vertex")
_AXIS = {"plane": 2, "edge": 0}


@dataclass(frozen=True, slots=True, eq=False)
class Sensed:
    """``n`` sensed features, and the other views of those whose side is unknown.

    Rows of all arrays are views: the first ``n`` are the features as given, the rest are second views of some.

    Attributes:
        features: one a view.
        views: rows of each feature's views ``n`` tuples; two where the outward side is unknown.
        kinds: name of each view's kind.
        directions: normals and edge directions in the world ``(n, 3)``; zero for vertices.
        points: a point of each that lies within the model feature's extent ``(n, 3)`` [m].
        placed: whether that is known (it was sensed at points, or is a vertex) ``(n,)``.
        tilt: largest sd of the direction ``(n,)`` [rad].
        shift: largest sd of the position across the feature ``(n,)`` [m].
        span: largest distance between two of the feature's points ``(n,)`` [m].
        width: least width of its points across any direction in the plane ``(n,)`` [m]; 0 for edges and vertices.
        gains: whitened shared errors of each feature ``(size, D)``.
        angle: between directions ``(n, n)`` [rad].
        along: ``n_i . (x_j - x_i)`` ``(n, n)`` [m].
        along_sd: a bound on its sd, model tolerance excluded ``(n, n)`` [m].
        distance: between points ``(n, n)`` [m].
    """

    features: tuple[Feature, ...]
    views: tuple[tuple[int, ...], ...]
    kinds: tuple[str, ...]
    directions: FloatArray
    points: FloatArray
    placed: BoolArray
    tilt: FloatArray
    shift: FloatArray
    span: FloatArray
    width: FloatArray
    gains: tuple[FloatArray, ...]
    angle: FloatArray
    along: FloatArray
    along_sd: FloatArray
    distance: FloatArray

    def __len__(self) -> int:
        return len(self.views)

    @property
    def middle(self) -> Vectors:
        """Of the points, in the world ``(3,)`` [m]; the world's origin if there is none."""
        return np.asarray(self.points.mean(axis=0)) if len(self.points) else np.zeros(3)


def sense(given: Sequence[Sides]) -> Sensed:
    """Prepare sensed features for the tree; a pair stands for one plane seen from either side.

    Raises:
        InputError: for a kind other than plane, edge or vertex.
    """
    pairs = [f if isinstance(f, tuple) else (f,) for f in given]
    second = [pair[1] for pair in pairs if len(pair) > 1]
    features = [pair[0] for pair in pairs] + second
    extra = iter(range(len(pairs), len(features)))
    views = tuple((i, next(extra)) if len(pair) > 1 else (i,) for i, pair in enumerate(pairs))
    for feature in features:
        if feature.kind.name not in KINDS_IN_TREE:
            raise InputError(
                f"feature {feature.label!r}: expected a plane, edge or vertex, got a {feature.kind.name}. "
                "Curved features are not matched yet; sense planes, edges or vertices."
            )
    n = len(features)
    kinds = tuple(feature.kind.name for feature in features)
    Ts = np.array([feature.T_world_feature for feature in features]).reshape(n, 4, 4)
    directions = np.array(
        [T[:3, _AXIS[k]] if k in _AXIS else np.zeros(3) for T, k in zip(Ts, kinds, strict=True)]
    ).reshape(n, 3)
    points = np.array([f.support.mean(axis=0) if len(f.support) else f.T_world_feature[:3, 3] for f in features])
    points = points.reshape(n, 3)
    C = np.array([feature_covariance(feature) for feature in features]).reshape(n, 6, 6)
    tilt, shift = (np.sqrt(np.linalg.eigvalsh(C[:, s, s])[:, -1].clip(0)) for s in (slice(3, 6), slice(0, 3)))
    tilt = np.where([k == "vertex" for k in kinds], 0.0, tilt)
    gap = points[None] - points[:, None]
    distance = np.linalg.norm(gap, axis=-1)
    errors, covariance, gains = collect_shared(features)
    values, vectors = np.linalg.eigh(covariance) if errors else (np.zeros(0), np.zeros((0, 0)))
    L = vectors * np.sqrt(values.clip(0))
    return Sensed(
        tuple(features),
        views,
        kinds,
        directions,
        points,
        np.array([len(f.support) > 0 or k == "vertex" for f, k in zip(features, kinds, strict=True)], dtype=bool),
        tilt,
        shift,
        *_sizes(features),
        tuple(A @ L for A in gains),
        np.arccos(np.clip(directions @ directions.T, -1.0, 1.0)),
        np.einsum("ik,ijk->ij", directions, gap),
        np.sqrt(shift[:, None] ** 2 + shift**2 + (tilt[:, None] * distance) ** 2),
        distance,
    )


def _sizes(features: Sequence[Feature]) -> tuple[FloatArray, FloatArray]:
    """Largest and least width of each feature's points."""
    span, width = np.zeros(len(features)), np.zeros(len(features))
    turns = np.linspace(0, np.pi, 36, endpoint=False)
    around = np.stack([np.cos(turns), np.sin(turns)])
    for i, feature in enumerate(features):
        if len(feature.support) < 2:
            continue
        gaps = feature.support[:, None] - feature.support[None]
        span[i] = np.sqrt((gaps**2).sum(axis=-1).max())
        if feature.kind.name == "plane":
            local = (feature.support - feature.support.mean(axis=0)) @ feature.T_world_feature[:3, :2]
            width[i] = np.ptp(local @ around, axis=0).min() * np.cos(turns[1] / 2)
    return span, width
