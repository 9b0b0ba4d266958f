"""From a pose with its covariance to a hypothesis: what is free, what symmetry excuses, what to sense next."""

from __future__ import annotations

import numpy as np

from tanteo.fitting import SharedGiven, describe_motion
from tanteo.geometry.typing import Covariances, Tangents, Transforms
from tanteo.parts import Part
from tanteo.posterior.answers.misfit import Misfit
from tanteo.posterior.answers.part_motions import corner_sd, excuse, part_scale, where_to_sense, world_axis
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
    """One answer, whatever it was found from.

    Args:
        part: the part.
        T_world_part: its pose ``(4, 4)``.
        covariance: of that ``(6, 6)``, part frame, right perturbation [m, rad]; uniform samples along ``free``.
        free: motions that nothing resists, the part's spins among them, over :func:`part_scale` ``(k, 6)``.
        probability: posterior.
        misfit: of all that was sensed, and of what was known of the pose.
        rms: root mean square distance of what was sensed [m].
        outliers: ids of the readings that do not belong.
        pairings: reading id and model feature of those that do.
        outlier_distances: of the outliers from the surface [m].
        covariance_relative: with shared errors known; None if nothing is shared.
        shared: these errors, whitened, given the pose; None likewise.
    """
    left, observed = excuse(part, free, covariance)
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
        advice=_advice(part, T_world_part, free),
        shared=shared,
    )


def _advice(part: Part, T_world_part: Transforms, free: Tangents) -> str:
    """What to sense for the first direction that is free and no symmetry."""
    for xi in free:
        if len(excuse(part, xi[None], np.eye(6))[0]):
            return where_to_sense(part, T_world_part, xi)
    return ""
