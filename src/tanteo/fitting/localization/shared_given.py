"""Shared errors of readings given the pose of the part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import Covariances, FloatArray, Tangents


@dataclass(frozen=True, slots=True, eq=False)
class SharedGiven:
    """Shared errors given a pose that is off by ``xi``: mean ``mean + follows @ xi``, and a covariance.

    Attributes:
        mean: mean at the pose itself ``(D,)``.
        follows: derivatives of the mean by the pose, part frame, right perturbation ``(D, 6)``.
        covariance: covariance given the pose ``(D, D)``.
        marginal: covariance over all poses ``(D, D)``; None if it is not known. Unstated errors do not enter it.
    """

    mean: FloatArray
    follows: FloatArray
    covariance: Covariances
    marginal: Covariances | None = None

    @classmethod
    def at(cls, z: FloatArray, information: FloatArray) -> SharedGiven:
        """Return the shared errors given the pose.

        Args:
            z: mean of the shared errors at the estimated pose ``(D,)``.
            information: information on pose and shared errors ``(6 + D, 6 + D)``.
        """
        covariance = np.asarray(np.linalg.inv(information[6:, 6:]), dtype=np.float64)
        return cls(z, -covariance @ information[6:, :6], covariance)

    @classmethod
    def none(cls) -> SharedGiven:
        """Return no shared errors."""
        return cls(np.zeros(0), np.zeros((0, 6)), np.zeros((0, 0)))

    def mapped(self, M: FloatArray) -> SharedGiven:
        """Return ``M`` times these errors."""
        marginal = None if self.marginal is None else M @ self.marginal @ M.T
        return SharedGiven(M @ self.mean, M @ self.follows, M @ self.covariance @ M.T, marginal)

    def about(self, xi: Tangents) -> SharedGiven:
        """Return the same about a pose that differs by ``xi`` ``(6,)``."""
        return SharedGiven(self.mean + self.follows @ xi, self.follows, self.covariance, self.marginal)

    def for_pose(self, covariance: Covariances) -> SharedGiven:
        """Return the same with the marginal covariance.

        Args:
            covariance: covariance of the pose, part frame, right perturbation ``(6, 6)``.
        """
        marginal = self.covariance + self.follows @ covariance @ self.follows.T
        return SharedGiven(self.mean, self.follows, self.covariance, marginal)

    def drawn(self, xi: Tangents, normal: FloatArray) -> FloatArray:
        """Return samples of the shared errors ``(S, D)`` at motions ``xi`` ``(S, 6)`` from the pose.

        Args:
            xi: motions of the part from the estimated pose ``(S, 6)``.
            normal: standard normal draws ``(S, D)``.
        """
        values, vectors = np.linalg.eigh(self.covariance)
        root = vectors * np.sqrt(values.clip(0))
        return np.asarray(self.mean + xi @ self.follows.T + normal @ root.T)
