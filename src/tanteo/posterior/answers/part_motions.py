"""Motions of a part: of its corners, along its symmetries, and those that no measurement constrains."""

from __future__ import annotations

import numpy as np

from tanteo.fitting.localization import describe_motion, motion_scale
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import Covariances, FloatArray, Tangents, Transforms
from tanteo.parts import Part
from tanteo.words import Motion

_RESISTS = 0.3
"""Smallest motion of a face along its normal, over that of the fastest face, at which the face constrains a motion."""

_MOSTLY = 0.9
"""Fraction of the corners' mean square motion from which a motion is described as a pure shift or rotation."""


def split_by_symmetry(part: Part, free: Tangents, covariance: Covariances) -> tuple[Tangents, Covariances]:
    """Return unobserved motions that no symmetry explains, and the covariance without variance along symmetries.

    Args:
        part: the part.
        free: motions that no measurement constrains, in units of :func:`part_scale` ``(k, 6)``.
        covariance: covariance of the pose ``(6, 6)`` [m, rad]; along ``free`` that of a uniform density.
    """
    symmetric = symmetry_motions(part)
    left, observed = [], np.array(covariance)
    for xi in free:
        if np.linalg.norm(xi - symmetric.T @ (symmetric @ xi)) > 1e-2:
            left.append(xi)
            continue
        scaled = part_scale(part) @ xi
        observed -= (2 * np.pi) ** 2 / 12 * np.outer(scaled, scaled)
    return np.reshape(left, (-1, 6)), observed


def part_scale(part: Part) -> FloatArray:
    """Return unit motions as columns ``(6, 6)``: shifts by the diagonal, turns of 1 rad about the part's centroid."""
    return motion_scale(part.diagonal, part.centroid)


def symmetry_motions(part: Part) -> FloatArray:
    """Return an orthonormal basis of the continuous symmetry's motions ``(k, 6)``, in units of :func:`part_scale`."""
    if not part.symmetry.continuous:
        return np.zeros((0, 6))
    if part.symmetry.spherical:
        axes, point = np.eye(3), part.centroid
    else:
        assert part.symmetry.axis is not None
        point, axis = part.symmetry.axis
        axes = axis[None]
    rows = np.concatenate([np.cross(point - part.centroid, axes) / part.diagonal, axes], axis=1)
    return np.linalg.qr(rows.T)[0].T


def world_axis(part: Part, T_world_part: Transforms) -> FloatArray | None:
    """Return point and direction of the part's axis of revolution in the world ``(2, 3)``; None without one."""
    if part.symmetry.axis is None:
        return None
    point, axis = part.symmetry.axis
    R = T_world_part[:3, :3]
    return np.stack([R @ point + T_world_part[:3, 3], R @ axis])


def symmetry_projector(part: Part) -> FloatArray:
    """Return the projector of motions of the pose that removes the continuous symmetry ``(6, 6)`` [m, rad]."""
    rows, scale = symmetry_motions(part), part_scale(part)
    return np.asarray(scale @ (np.eye(6) - rows.T @ rows) @ np.linalg.inv(scale))


def without_symmetry(part: Part, information: FloatArray) -> FloatArray:
    """Return information on the pose without that along the continuous symmetry ``(*batch, 6, 6)``.

    The facets of a mesh seem to constrain turns that the true surface leaves free.
    """
    if not part.symmetry.continuous:
        return information
    keep = symmetry_projector(part)
    return np.asarray(np.swapaxes(keep, -1, -2) @ information @ keep)


def observed_covariance(part: Part, covariance: Covariances) -> Covariances:
    """Return the covariance of a pose ``(6, 6)`` without its spread along the continuous symmetry."""
    if not part.symmetry.continuous:
        return covariance
    keep = symmetry_projector(part)
    return np.asarray(keep @ covariance @ keep.T)


def corner_sd(part: Part, covariance: Covariances) -> float:
    """Return the largest standard deviation of a corner of the part's box in any direction [m]."""
    J = corner_moves(part)
    return float(np.sqrt(np.linalg.eigvalsh(J @ covariance @ np.swapaxes(J, 1, 2)).max().clip(0.0)))


def box_corners(part: Part) -> FloatArray:
    """Return the corners of the part's box in the part frame ``(8, 3)`` [m]."""
    return np.stack(np.meshgrid(*part.box.T), axis=-1).reshape(8, 3)


def corner_moves(part: Part) -> FloatArray:
    """Return derivatives of the corners of the part's box with respect to the pose, part frame ``(8, 3, 6)``."""
    return point_moves(box_corners(part))


def point_moves(points: FloatArray) -> FloatArray:
    """Return derivatives of points in the part frame ``(K, 3)`` with respect to the pose ``(K, 3, 6)``."""
    J = np.zeros((len(points), 3, 6))
    J[:, :, :3] = np.eye(3)
    x, y, z = points.T
    J[:, 0, 4], J[:, 0, 5], J[:, 1, 3], J[:, 1, 5], J[:, 2, 3], J[:, 2, 4] = z, -y, -z, x, y, -x
    return J


def principal_errors(part: Part, covariance: Covariances) -> Tangents:
    """Return the independent errors of a pose, principal for the mean square displacement of the corners of the box.

    Each is one standard deviation along a direction, and the covariance is the sum of their outer products. The spin of
    a round part is no error.

    Args:
        part: the part.
        covariance: covariance of the pose, part frame, right perturbation ``(6, 6)`` [m, rad].

    Returns:
        Right perturbations, the largest displacement first ``(6 - k, 6)`` [m, rad], with ``k`` motions of symmetry.
    """
    values, vectors = np.linalg.eigh(observed_covariance(part, covariance))
    root = vectors * np.sqrt(values.clip(0.0))
    moved = (corner_moves(part) @ root).reshape(24, 6)
    order = np.linalg.eigh(moved.T @ moved)[1][:, ::-1]
    return np.asarray((root @ order).T[: 6 - len(symmetry_motions(part))])


def motion_of(part: Part, motion: Tangents, T_world_part: Transforms) -> Motion:
    """Describe a motion of the pose in the world, without components that hardly move the part's corners.

    Args:
        part: the part.
        motion: motion of the pose, right perturbation ``(6,)`` [m, rad].
        T_world_part: pose of the part ``(4, 4)``.
    """
    moved = corner_moves(part) @ motion
    middle = moved.mean(axis=0)
    share = len(moved) * float(middle @ middle) / float(np.sum(moved**2))
    if share > _MOSTLY:
        motion = np.r_[middle, np.zeros(3)]
    elif share < 1 - _MOSTLY:  # about an axis through the middle of the box
        motion = np.r_[np.cross(part.box.mean(axis=0), motion[3:]), motion[3:]]
    scale = part_scale(part)
    scaled = np.linalg.solve(scale, motion)
    axis = T_world_part[:3, :3] @ (scaled[3:] if np.any(motion[3:]) else scaled[:3])
    scaled = scaled * np.sign(axis[np.argmax(np.abs(axis))])
    return describe_motion(scaled / np.linalg.norm(scaled), T_world_part, scale)


def where_to_sense(part: Part, T_world_part: Transforms, free: Tangents) -> str:
    """Return advice to sense the planar face that constrains an unobserved motion best; empty if no face does.

    Args:
        part: the part.
        T_world_part: estimated pose of the part ``(4, 4)``.
        free: unobserved motion, in units of :func:`part_scale` ``(6,)``.
    """
    if not len(part.planes):
        return ""
    row = np.full(len(part.faces), -1)
    row[part.planes.faces] = np.arange(len(part.planes))
    plane = row[part.triangle_face]
    middles = part.vertices[part.triangles].mean(axis=1)
    n = part.planes.normals[plane]
    # not at the centre of a face, which a turn about an axis in front of it only slides
    moved = np.abs(n @ (free[:3] * part.diagonal) + np.cross(middles - part.centroid, n) @ free[3:])
    moved[plane < 0] = 0.0
    worth = np.where(moved > _RESISTS * moved.max(initial=0.0), moved * np.sqrt(part.planes.areas[plane]), 0.0)
    if worth.max(initial=0.0) <= 1e-9:
        return ""
    k = int(np.argmax(worth))
    at = T_world_part[:3, :3] @ middles[k] + T_world_part[:3, 3]
    name = part.faces[part.triangle_face[k]].name
    return f"sense {name} of {part.name}, around ({', '.join(f'{1e3 * v:.0f}' for v in at)}) mm in the world"


def without_symmetric_rotation(part: Part, gaps: Transforms) -> Transforms:
    """Return relative poses ``(*batch, 4, 4)`` without their rotation along the part's continuous symmetry."""
    if part.symmetry.spherical:
        centre = part.centroid
        shift = SE3.apply(gaps, centre) - centre
        return SE3.from_parts(np.broadcast_to(np.eye(3), gaps[..., :3, :3].shape), shift)
    assert part.symmetry.axis is not None
    point, axis = part.symmetry.axis
    q = SO3.as_quaternion(gaps[..., :3, :3])
    angle = 2 * np.arctan2(q[..., 1:] @ axis, q[..., 0])
    R = SO3.exp(-angle[..., None] * axis)
    spin = SE3.from_parts(R, point - SE3.apply(R, point))
    return np.asarray(gaps @ spin)
