"""The frontal sensor of a hand as the probe of a session."""

from __future__ import annotations

import numpy as np

from tanteo.active import Probe
from tanteo.errors import InputError
from tanteo.hand import Hand
from tanteo.motion import Rules
from tanteo.sensors import NoiseLaw, RobotPreset, error_model

_CONE = float(np.radians(70.0))
"""How far from straight down a hand looks whose workspace has a floor."""

REPEATS = 10
"""Readings at rest that are averaged."""

LEAST_STANDOFF = 1.25
"""Stand-off in clearances: below, the guard of the motions would hold the hand before it arrives."""

_RETREAT = 0.05
"""From how far behind it comes to a reading [m]."""

_FAR = 0.8
"""Share of its range from which a sensor may look: what may stand about keeps the hand away at first."""

_SECONDS = 0.5
"""Of one reading, beside travelling [s]."""


def hand_probe(
    hand: Hand, rules: Rules, standoff: float, robot: RobotPreset | None = None, *, repeats: int = REPEATS
) -> Probe:
    """What a session needs to know of the hand that carries it out.

    Args:
        hand: the hand; its first frontal sensor stands for both.
        rules: what its motions keep to.
        standoff: of the sensor over what it reads [m].
        robot: errors of the robot's poses.
        repeats: readings at rest that are averaged.

    Raises:
        InputError: The stand-off is too near to the clearance of the rules, or out of the sensor's range.
    """
    if not standoff >= LEAST_STANDOFF * rules.clearance:
        raise InputError(
            f"standoff: expected at least {LEAST_STANDOFF:g} times the clearance of {1e3 * rules.clearance:.3g} mm, "
            f"got {1e3 * standoff:.3g} mm. Keep farther away, or lower the clearance."
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
