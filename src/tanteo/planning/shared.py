"""Shared errors of candidate readings: distribution given the pose, and effect on the predicted readings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import Covariances, FloatArray, IntArray, Transforms
from tanteo.planning.state import SensingState
from tanteo.posterior import Mode

_FAR = 3.0
"""Bound on the mean of whitened shared errors, for poses far from the maximum [standard deviations]."""


@dataclass(frozen=True, slots=True, eq=False)
class SharedAhead:
    """Distribution of the shared errors of candidates given the pose: normal, with a mean that is linear in the pose.

    Attributes:
        jacobians: Jacobian of the measured points over the whitened errors ``z``, world frame ``(C, 3, D)``.
        Ts: pose at the maximum of each mode ``(M, 4, 4)``.
        means: mean of the errors at each maximum ``(M, D)``.
        slopes: derivatives of the means over the pose, part frame, right perturbation ``(M, D, 6)``.
        covariances: covariances of the errors given the pose ``(M, D, D)``.
    """

    jacobians: FloatArray
    Ts: Transforms
    means: FloatArray
    slopes: FloatArray
    covariances: Covariances

    @classmethod
    def of(cls, state: SensingState, jacobians: FloatArray, columns: IntArray) -> SharedAhead:
        """Return the distribution of candidates' shared errors under the posterior of a session.

        Args:
            state: posterior of the session.
            jacobians: whitened Jacobians of the candidates ``(C, 3, D)``.
            columns: index of each error among those of the posterior ``(D,)``; -1 for an error without readings so far.
        """
        M, D, known = len(state.weights), jacobians.shape[2], np.flatnonzero(columns >= 0)
        means, slopes, covariances = np.zeros((M, D)), np.zeros((M, D, 6)), np.tile(np.eye(D), (M, 1, 1))
        for k, mode in enumerate(state.modes):
            means[k, known], slopes[k, known], covariances[k][np.ix_(known, known)] = _given_pose(mode, columns[known])
        peaks = np.array([mode.T_peak for mode in state.modes]).reshape(-1, 4, 4) if state.modes else state.poses
        return cls(jacobians, peaks, means, slopes, covariances)

    def moved(
        self, mode: IntArray, Ts: Transforms, derivatives: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the effect of the shared errors on predicted ranges.

        Args:
            mode: index of the mode of each pose ``(S,)``.
            Ts: poses ``(S, 4, 4)``.
            derivatives: derivatives of the ranges over the pose ``(C, S, 6)``.

        Returns:
            Mean deviation of each range ``(C, S)`` [m], total derivative of each range over the pose ``(C, S, 6)``, and
            variance of each range from the errors given the pose ``(C, S)`` [m^2].
        """
        by = self._by(Ts, derivatives)
        xi = SE3.log(SE3.inverse(self.Ts[mode]) @ Ts)
        at = np.clip(self.means[mode] + np.einsum("sdi,si->sd", self.slopes[mode], xi), -_FAR, _FAR)
        off, moves = np.einsum("csd,sd->cs", by, at), derivatives + np.einsum("csd,sdi->csi", by, self.slopes[mode])
        return off, moves, np.einsum("csd,sde,cse->cs", by, self.covariances[mode], by)

    def together(
        self, mode: int, T: Transforms, derivatives: FloatArray, own: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the joint linear model of all candidates at one mode.

        Args:
            mode: index of the mode.
            T: pose of the mode ``(4, 4)``.
            derivatives: derivatives of the ranges over the pose at fixed errors ``(C, 6)``.
            own: variances of the independent errors ``(C,)`` [m^2].

        Returns:
            Total derivatives of the ranges over the pose ``(C, 6)``, and covariance of the ranges given the pose
            ``(C, C)`` [m^2].
        """
        by = self._by(T[None], derivatives[:, None])[:, 0]
        return derivatives + by @ self.slopes[mode], np.diag(own) + by @ self.covariances[mode] @ by.T

    def _by(self, Ts: Transforms, derivatives: FloatArray) -> FloatArray:
        """Return derivatives of the ranges over the errors at a fixed pose ``(C, S, D)``."""
        normals = np.einsum("sij,csj->csi", Ts[:, :3, :3], derivatives[..., :3])  # over the cosine of the incidence
        return np.asarray(-(normals @ self.jacobians))


def _given_pose(mode: Mode, columns: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the mean of some shared errors at a maximum, its derivative over the pose, and the covariance."""
    known = np.asarray(np.linalg.inv(mode.information[6:, 6:]), dtype=np.float64)
    slopes = -known @ mode.information[6:, :6]
    return mode.z[columns], slopes[columns], known[np.ix_(columns, columns)]
