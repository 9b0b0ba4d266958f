"""Robust ICP refinement of poses."""

from __future__ import annotations

import numpy as np

from tanteo import _core
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.posterior.prepared import PreparedPart
from tanteo.posterior.problem import Problem


def refine_poses(problem: Problem, part: PreparedPart, Ts: Transforms, scales: FloatArray) -> Transforms:
    """Refine poses by robust Gauss-Newton steps of the points to the surface, one step for each scale.

    Args:
        problem: problem whose points are matched to the surface; its priors of the pose hold, widened by the scale.
        part: the part.
        Ts: initial poses ``(S, 4, 4)``.
        scales: scale of the robust kernel in each step ``(K,)`` [m].
    """
    rows = np.arange(len(problem.points), dtype=np.int32)
    return _core.refine_poses(part.shape, problem.compiled(part), rows, np.asarray(scales), np.ascontiguousarray(Ts))[0]
