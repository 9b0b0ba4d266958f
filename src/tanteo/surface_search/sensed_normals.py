"""Sensed normals against those of faces: how likely they are, and how that changes as the part moves.

On a curved face the normal also changes from place to place: the place that a noisy point is nearest to is not quite
the one that was met, and a part that turns about the axis of a cylinder leaves the cylinder's normals where they are.
With ``H`` the derivative of the unit gradient ``u`` by the place and ``C`` the noise of the point, the sensed normal
is off that of the nearest place by its own tilt and by ``H N(0, C)``. On a plane ``H`` is zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.lie import SO3
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import Touches
from tanteo.typing import Covariances, FloatArray, IntArray, Transforms, Vectors

_BEHIND = -50.0
"""Log density of a sensed normal that points into the part."""


@dataclass(frozen=True, slots=True, eq=False)
class _Bent:
    """Those of the normals that are on curved faces, ``c`` of them.

    Attributes:
        index: into the batch.
        H: derivative of the gradient by the place ``(c, 3, 3)`` [1/m].
        whiten: what makes sines of tilts standard deviations ``(c, 3, 3)``.
        log: half the log determinant of their covariance ``(c,)``.
    """

    index: tuple[IntArray, ...]
    H: Covariances
    whiten: Covariances
    log: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Tilts:
    """Sensed normals against the gradients at the places nearest to their points, all in the part's frame.

    Attributes:
        sensed: unit ``(*batch, 3)``.
        gradients: unit ``(*batch, 3)``.
        sd: of a tilt ``(*batch,)`` [rad].
        gap: sines of the tilts, in standard deviations ``(*batch, 3)``.
        log: log densities of the sensed normals ``(*batch,)``.
    """

    sensed: Vectors
    gradients: Vectors
    sd: FloatArray
    gap: FloatArray
    log: FloatArray
    _bent: _Bent | None

    def rows(self, at: Vectors, gains: FloatArray) -> FloatArray:
        """Derivative of :attr:`gap` by pose and shared errors ``(*batch, 3, 6 + D)``.

        Args:
            at: the points ``(*batch, 3)`` in the part's frame [m].
            gains: of the shared errors on them, in that frame ``(*batch, 3, D)``.
        """
        m, u = self.sensed, self.gradients
        out = np.zeros((*self.gap.shape, 6 + gains.shape[-1]))
        along = np.sum(m * u, axis=-1)[..., None, None]
        turn = (m[..., :, None] * u[..., None, :] - along * np.eye(3)) / self.sd[..., None, None]
        out[..., 3:6] = turn
        if self._bent is not None:
            i, H = self._bent.index, self._bent.H
            moves = np.concatenate([np.broadcast_to(-np.eye(3), H.shape), SO3.hat(at[i]), gains[i]], axis=-1)
            raw = -SO3.hat(m[i]) @ H @ moves
            raw[..., 3:6] += turn[i] * self.sd[i][:, None, None]
            out[i] = self._bent.whiten @ raw
        return out


def tilts(
    touches: Touches,
    target: Target,
    R: Transforms,
    readings: IntArray,
    sensed: Vectors,
    at: Vectors,
    gradients: Vectors,
    triangles: IntArray,
) -> Tilts:
    """Compare sensed normals with gradients.

    Args:
        touches: the readings.
        target: the part.
        R: its attitude for each ``(*batch, 3, 3)``.
        readings: which, with sensed normals all of them ``(*batch,)``.
        sensed: these normals in the part's frame ``(*batch, 3)``.
        at: their points in the part's frame ``(*batch, 3)`` [m].
        gradients: of the faces they may have met ``(*batch, 3)``.
        triangles: of those faces ``(*batch,)``.
    """
    sd, cross = touches.normal_sds[readings], SO3.cross(gradients, sensed)
    gap, spread = cross / sd[..., None], 2 * np.log(sd)
    bent = _bent(touches, target, R, readings, at, gradients, triangles, sd)
    if bent is not None:
        gap[bent.index] = (bent.whiten @ cross[bent.index][..., None])[..., 0]
        spread[bent.index] = bent.log
    behind = np.where(np.sum(sensed * gradients, axis=-1) > 0, 0.0, _BEHIND)
    return Tilts(
        sensed, gradients, sd, gap, behind - 0.5 * np.sum(gap * gap, axis=-1) - np.log(2 * np.pi) - spread, bent
    )


def _bent(
    touches: Touches,
    target: Target,
    R: Transforms,
    readings: IntArray,
    at: Vectors,
    gradients: Vectors,
    triangles: IntArray,
    sd: FloatArray,
) -> _Bent | None:
    """What is different on curved faces; None if all are flat, as far as is known."""
    if target.curved is None:
        return None
    index, b, e = target.curved.bends(at, triangles, gradients)
    if not len(b):
        return None
    if np.isnan(touches.variance):
        world = e @ np.swapaxes(R[index], 1, 2)
        slip = np.sum((world @ touches.covs[readings[index]]) * world, axis=-1)
    else:
        slip = np.full(b.shape, touches.variance)
    own = sd[index][:, None]
    sds = np.sqrt(own**2 + b * b * slip)  # of the tilt towards each e
    about = SO3.cross(e, gradients[index][:, None])  # which the gap shows across it
    less = (1 / sds - 1 / own)[..., None] * about
    whiten = np.eye(3) / own[..., None] + np.swapaxes(less, 1, 2) @ about
    return _Bent(index, np.swapaxes(b[..., None] * e, 1, 2) @ e, whiten, np.log(sds).sum(axis=1))
