"""Estimation of the latency of readings relative to their stamps, from the motion of the sensor and a part at rest.

With sensor velocity ``v`` and latency ``t``, points are displaced by ``v t``. If the sensor moved in several
directions, no pose of the part explains these displacements, so ``t`` can be estimated jointly with the pose.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.geometry import SE3, maximize
from tanteo.geometry.typing import Covariances, FloatArray, Transforms, Vectors
from tanteo.parts import Part, Surface
from tanteo.posterior import Hypothesis
from tanteo.sensors import PointMeasurements, Readings

STEP = 2e-3
"""Time shift of the readings for the velocity by central differences [s]."""
_LEAST, _TRIALS = 10, 12
"""Smallest number of readings, and largest number of steps of the fit."""
_CONVERGED = 1e-6
"""Squared length of a step, in standard deviations, at which the fit has converged."""
_SDS, _WORTH = 4.0, 5e-4
"""Smallest significant latency, in standard deviations and in absolute terms [s]."""
_LARGEST_SD = 0.1
"""Largest standard deviation of a usable estimate [s]."""
_TURN, _SHIFT = 0.1, 0.02
"""Prior standard deviation of the pose about the hypothesis [rad, m]."""


@dataclass(frozen=True, slots=True)
class Latency:
    """Estimated difference of the true latency from the assumed one.

    Attributes:
        seconds: estimate [s], positive if readings are older than assumed.
        sd: standard deviation of the estimate [s].
    """

    seconds: float
    sd: float

    @property
    def contradicts(self) -> bool:
        """Whether the estimate differs significantly from the assumed latency."""
        return abs(self.seconds) > max(_SDS * self.sd, _WORTH)

    def words(self, taken: float) -> str:
        """Return the estimate as a message to the user, with the option to set.

        Args:
            taken: assumed latency of the readings [s].
        """
        total, more = 1e3 * (taken + self.seconds), "older" if self.seconds > 0 else "younger"
        if self.contradicts:
            return (
                f"By the motion of the sensor, readings are {1e3 * abs(self.seconds):.1f} ms (sd "
                f"{1e3 * self.sd:.1f} ms) {more} than assumed. Use --latency {total:.1f}ms, "
                "or stamp readings when they are sensed."
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
    """Estimate the latency jointly with a correction of a hypothesis pose, by robust Gauss-Newton.

    Args:
        shifted: readings with the assumed latency, and with latencies changed by ``-step`` and ``step``.
        step: time shift [s].
        measured: function that converts readings into measurements.
        hypothesis: recognized part with its pose.
        part: part of the hypothesis.

    Returns:
        Estimate; None if there are too few readings, or the motion of the sensor does not determine it.
    """
    points, before, after = (measured(one) for one in shifted)
    kept = np.array([name not in hypothesis.outliers for name in points.ids], dtype=bool)
    if int(kept.sum()) < _LEAST:
        return None
    velocity = (after.points - before.points)[kept] / (2 * step)
    found = _fitted(points.points[kept], velocity, points.covs[kept], points.radii[kept], hypothesis.T_world_part, part)
    return found if found is not None and found.sd < _LARGEST_SD else None


def _fitted(
    points: Vectors, velocity: Vectors, covs: Covariances, radii: FloatArray, T: Transforms, part: Part
) -> Latency | None:
    """Fit latency and pose by Gauss-Newton; return None without convergence."""
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
        weights = 1 / np.maximum(1.0, np.abs(r) / 3)  # Huber: near an edge the matched face may be wrong
        J = np.c_[np.einsum("ni,ni->n", normals, moving), -normals, -np.cross(local, normals)] / sds[:, None]
        return J.T @ (weights[:, None] * J) + prior, -J.T @ (weights * r), float(weights @ r**2)

    (t, T), steps = maximize(
        (0.0, T),
        lambda state: equations(state)[:2],
        lambda state, step: (state[0] + float(step[0]), state[1] @ SE3.exp(step[1:])),
        _TRIALS,
        _CONVERGED,
    )
    if steps >= _CONVERGED:
        return None
    P, _, cost = equations((t, T))
    spread = np.sqrt(max(cost / max(len(points) - 7, 1), 1.0))
    return Latency(t, float(spread * np.sqrt(np.linalg.inv(P)[0, 0])))
