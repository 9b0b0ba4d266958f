"""One maximum of one part, with what its pose is known to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.lie import SE3
from tanteo.localization import covariance_with_free, pose_information, weak_motions
from tanteo.matching.part_motions import part_scale, spins, without_spins
from tanteo.surface_search.moments import Moments
from tanteo.surface_search.polish import Polished
from tanteo.surface_search.target import Target
from tanteo.typing import Covariances, FloatArray, Tangents, Transforms


@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """One maximum of one part.

    Attributes:
        target: the part.
        found: the maxima of that part.
        k: which of them.
        log_mass: log evidence, the part's own probability and symmetry included.
        moments: of the posterior about it, where it is not normal or was not looked at.
        probability: posterior over all parts, poses and "none of these".
        shift: of the pose that is the answer from the maximum, where a box left only some of what is about it
            ``(6,)``: to the mean of that, of which the moments are then.
    """

    target: Target
    found: Polished
    k: int
    log_mass: float
    moments: Moments | None = None
    probability: float = 0.0
    shift: Tangents | None = None

    @property
    def T_world_part(self) -> Transforms:
        """The pose that is the answer ``(4, 4)``."""
        T = self.found.Ts[self.k]
        return T if self.shift is None else np.asarray(T @ SE3.exp(self.shift))

    @property
    def free(self) -> Tangents:
        """Motions that nothing resists, those of the part's symmetry first, over :func:`part_scale` ``(m, 6)``."""
        part = self.target.part
        return weak_motions(self.information, part_scale(part), fixed=spins(part))

    @property
    def information(self) -> FloatArray:
        """On the pose, at the maximum, none along the symmetry ``(6, 6)``."""
        return without_spins(self.target.part, pose_information(self.found.information[self.k]))

    @property
    def covariance(self) -> Covariances:
        """Of the pose ``(6, 6)``; along free motions that of a uniform draw."""
        return self._with_free(None if self.moments is None else self.moments.covariance, self.information)

    @property
    def covariance_given_shared(self) -> Covariances | None:
        """Of the pose if the shared errors were known; None if there are none."""
        if self.found.z.shape[1] == 0:
            return None
        known = without_spins(self.target.part, self.found.information[self.k][:6, :6])
        return self._with_free(None if self.moments is None else self.moments.covariance_given_shared, known)

    def _with_free(self, covariance: Covariances | None, information: FloatArray) -> Covariances:
        scale = part_scale(self.target.part)
        if covariance is not None:
            to_unit = np.linalg.inv(scale)
            unit = to_unit @ covariance @ to_unit.T
            information = to_unit.T @ np.linalg.pinv(unit, rcond=1e-12, hermitian=True) @ to_unit
        return covariance_with_free(information, self.free, scale)
