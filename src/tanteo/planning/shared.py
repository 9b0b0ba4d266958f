"""How errors that all readings share move what a candidate would read, and what is known of them beside the pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import Covariances, FloatArray, IntArray, Transforms
from tanteo.planning.state import SensingState
from tanteo.posterior import Mode

_FAR = 3.0
"""Standard deviations up to which a pose far from the maximum says of the shared errors what it says near it."""


@dataclass(frozen=True, slots=True, eq=False)
class SharedAhead:
    """The shared errors of candidates. Given the pose of a mode they are normal, with a mean that moves with the pose.

    Attributes:
        jacobians: true point = point + jacobian z of unit normal errors ``z``, world ``(C, 3, D)``.
        Ts: where each mode has its maximum ``(M, 4, 4)``.
        means: of the errors there ``(M, D)``.
        slopes: how their mean moves with the pose, part frame, right perturbation ``(M, D, 6)``.
        covariances: of them, given the pose ``(M, D, D)``.
    """

    jacobians: FloatArray
    Ts: Transforms
    means: FloatArray
    slopes: FloatArray
    covariances: Covariances

    @classmethod
    def of(cls, state: SensingState, jacobians: FloatArray, columns: IntArray) -> SharedAhead:
        """What a belief knows of them.

        Args:
            state: what is known.
            jacobians: of the candidates, whitened ``(C, 3, D)``.
            columns: which of the belief's shared errors each of theirs is ``(D,)``; -1 for one that is new.
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
        """What they do to ranges.

        Args:
            mode: of each pose ``(S,)``.
            Ts: the poses ``(S, 4, 4)``.
            derivatives: how ranges move with the pose alone ``(C, S, 6)``.

        Returns:
            By how much each is off on average ``(C, S)`` [m], how it moves with the pose and with what the shared
            errors then are ``(C, S, 6)``, and the variance from what the pose leaves open of them ``(C, S)`` [m^2].
        """
        by = self._by(Ts, derivatives)
        xi = SE3.log(SE3.inverse(self.Ts[mode]) @ Ts)
        at = np.clip(self.means[mode] + np.einsum("sdi,si->sd", self.slopes[mode], xi), -_FAR, _FAR)
        off, moves = np.einsum("csd,sd->cs", by, at), derivatives + np.einsum("csd,sdi->csi", by, self.slopes[mode])
        return off, moves, np.einsum("csd,sde,cse->cs", by, self.covariances[mode], by)

    def together(
        self, mode: int, T: Transforms, derivatives: FloatArray, own: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Of all candidates at one pose of a mode: how they move with it ``(C, 6)``, and their covariance given it."""
        by = self._by(T[None], derivatives[:, None])[:, 0]
        return derivatives + by @ self.slopes[mode], np.diag(own) + by @ self.covariances[mode] @ by.T

    def _by(self, Ts: Transforms, derivatives: FloatArray) -> FloatArray:
        """How ranges move with the errors, the part being still ``(C, S, D)``."""
        normals = np.einsum("sij,csj->csi", Ts[:, :3, :3], derivatives[..., :3])  # over their cosine with the beam
        return np.asarray(-(normals @ self.jacobians))


def _given_pose(mode: Mode, columns: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean of some shared errors at a maximum, how it moves with the pose, and their covariance given the pose."""
    known = np.asarray(np.linalg.inv(mode.information[6:, 6:]), dtype=np.float64)
    slopes = -known @ mode.information[6:, :6]
    return mode.z[columns], slopes[columns], known[np.ix_(columns, columns)]
