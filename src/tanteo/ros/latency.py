"""Estimate the latency of readings relative to their stamps, from the motion of the sensor and a part at rest.

With sensor velocity ``v`` and latency ``t``, points are displaced by ``v t``. If the sensor moved in several
directions, no pose of the part explains that, and ``t`` is estimated jointly with the pose.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.answers import Hypothesis
from tanteo.lie import SE3, maximize
from tanteo.parts import Part
from tanteo.sensors import PointMeasurements, Readings
from tanteo.shapes import Surface
from tanteo.typing import Covariances, FloatArray, Transforms, Vectors

STEP = 2e-3
"""By how much readings are shifted to see how they move [s]."""
_LEAST, _TRIALS = 10, 12
"""Readings that are needed, and steps of the fit at most."""
_SETTLED = 1e-6
"""Squared length of a step, in standard deviations, that ends the fit."""
_SDS, _WORTH = 4.0, 5e-4
"""A latency counts from so many standard deviations on, and from so much on [s]."""
_TOLD = 0.1
"""One that is known less well is not told by the motion [s]."""
_TURN, _SHIFT = 0.1, 0.02
"""How far the pose may be from the one of the answer, one standard deviation [rad, m]."""


@dataclass(frozen=True, slots=True)
class Latency:
    """How much older readings are than was taken.

    Attributes:
        seconds: the estimate; negative where they are younger.
        sd: of it [s].
    """

    seconds: float
    sd: float

    @property
    def contradicts(self) -> bool:
        """Whether the readings contradict what was taken."""
        return abs(self.seconds) > max(_SDS * self.sd, _WORTH)

    def words(self, taken: float) -> str:
        """One sentence for a person, with what to do.

        Args:
            taken: latency with which they were read [s].
        """
        total, more = 1e3 * (taken + self.seconds), "older" if self.seconds > 0 else "younger"
        if self.contradicts:
            return (
                f"By the motion of the sensor, readings are {1e3 * abs(self.seconds):.1f} ms (sd "
                f"{1e3 * self.sd:.1f} ms) {more} than taken: say --latency {total:.1f}ms, or stamp them when sensed."
            )
        return (
            f"By the motion of the sensor, readings are {total:.1f} ms (sd {1e3 * self.sd:.1f} ms) older than stamped."
        )


def estimate_latency(
    shifted: Sequence[Readings],
    step: float,
    measured: Callable[[Readings], PointMeasurements],
    hypothesis: Hypothesis,
    part: Part,
) -> Latency | None:
    """The latency that explains the readings best, together with a pose near that of a hypothesis.

    Args:
        shifted: the same readings as taken, and as if they were younger and older by ``step``.
        step: that time [s].
        measured: makes measurements of them.
        hypothesis: what is there.
        part: the part of it.

    Returns:
        None where the readings are few, or their motion does not tell it.
    """
    points, before, after = (measured(one) for one in shifted)
    kept = np.array([name not in hypothesis.outliers for name in points.ids], dtype=bool)
    if int(kept.sum()) < _LEAST:
        return None
    velocity = (after.points - before.points)[kept] / (2 * step)
    found = _fitted(points.points[kept], velocity, points.covs[kept], points.radii[kept], hypothesis.T_world_part, part)
    return found if found is not None and found.sd < _TOLD else None


def _fitted(
    points: Vectors, velocity: Vectors, covs: Covariances, radii: FloatArray, T: Transforms, part: Part
) -> Latency | None:
    """Gauss-Newton over the latency and six motions of the part."""
    surface = Surface(part.vertices, part.triangles)
    prior = np.diag([1e-9, *[_SHIFT**-2] * 3, *[_TURN**-2] * 3])

    def equations(state: tuple[float, Transforms]) -> tuple[FloatArray, FloatArray, float]:
        t, T = state
        local, moving = SE3.apply(SE3.inverse(T), points + t * velocity), velocity @ T[:3, :3]
        near = surface.closest(local)
        normals = surface.normals[near.triangles]
        along = normals @ T[:3, :3].T
        sds = np.sqrt(np.einsum("ni,nij,nj->n", along, covs, along))
        r = (np.einsum("ni,ni->n", normals, local - near.points) - radii) / sds
        weights = 1 / np.maximum(1.0, np.abs(r) / 3)  # of Huber: a reading beside an edge may have another face
        J = np.c_[np.einsum("ni,ni->n", normals, moving), -normals, -np.cross(local, normals)] / sds[:, None]
        return J.T @ (weights[:, None] * J) + prior, -J.T @ (weights * r), float(weights @ r**2)

    (t, T), steps = maximize(
        (0.0, T),
        lambda state: equations(state)[:2],
        lambda state, step: (state[0] + float(step[0]), state[1] @ SE3.exp(step[1:])),
        _TRIALS,
        _SETTLED,
    )
    if steps >= _SETTLED:
        return None
    P, _, cost = equations((t, T))
    spread = np.sqrt(max(cost / max(len(points) - 7, 1), 1.0))
    return Latency(t, float(spread * np.sqrt(np.linalg.inv(P)[0, 0])))
