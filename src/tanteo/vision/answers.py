"""What is told of a mode: pose and covariance in the world, how well its edges fit, and the verdict."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.answers import Hypothesis, Misfit, Status, hypothesis_at, part_scale, spins, verdict, without_spins
from tanteo.lie import SE3
from tanteo.localization import covariance_with_free, weak_motions
from tanteo.parts import Part
from tanteo.typing import Transforms
from tanteo.vision.camera import Camera
from tanteo.vision.fit import Met
from tanteo.vision.posterior import ImageMode, ImagePosterior
from tanteo.vision.settle import Settled

_MISFIT = 1e-6
"""Below this probability a fit is said to be bad."""


def hypothesis(
    mode: ImageMode, T_world_camera: Transforms, camera: Camera, settled: Settled, *, lying: bool = False
) -> Hypothesis:
    """The answer that a mode is: pose and covariance in the world, what stays free, how well its edges fit.

    Args:
        mode: at the pose that its edges agree on.
        T_world_camera: where the camera stands.
        camera: that took the image.
        settled: what the edges say there.
        lying: whether the table has a say in that: three equations more.
    """
    part = mode.model.part
    A = without_spins(part, settled.information)
    dof = max(round(settled.equations) - (3 if lying else 6), 1)
    weak = weak_motions(A, part_scale(part), fixed=spins(part))
    T = T_world_camera @ mode.T_camera_part
    covariance = covariance_with_free(A, weak, part_scale(part)) * max(1.0, settled.chi2 / dof)
    if camera.covariance is not None:
        Ad = SE3.adjoint_inverse(mode.T_camera_part)
        covariance = covariance + Ad @ camera.covariance @ Ad.T
    return hypothesis_at(
        part,
        T,
        covariance,
        free=weak,
        probability=mode.probability,
        misfit=Misfit(0.0, settled.chi2, dof),
        rms=_rms(settled.met, camera, mode.T_camera_part, part),
    )


def _rms(met: Met, camera: Camera, T_camera_part: Transforms, part: Part) -> float:
    """Root mean square of the offsets, as a length at the part's distance [m]."""
    if not met.hits.any():
        return 0.0
    distance = float(SE3.apply(T_camera_part, part.centroid)[2])
    return float(np.sqrt(np.mean(met.offsets[met.hits] ** 2))) * distance / float(camera.focal.mean())


def judged(hypotheses: Sequence[Hypothesis], posterior: ImagePosterior) -> tuple[Status, str]:
    """Status and sentence. Edges of real parts are not those of models: a poor fit widens, and is said."""
    status, message = verdict(tuple(hypotheses), posterior.unknown, 0.0)
    if status == "unknown":
        closest = f"; the closest is {hypotheses[0].part} (P = {hypotheses[0].probability:.2f})" if hypotheses else ""
        message = f"None of the parts is the best explanation (P = {posterior.unknown:.2f}){closest}: "
        message += "check camera file, marks, light and focus, or add the part's file."
    elif hypotheses[0].p_value < _MISFIT:
        message += f" Its edges fit badly (p = {hypotheses[0].p_value:.1g}): check the camera's file, marks and CAD."
    return status, message
