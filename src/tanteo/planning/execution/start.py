"""Start of a session with a hand: its frontal sensor as a probe, and prior poses from an image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.geometry.typing import Covariances, FloatArray, IntArray, Transforms
from tanteo.hand import Hand
from tanteo.hand.motion import Rules
from tanteo.parts import Part
from tanteo.planning.probe import Probe
from tanteo.planning.start import Start, from_hypotheses
from tanteo.posterior import PoseMixture, PreparedPart
from tanteo.posterior.alternatives import Alternatives, NormalPoses
from tanteo.sensors import error_model
from tanteo.sensors.presets import NoiseLaw, RobotPreset
from tanteo.vision import Sight, Sighting

_CONE = float(np.radians(70.0))
"""Largest angle of a beam from straight down if the workspace has a lower bound [rad]."""

REPEATS = 10
"""Number of readings at rest that are averaged."""

LEAST_STANDOFF = 1.25
"""Smallest stand-off as a multiple of the clearance; below it the steering stops the hand before it arrives."""

_RETREAT = 0.05
"""Length of the straight final approach to a reading [m]."""

_FAR = 0.8
"""Largest stand-off as a fraction of the sensor's range, if possible parts obstruct the intended stand-off."""

_SECONDS = 0.5
"""Duration of one reading without travel [s]."""


def hand_probe(
    hand: Hand, rules: Rules, standoff: float, robot: RobotPreset | None = None, *, repeats: int = REPEATS
) -> Probe:
    """Return the sensor model for planning of a hand, in which its first frontal sensor represents both.

    Args:
        hand: sensors and body of the hand.
        rules: limits of the hand's motions.
        standoff: distance of the sensor from the surface at a reading [m].
        robot: error model of the robot's reported poses; None for exact poses.
        repeats: number of readings at rest that are averaged.

    Raises:
        InputError: The stand-off is too small for the clearance of the rules, or out of the sensor's range.
    """
    if not standoff >= LEAST_STANDOFF * rules.clearance:
        raise InputError(
            f"standoff: expected at least {LEAST_STANDOFF:g} times the clearance of {1e3 * rules.clearance:.3g} mm, "
            f"got {1e3 * standoff:.3g} mm. Increase the stand-off, or reduce the clearance."
        )
    model, k = error_model(hand.rig), hand.frontal[0]
    const, prop, quad = (getattr(model.law, name)[k] / np.sqrt(repeats) for name in ("const", "prop", "quad"))
    law = NoiseLaw.of(const, prop, quad, model.law.exp_d0[k], model.law.exp_k[k])
    mount = np.sqrt(np.diag(model.cov_unit[k]))
    across = np.hypot(mount[:2].max(), mount[3:5].max() * standoff)
    place, turn, repeat = (0.0, 0.0, 0.0) if robot is None else (
        robot.pos_abs_std, robot.rot_abs_std, robot.pos_repeat_std
    )  # fmt: skip
    floored = bool(np.isfinite(rules.workspace.low[2]))
    return Probe(
        name=hand.rig.sensors[k].name,
        law=law,
        beam_half_angle=float(model.beam_half_angle[k]),
        max_range=float(min(model.max_range[k], 1.0)),
        min_range=float(model.min_range[k]),
        max_incidence=min(float(model.max_incidence[k]), np.radians(75.0)),
        shared_sd=float(np.sqrt(model.bias_sd[k] ** 2 + mount[2] ** 2 + (mount[6] * standoff) ** 2)),
        repeat_sd=repeat,
        base_sds=(float(np.hypot(place, across)), turn),
        standoff=standoff,
        farthest=_FAR * float(min(model.max_range[k], 1.0)),
        clearance=float(hand.body.radii.min()) + rules.clearance,
        retreat=_RETREAT,
        workspace=rules.workspace,
        speed=rules.speed,
        seconds=_SECONDS,
        approach=np.array([0.0, 0.0, -1.0]) if floored else None,
        cone=_CONE if floored else np.pi,
    )


HYPOTHESES = 20
"""Number of hypotheses to request from an image; the true one is often not among the first five."""

_LEAST, _HALF = 0.02, 0.5
"""Smallest and largest probability that the image is wrong."""

_FORGOTTEN = 1e-4
"""Smallest probability of an image hypothesis that is used."""


def part_seen(sight: Sight, prior: Start | None = None) -> Sighting | None:
    """Return the object in an image that is nearest to the prior position of the part.

    Without a prior it is the largest object.

    Args:
        sight: evaluation of an image without known furniture (``see_table(..., ignore=)``).
        prior: prior poses of the part; None without any.

    Returns:
        Object with its hypotheses; None if no object was recognized.
    """
    some = [seen for seen in sight.objects if seen.answer.hypotheses]
    if not some or prior is None:
        return some[0] if some else None
    centres = [SE3.apply(T, prior.targets[k].part.centroid) for k, T in zip(prior.part, prior.Ts, strict=True)]
    place = np.average(centres, axis=0, weights=prior.weights)[:2]

    def away(seen: Sighting) -> float:
        mode, best = seen.modes[0], seen.answer.hypotheses[0]
        return float(np.linalg.norm(SE3.apply(best.T_world_part, mode.model.part.centroid)[:2] - place))

    return min(some, key=away)


def seen_start(
    seen: Sighting | None, targets: Sequence[PreparedPart] | Sequence[Part], prior: Start | None = None
) -> Start:
    """Return the start of a session with an object in an image as a factor of the posterior.

    The image may be wrong: with the probability that its answers do not have, at least 2 %, the prior poses apply
    instead (decision 29), or an unknown object if there are no prior poses.

    Args:
        seen: object in the image; None if nothing was recognized.
        targets: all parts that the object may be.
        prior: prior poses of the same targets without the image; None without any.

    Raises:
        InputError: The image shows no known part, and there are no prior poses.
    """
    answers = [] if seen is None else [h for h in seen.answer.hypotheses if h.probability > _FORGOTTEN]
    if not answers:
        if prior is None:
            raise InputError(
                "image: expected a known part on the table, got none. Give a prior pose, or the CAD file of the part."
            )
        return prior
    assert seen is not None
    image = from_hypotheses(answers, targets)
    if prior is None:
        return replace(image, factors=seen.factors, suggested=len(image))
    wrong = float(np.clip(1 - sum(h.probability for h in seen.answer.hypotheses), _LEAST, _HALF))
    return Start(
        image.targets,
        np.concatenate([image.part, prior.part]),
        np.concatenate([image.Ts, prior.Ts]),
        np.concatenate([image.covariances, prior.covariances]),
        np.concatenate([(1 - wrong) * image.weights, wrong * prior.weights]),
        prior.priors,
        (_right_or_wrong(seen, prior, wrong),),
        len(image),
    )


def _right_or_wrong(seen: Sighting, prior: Start, wrong: float) -> Alternatives:
    """Return a factor with two alternatives: the image shows the sensed part, or the prior poses apply.

    The density of the image under the second alternative is chosen so that its posterior probability given the image
    alone is ``wrong``. The unknown object has the same density.
    """
    elsewhere = np.log(wrong) + seen.log_known
    unknown = sum(factor.log_unknown for factor in seen.factors)
    poses = prior_poses(prior.targets, prior.part, prior.Ts, prior.covariances, prior.weights)
    return Alternatives(
        (seen.factors, (poses,)),
        np.array([np.log1p(-wrong), elsewhere]),
        float(np.logaddexp(np.log1p(-wrong) + unknown, elsewhere)),
    )


def prior_poses(
    targets: Sequence[PreparedPart], part: IntArray, Ts: Transforms, covariances: Covariances, weights: FloatArray
) -> NormalPoses:
    """Return prior poses as a factor, whose weights are relative to equally probable parts.

    Args:
        targets: parts.
        part: index of the part of each pose ``(A,)``.
        Ts: poses ``T_world_part`` ``(A, 4, 4)``.
        covariances: covariance of each prior pose, order x y z rx ry rz, part frame ``(A, 6, 6)`` [m, rad].
        weights: probabilities of the prior poses, up to a common factor ``(A,)``.
    """
    shares, equal = weights / weights.sum(), np.log(len(targets))
    mixtures = {}
    for k in np.unique(part[shares > 0]):
        own = np.flatnonzero((part == k) & (shares > 0))
        mixtures[targets[k].part] = PoseMixture(Ts[own], covariances[own], np.log(shares[own]) + equal)
    return NormalPoses(mixtures)
