"""Errors that readings share, given the pose of the part: they follow it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import Covariances, FloatArray, Tangents


@dataclass(frozen=True, slots=True, eq=False)
class SharedGiven:
    """Shared errors where a pose is off by ``xi``: ``mean + follows @ xi`` with a covariance about it.

    Attributes:
        mean: expected at the pose itself ``(D,)``.
        follows: how that moves with the pose, part frame, right perturbation ``(D, 6)``.
        covariance: about it, whatever the pose ``(D, D)``.
    """

    mean: FloatArray
    follows: FloatArray
    covariance: Covariances

    @classmethod
    def at(cls, z: FloatArray, information: FloatArray) -> SharedGiven:
        """From the expected ones ``(D,)`` and the information on pose and shared errors ``(6 + D, 6 + D)``."""
        covariance = np.asarray(np.linalg.inv(information[6:, 6:]), dtype=np.float64)
        return cls(z, -covariance @ information[6:, :6], covariance)

    @classmethod
    def none(cls) -> SharedGiven:
        """Nothing is shared."""
        return cls(np.zeros(0), np.zeros((0, 6)), np.zeros((0, 0)))

    def mapped(self, M: FloatArray) -> SharedGiven:
        """Of ``M`` times these errors."""
        return SharedGiven(M @ self.mean, M @ self.follows, M @ self.covariance @ M.T)

    def about(self, xi: Tangents) -> SharedGiven:
        """The same about a pose that is off by so much ``(6,)``."""
        return SharedGiven(self.mean + self.follows @ xi, self.follows, self.covariance)

    def drawn(self, xi: Tangents, normal: FloatArray) -> FloatArray:
        """Draws at poses that are off by so much ``(S, 6)``, from unit normal ones ``(S, D)``: ``(S, D)``."""
        values, vectors = np.linalg.eigh(self.covariance)
        root = vectors * np.sqrt(values.clip(0))
        return np.asarray(self.mean + xi @ self.follows.T + normal @ root.T)
