"""Relations between a sensed and a model feature: residuals and their derivatives.

For the relative frame ``T_model_feature = (R = [n o a], p)`` every relation has a residual ``f`` that is zero when
the pairing is exact and a derivative ``D`` with ``f(T exp(e)) ~ f + D e`` (``math.md`` section 5). ``f`` depends on
the arbitrary placement of a frame along its free directions only through an invertible linear map.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.features.kinds import CIRCLE, CYLINDER, EDGE, KINDS, PLANE, SPHERE, VERTEX, FeatureKind
from tanteo.geometry.typing import FloatArray, Transforms

Linear = tuple[FloatArray, FloatArray]
"""Residual ``(*batch, m)`` and derivative ``(*batch, m, 6)``."""


@dataclass(frozen=True, slots=True)
class Relation:
    """One row of the table of ``math.md`` section 5.

    Attributes:
        name: name, for example ``plane_plane`` or ``vertex_on_edge``.
        sensed: kind of the sensed feature.
        model: kind of the model feature.
        size: number of equations.
        linearize: function ``(T_model_feature, radius) -> (f, D)``.
    """

    name: str
    sensed: FeatureKind
    model: FeatureKind
    size: int
    linearize: Callable[[Transforms, FloatArray], Linear]


def _columns(T: Transforms) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    return T[..., :3, 0], T[..., :3, 1], T[..., :3, 2], T[..., :3, 3]


def _point_rows(T: Transforms, axes: list[int]) -> Linear:
    """Return the coordinates of the sensed origin along model axes: ``[R | 0]``."""
    D = np.zeros((*T.shape[:-2], len(axes), 6))
    D[..., :3] = T[..., axes, :3]
    return T[..., axes, 3], D


def _x_axis_rows(T: Transforms) -> Linear:
    """Return ``(n_y, n_z)``, the deviation of the sensed x axis from the model's: ``[0 | 0, -a_k, o_k]``."""
    D = np.zeros((*T.shape[:-2], 2, 6))
    D[..., 4], D[..., 5] = -T[..., 1:3, 2], T[..., 1:3, 1]
    return T[..., 1:3, 0], D


def _z_axis_rows(T: Transforms) -> Linear:
    """Return ``(a_x, a_y)``, the deviation of the sensed normal from the model's: ``[0 | -o_k, n_k, 0]``."""
    D = np.zeros((*T.shape[:-2], 2, 6))
    D[..., 3], D[..., 4] = -T[..., :2, 1], T[..., :2, 0]
    return T[..., :2, 2], D


def _stack(*parts: Linear) -> Linear:
    return np.concatenate([f for f, _ in parts], axis=-1), np.concatenate([D for _, D in parts], axis=-2)


def _one(f: FloatArray, D: FloatArray) -> Linear:
    return f[..., None], D[..., None, :]


def _point_on_line(T: Transforms, radius: FloatArray) -> Linear:
    return _point_rows(T, [1, 2])


def _point_on_plane(T: Transforms, radius: FloatArray) -> Linear:
    return _point_rows(T, [2])


def _line_on_plane(T: Transforms, radius: FloatArray) -> Linear:
    D = np.zeros((*T.shape[:-2], 6))
    D[..., 4], D[..., 5] = -T[..., 2, 2], T[..., 2, 1]
    return _stack(_point_rows(T, [2]), _one(T[..., 2, 0], D))


def _plane_has_point(T: Transforms, radius: FloatArray) -> Linear:
    n, o, a, p = _columns(T)
    D = np.zeros((*T.shape[:-2], 6))
    D[..., 2], D[..., 3], D[..., 4] = -1.0, np.sum(o * p, -1), -np.sum(n * p, -1)
    return _one(-np.sum(a * p, -1), D)


def _plane_has_line(T: Transforms, radius: FloatArray) -> Linear:
    D = np.zeros((*T.shape[:-2], 6))
    D[..., 3], D[..., 4] = -T[..., 0, 1], T[..., 0, 0]
    return _stack(_plane_has_point(T, radius), _one(T[..., 0, 2], D))


def _line_through_point(T: Transforms, radius: FloatArray) -> Linear:
    n, o, a, p = _columns(T)
    D = np.zeros((*T.shape[:-2], 2, 6))
    D[..., 0, 1] = D[..., 1, 2] = 1.0
    D[..., 0, 3], D[..., 0, 5] = np.sum(a * p, -1), -np.sum(n * p, -1)
    D[..., 1, 3], D[..., 1, 4] = -np.sum(o * p, -1), np.sum(n * p, -1)
    return np.stack([np.sum(o * p, -1), np.sum(a * p, -1)], axis=-1), D


def _at_radius(T: Transforms, axes: list[int], radius: FloatArray) -> Linear:
    """Return the distance of the sensed origin from the model's axis or centre, less the radius."""
    q = T[..., axes, 3]
    rho = np.linalg.norm(q, axis=-1)
    safe = np.where(rho > 0, rho, 1.0)  # on the axis itself the direction is undefined: derivative zero
    D = np.zeros((*T.shape[:-2], 6))
    D[..., :3] = np.einsum("...k,...kj->...j", q / safe[..., None], T[..., axes, :3])
    return _one(rho - radius, D)


def _point_on_cylinder(T: Transforms, radius: FloatArray) -> Linear:
    return _at_radius(T, [0, 1], radius)


def _point_on_sphere(T: Transforms, radius: FloatArray) -> Linear:
    return _at_radius(T, [0, 1, 2], radius)


def _point_on_circle(T: Transforms, radius: FloatArray) -> Linear:
    return _stack(_point_rows(T, [2]), _at_radius(T, [0, 1], radius))


def _on_axis(T: Transforms, radius: FloatArray) -> Linear:
    """Return the relation of a sensed circle or axis with the axis of a model cylinder."""
    return _stack(_point_rows(T, [0, 1]), _z_axis_rows(T))


def _axis_through(T: Transforms, radius: FloatArray) -> Linear:
    """Return the relation of a sensed axis with the model's centre and axis."""
    n, o, a, p = _columns(T)
    D = np.zeros((*T.shape[:-2], 2, 6))
    D[..., 0, 0] = D[..., 1, 1] = 1.0
    D[..., 0, 4], D[..., 0, 5] = -np.sum(a * p, -1), np.sum(o * p, -1)
    D[..., 1, 3], D[..., 1, 5] = np.sum(a * p, -1), -np.sum(n * p, -1)
    return _stack((np.stack([np.sum(n * p, -1), np.sum(o * p, -1)], axis=-1), D), _z_axis_rows(T))


def _circle_in_plane(T: Transforms, radius: FloatArray) -> Linear:
    return _stack(_point_rows(T, [2]), _z_axis_rows(T))


def _same(kind: FeatureKind) -> Relation | None:
    """Return the relation of two features of one kind; None if neither a direction nor a point describes it."""
    slides = [i for i in kind.rows if i < 3]
    turns = {None: [], 0: [_x_axis_rows], 2: [_z_axis_rows]}.get(kind.axis)
    if turns is None or kind.size != len(slides) + 2 * len(turns):
        return None

    def linearize(T: Transforms, radius: FloatArray) -> Linear:
        return _stack(_point_rows(T, slides), *(rows(T) for rows in turns))

    return Relation(f"{kind.name}_{kind.name}", kind, kind, kind.size, linearize)


_BETWEEN_KINDS = (
    Relation("vertex_on_edge", VERTEX, EDGE, 2, _point_on_line),
    Relation("vertex_on_plane", VERTEX, PLANE, 1, _point_on_plane),
    Relation("edge_on_plane", EDGE, PLANE, 2, _line_on_plane),
    Relation("plane_has_vertex", PLANE, VERTEX, 1, _plane_has_point),
    Relation("plane_has_edge", PLANE, EDGE, 2, _plane_has_line),
    Relation("edge_has_vertex", EDGE, VERTEX, 2, _line_through_point),
    Relation("point_on_cylinder", VERTEX, CYLINDER, 1, _point_on_cylinder),
    Relation("point_on_sphere", VERTEX, SPHERE, 1, _point_on_sphere),
    Relation("point_on_circle", VERTEX, CIRCLE, 2, _point_on_circle),
    Relation("circle_on_cylinder", CIRCLE, CYLINDER, 4, _on_axis),
    Relation("cylinder_has_circle", CYLINDER, CIRCLE, 4, _axis_through),
    Relation("circle_in_plane", CIRCLE, PLANE, 3, _circle_in_plane),
)

RELATIONS: dict[str, Relation] = {r.name: r for r in (*map(_same, KINDS.values()), *_BETWEEN_KINDS) if r is not None}
"""Relations by name; a new relation is one more entry. Kinds that are registered later join when they are paired."""


def relation_between(sensed: FeatureKind, model: FeatureKind) -> Relation:
    """Return the relation of a sensed kind with a model kind.

    Raises:
        InputError: if no relation between the two kinds is registered.
    """
    for relation in RELATIONS.values():
        if relation.sensed == sensed and relation.model == model:
            return relation
    if sensed == model and (same := _same(sensed)):
        return RELATIONS.setdefault(same.name, same)
    known = ", ".join(RELATIONS)
    raise InputError(f"pairing: expected one of {known}, got a sensed {sensed.name} with a model {model.name}.")
