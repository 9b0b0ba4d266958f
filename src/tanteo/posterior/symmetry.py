"""Symmetric poses: mapped to the image nearest to a reference, with the turn of a continuous symmetry fixed."""

from __future__ import annotations

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.parts import Part
from tanteo.posterior.answers.part_motions import without_symmetric_rotation
from tanteo.posterior.prepared import PreparedPart

GAUGE_SD = 0.1
"""Numerical: standard deviation of a turn that symmetry leaves free, about a reference [rad]. The evidence does not
depend on it: :func:`log_orbit` accounts for the rest of the circle. A small value keeps samples nearly normal."""


def is_gauge_fixed(prepared: PreparedPart, *, named: bool) -> bool:
    """Return whether the turn of a continuous symmetry is fixed.

    Args:
        prepared: the part.
        named: whether a prior pose selects one of the symmetric poses; then it fixes the turn.
    """
    return prepared.part.symmetry.continuous and not named


def log_orbit(prepared: PreparedPart, *, named: bool) -> float:
    """Return the log of the number of symmetric poses; for a continuous symmetry, of the angle or volume of turns."""
    symmetry = prepared.part.symmetry
    if named:
        return 0.0
    out = float(np.log(symmetry.order))
    if symmetry.spherical:
        return out + float(np.log(8 * np.pi**2))
    return out + float(np.log(2 * np.pi)) * symmetry.continuous


def folded(prepared: PreparedPart, Ts: Transforms, references: Transforms, *, named: bool) -> Transforms:
    """Return each pose ``(S, 4, 4)`` as the symmetric image nearest to one of the references ``(R, 4, 4)``."""
    part, turns = prepared.part, prepared.part.symmetry.Ts
    if not len(Ts) or not len(references) or (len(turns) == 1 and not part.symmetry.continuous):
        return Ts
    images = Ts[:, None] @ turns
    if is_gauge_fixed(prepared, named=named):
        images = references[0] @ without_symmetric_rotation(part, SE3.inverse(references[0]) @ images)
    gaps = SE3.inverse(references)[:, None, None] @ images
    shift = SE3.apply(gaps, prepared.centre) - prepared.centre
    cosine = 0.5 * (np.trace(gaps[..., :3, :3], axis1=-2, axis2=-1) - 1)
    size = 0.25 * part.diagonal
    squared = (np.sum(shift**2, axis=-1) / size**2 + 2 * (1 - cosine)).min(axis=0)
    return np.ascontiguousarray(images[np.arange(len(Ts)), squared.argmin(axis=1)])


def log_gauge(prepared: PreparedPart, Ts: Transforms, reference: Transforms) -> FloatArray:
    """Return the log density of the turn along a continuous symmetry about a reference ``(S,)``."""
    part = prepared.part
    gaps = SE3.inverse(reference) @ Ts
    if part.symmetry.spherical:
        w = SE3.log(gaps)[..., 3:]
        return np.asarray(-0.5 * np.sum(w * w, axis=-1) / GAUGE_SD**2 - 3 * np.log(GAUGE_SD) - 1.5 * np.log(2 * np.pi))
    assert part.symmetry.axis is not None
    axis = part.symmetry.axis[1]
    left = without_symmetric_rotation(part, gaps)
    spin = SE3.log(SE3.inverse(left) @ gaps)[..., 3:] @ axis
    return np.asarray(-0.5 * (spin / GAUGE_SD) ** 2 - np.log(GAUGE_SD) - 0.5 * np.log(2 * np.pi))


def gauge_information(prepared: PreparedPart) -> FloatArray:
    """Return the information about the centre that fixing the turn adds ``(6, 6)``."""
    out, symmetry = np.zeros((6, 6)), prepared.part.symmetry
    if symmetry.spherical:
        out[3:, 3:] = np.eye(3) / GAUGE_SD**2
    elif symmetry.axis is not None:
        out[3:, 3:] = np.outer(symmetry.axis[1], symmetry.axis[1]) / GAUGE_SD**2
    return out


_LEVEL = 1e-3
"""Numerical: difference of the heights of z axes, as cosines, up to which poses count as equally upright."""


def upright(part: Part, T_world_part: Transforms) -> Transforms:
    """Return the symmetry of a part that turns its pose to the equivalent one with z up and the least turn.

    Args:
        part: the part.
        T_world_part: pose of the part ``(4, 4)``.

    Returns:
        Motion ``T_part_part`` ``(4, 4)``, so that the equivalent pose is ``T_world_part`` times it.
    """
    images = T_world_part @ part.symmetry.Ts
    if part.symmetry.continuous:
        fixed = SE3.from_parts(np.eye(3), images[:, :3, 3])
        images = fixed @ without_symmetric_rotation(part, SE3.inverse(fixed) @ images)
    heights = images[:, 2, 2]
    turns = np.where(heights >= heights.max() - _LEVEL, np.trace(images[:, :3, :3], axis1=1, axis2=2), -np.inf)
    return np.asarray(SE3.inverse(T_world_part) @ images[int(np.argmax(turns))])
