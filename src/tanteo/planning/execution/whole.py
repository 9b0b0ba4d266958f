"""Complete features that the hand can acquire in a session, and the initial guess of each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tanteo.features import Feature, feature_covariance
from tanteo.features.kinds import CIRCLE
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import FloatArray
from tanteo.hand import Hand, Predicted, predicted
from tanteo.hand.acquisition import RADIUS_SHARE, Acquired, RoundGuess, least_radius
from tanteo.hand.motion import Rules
from tanteo.hand.simulator.arm import Reach
from tanteo.planning.candidates import Candidates
from tanteo.planning.execution.approach import feasible
from tanteo.planning.execution.possible import FreeSpace, PossiblePoses
from tanteo.planning.session.action import Action
from tanteo.planning.state import SensingState
from tanteo.planning.whole import WHOLE, WholeFeature
from tanteo.sensors import Readings, concatenate, reading_kind

STANDOFF = 5 / 3
"""Stand-off of an acquisition, as a multiple of the clearance."""

_MODES, _LEAST = 3, 0.05
"""Largest number of modes whose features are offered, and smallest probability of such a mode."""

_SD, _TURN_SD = 0.003, float(np.radians(5.0))
"""Smallest standard deviations of an initial guess [m, rad], so that a feature of a similar part is acquired, too."""

_ABOVE = 0.02
"""Height above the stand-off at which an acquisition starts [m]."""


def acquirable(
    hand: Hand, rules: Rules, retreat: float, reach: Reach | None = None
) -> Callable[[SensingState], tuple[WholeFeature, ...]]:
    """Return a function that lists the features that a hand can acquire, for :attr:`tanteo.planning.Session.whole`.

    Args:
        hand: sensors and body of the hand.
        rules: limits of the hand's motions.
        retreat: length of the straight final approach [m].
        reach: joints that carry the hand; None for a hand that can be everywhere.
    """

    def whole(state: SensingState) -> tuple[WholeFeature, ...]:
        space = FreeSpace(hand.body, rules.workspace, PossiblePoses.of(state), rules.clearance, reach=reach)
        modes = np.flatnonzero(state.weights >= _LEAST)[:_MODES]
        offers = [
            _offer(state, int(k), kind, p, rules) for k in modes for kind in WHOLE for p in _found(state, k, kind)
        ]
        far = standoff_of(rules)
        wide = [one for one in offers if one.size >= least_radius(hand, far, convex=one.convex)]
        if not wide:
            return ()
        origins, none = np.array([one.origin for one in wide]), np.zeros(len(wide), dtype=np.int64)
        down = -np.array([one.T_world_feature[:3, 2] for one in wide])
        ok = feasible(hand, space, Candidates(origins, down, none, none, np.full(len(wide), _ABOVE)), retreat)
        return tuple(one for one, can in zip(wide, ok, strict=True) if can)

    return whole


def standoff_of(rules: Rules) -> float:
    """Return the stand-off of the hand's front during an acquisition [m].

    Args:
        rules: limits of the hand's motions.
    """
    return STANDOFF * rules.clearance


def guess_of(state: SensingState, action: Action) -> RoundGuess | None:
    """Return the current guess of the feature that an action acquires; None if no probable mode has this feature.

    Args:
        state: posterior of the session.
        action: action that acquires a feature.
    """
    for k in np.flatnonzero(state.weights >= _LEAST):
        if state.target(int(k)).part.name == action.part:
            return next((_wide(p.guess) for p in _found(state, int(k), action.acquires) if p.name == action.face), None)
    return None


def _found(state: SensingState, k: int, kind: str) -> tuple[Predicted, ...]:
    """Return the features of a kind on a mode's part that the hand can approach from above."""
    return predicted(kind, state.target(k).part, state.poses[k], state.covariances[k], np.array([0.0, 0.0, 1.0]))


def _wide(guess: object) -> RoundGuess:
    assert isinstance(guess, RoundGuess)
    sd, turn_sd = max(guess.sd, _SD), max(guess.turn_sd, _TURN_SD)
    return replace(guess, sd=sd, turn_sd=turn_sd, radius_share=RADIUS_SHARE)


def _offer(state: SensingState, k: int, kind: str, found: Predicted, rules: Rules) -> WholeFeature:
    guess = _wide(found.guess)
    T = SE3.from_parts(SO3.frame_from_axis(guess.axis, 2), guess.point)
    return WholeFeature(
        kind, found.name, k, T, guess.radius, guess.convex, guess.sd, guess.radius_share,
        _start(guess, rules),
    )  # fmt: skip


def _start(guess: RoundGuess, rules: Rules) -> FloatArray:
    """Return the start of an acquisition, above the centre of the rim, world frame ``(3,)`` [m]."""
    return np.asarray(guess.point + (standoff_of(rules) + _ABOVE) * guess.axis)


def readings_of(got: Acquired) -> Readings:
    """Return the readings of an acquisition for a session: points on faces and walls, and centre and radius of rims.

    Points at which a beam crosses a rim are excluded, because such a beam runs along the wall and hits no surface
    there.

    Args:
        got: successful acquisition.
    """
    assert got.feature is not None
    assert got.readings is not None
    raw = got.readings.take(np.flatnonzero([not reading_kind(kind).is_between_faces for kind in got.readings.kinds]))
    rims = [f for f in (got.feature, *got.others) if f.kind is CIRCLE]
    return concatenate([raw, *(_centre(rim) for rim in rims)])


def _centre(rim: Feature) -> Readings:
    """Return the centre and axis of a rim as one reading, with standard deviations across the axis and of its tilt."""
    C, T = feature_covariance(rim), rim.T_world_feature
    across, tilt = (np.sqrt(np.linalg.eigvalsh(C[some, some])[-1:]) for some in (slice(0, 2), slice(3, 5)))
    return Readings.from_columns(
        T[None, :3, 3], normals=T[None, :3, 2], normal_sds=tilt, ids=[rim.label], features=[rim.label],
        kinds=["centre"], sds=across, hole_radii=np.array([rim.radius]),
        material_sides=["boss" if rim.convex else "hole"], source="acquisition",
    )  # fmt: skip
