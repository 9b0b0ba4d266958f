"""Target density of the sampler: prior times likelihood over the poses of one part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.geometry.limits import LARGEST
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.posterior.answers.pose_prior import in_box
from tanteo.posterior.sampling.peaks import Objective
from tanteo.posterior.symmetry import is_gauge_fixed, log_gauge


@dataclass(frozen=True, slots=True, eq=False)
class Density:
    """Prior times likelihood of one part, over shifts and turns.

    Attributes:
        objective: the part and the problem.
        T: the best maximum, relative to which the turn of a part of revolution is fixed ``(4, 4)``.
        log_constant: log of the constant factors of the prior, symmetric poses included.
        log_untouched: log density of the points if none is on the part.
    """

    objective: Objective
    T: Transforms
    log_constant: float
    log_untouched: float

    @classmethod
    def about(cls, objective: Objective, T: Transforms, log_constant: float) -> Density:
        """Return the density of a part, relative to its best maximum."""
        untouched = -np.inf
        if len(objective.problem.points):
            far = np.eye(4)
            far[:3, 3] = T[:3, 3] + LARGEST  # out of reach of all points
            zs = np.zeros((1, objective.problem.states))
            untouched = float(_core.marginals(objective.prepared.shape, objective.core, far[None], zs)[0][0])
        return cls(objective, T, log_constant, untouched)

    def at(self, Ts: Transforms, zs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return log densities at poses ``(N,)``, and the other states there ``(N, D)``."""
        objective, prepared = self.objective, self.objective.prepared
        log, zs = _core.marginals(prepared.shape, objective.core, Ts, np.ascontiguousarray(zs))
        log = self.touched(log)
        if is_gauge_fixed(prepared, named=objective.named):
            log += log_gauge(prepared, Ts, self.T)
        if (pose := objective.problem.priors.pose) is not None:
            log[~in_box(pose, prepared.part, Ts)] = -np.inf
        return log, zs

    def touched(self, log: FloatArray) -> FloatArray:
        """Return log densities of the core with the prior, and without the density with no point on the part.

        The latter is equal at all poses. With a prior pose nothing is subtracted: the part may be at its prior pose
        without a reading on it.
        """
        log = log + np.log(np.maximum(-np.expm1(np.minimum(self.log_untouched - log, 0.0)), 1e-300))
        return np.asarray(log + self.log_constant)
