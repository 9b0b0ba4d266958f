"""Which of the candidates to take: by what it tells, alone or with others, or by one of the rules that others use."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.active.baselines import LargestFace, Nearest, Random, Scripted321
from tanteo.active.context import Choice, DecisionContext, Policy
from tanteo.active.features import Feature, features, joint_information
from tanteo.active.samples import Predictions, Samples, draw, predict
from tanteo.active.utility import about_mode, expected_information
from tanteo.errors import InputError
from tanteo.typing import FloatArray

_SAMPLES = 128
"""Poses on which every candidate is tried."""

_ALONE, _MEANWHILE = 0.01, 0.3
"""Share of all that is told which counts beside what is told of the part: where that alone is asked for, to decide
between equals; and until it is known, where the pose is asked for as well."""


def most_information(context: DecisionContext) -> float:
    """What the best candidate is expected to tell [nats], whichever one a policy takes: by this a session ends."""
    return float(_told(context)[2].max())


def _told(s: DecisionContext) -> tuple[Samples, Predictions, FloatArray]:
    """Poses, what each candidate would read at them, and what it is expected to tell ``(C,)`` [nats]."""
    samples = draw(s.state, _SAMPLES, s.tolerance, s.feature)
    predicted = predict(samples, s.candidates.origins, s.candidates.directions, s.probe)
    return samples, predicted, expected_information(samples, predicted, s.probe)


@dataclass(frozen=True, slots=True)
class Information:
    """The reading that tells most about part and pose; or most for its time, travelling included.

    Where nobody asks for the pose it is the part that counts, and above all until it is known where both are asked for.

    Attributes:
        per_second: divide by the time that it takes.
        name: of the policy.
    """

    per_second: bool = False
    name: str = "information"

    def choose(self, context: DecisionContext) -> Choice:
        """The candidate with the largest expected information, or information a second."""
        s = context
        samples, predicted, gains = _told(s)
        worth = gains
        if s.part_only or s.part_open:
            share = _ALONE if s.part_only else _MEANWHILE
            worth = share * gains + about_mode(samples, predicted, s.probe, samples.part)
        if self.per_second:
            worth = worth / s.seconds()
        k = int(np.argmax(worth))
        return Choice(k, float(gains[k]), f"it is expected to tell {gains[k]:.2f} nats about part and pose")


@dataclass(frozen=True, slots=True)
class Features:
    """The face, edge or corner whose readings together tell most for their time; of these the one that does so.

    It looks as many readings ahead as the feature needs, and moves on as soon as another feature is worth more.

    Attributes:
        name: of the policy.
    """

    name: str = "features"

    def choose(self, context: DecisionContext) -> Choice:
        """A reading of the feature that is worth most."""
        s = context
        samples, predicted, alone = _told(s)
        found = features(s.state, s.candidates)
        gains = joint_information(found, samples, predicted, s)
        worth = gains / np.array([_seconds(s, feature) for feature in found])
        best = int(np.argmax(worth))
        chosen = found[best]
        k = int(chosen.rows[np.argmax((alone / s.seconds())[chosen.rows])])
        why = f"with {len(chosen.rows) - 1} more of {chosen.name} it is expected to tell {gains[best]:.2f} nats"
        return Choice(k, float(gains[best]), why)


def _seconds(s: DecisionContext, feature: Feature) -> float:
    """Time that the readings of a feature take, one after another."""
    way = np.linalg.norm(np.diff(s.candidates.origins[feature.rows], axis=0), axis=1).sum()
    return float(s.probe.seconds * len(feature.rows) + (s.travel()[feature.rows[0]] + way) / s.probe.speed)


POLICIES: dict[str, Policy] = {
    policy.name: policy
    for policy in (Information(), Information(True, "information-per-second"),
                   Features(), Random(), Nearest(), LargestFace(), Scripted321())
}  # fmt: skip
"""All policies by name."""


def policy_named(name: str) -> Policy:
    """The policy of that name.

    Raises:
        InputError: there is none.
    """
    if name not in POLICIES:
        raise InputError(f"policy: expected one of {', '.join(POLICIES)}, got '{name}'. Name one of these.")
    return POLICIES[name]
