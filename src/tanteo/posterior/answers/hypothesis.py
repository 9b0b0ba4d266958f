"""Hypotheses from poses with covariance: unobserved directions, symmetry, and advice on what to sense next."""

from __future__ import annotations

import numpy as np

from tanteo.fitting.localization import SharedGiven, describe_motion
from tanteo.geometry.typing import Covariances, Tangents, Transforms
from tanteo.parts import Part
from tanteo.posterior.answers.misfit import Misfit
from tanteo.posterior.answers.part_motions import corner_sd, part_scale, split_by_symmetry, where_to_sense, world_axis
from tanteo.posterior.answers.results import Hypothesis


def hypothesis_at(
    part: Part,
    T_world_part: Transforms,
    covariance: Covariances,
    *,
    free: Tangents,
    probability: float,
    misfit: Misfit,
    rms: float,
    outliers: tuple[str, ...] = (),
    pairings: tuple[tuple[str, str], ...] = (),
    outlier_distances: tuple[float, ...] = (),
    covariance_relative: Covariances | None = None,
    shared: SharedGiven | None = None,
) -> Hypothesis:
    """Return the hypothesis of a part at a pose.

    Args:
        part: the part.
        T_world_part: pose of the part ``(4, 4)``.
        covariance: covariance of the pose ``(6, 6)``, part frame, right perturbation [m, rad]; along ``free`` that of a
            uniform density.
        free: motions that no measurement constrains, symmetries of the part included, in units of
            :func:`part_scale` ``(k, 6)``.
        probability: posterior probability.
        misfit: squared residuals of all measurements and of the prior of the pose.
        rms: root mean square distance of the measurements from the part [m].
        outliers: ids of the readings that are not on the part.
        pairings: id and model feature of each reading that is on the part.
        outlier_distances: distances of the outliers from the surface [m].
        covariance_relative: covariance of the pose given the shared errors; None if nothing is shared.
        shared: shared errors given the pose, whitened; None if nothing is shared.
    """
    left, observed = split_by_symmetry(part, free, covariance)
    motions = tuple(describe_motion(xi, T_world_part, part_scale(part)) for xi in left)
    return Hypothesis(
        part=part.name,
        file=part.source,
        probability=probability,
        T_world_part=T_world_part,
        covariance=covariance,
        corner_sd=corner_sd(part, observed),
        unobserved=tuple(map(str, motions)),
        free_motions=motions,
        symmetry_order=part.symmetry.order,
        symmetry_poses=T_world_part @ part.symmetry.Ts[1:],
        chi2=misfit.chi2,
        dof=max(misfit.dof, 0),
        p_value=misfit.p_value,
        noise_scale=misfit.noise_scale(),
        rms=rms,
        outliers=outliers,
        pairings=pairings,
        outlier_distances=outlier_distances,
        covariance_relative=covariance_relative,
        symmetry_axis=world_axis(part, T_world_part),
        spherical=part.symmetry.spherical,
        advice=_advice(part, T_world_part, free),
        shared=shared,
    )


def _advice(part: Part, T_world_part: Transforms, free: Tangents) -> str:
    """Return what to sense for the first free direction that no symmetry explains."""
    for xi in free:
        if len(split_by_symmetry(part, xi[None], np.eye(6))[0]):
            return where_to_sense(part, T_world_part, xi)
    return ""
