"""Which of the candidates to take: by what it tells, alone or with others, or by one of the rules that others use."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.planning.baselines import LargestFace, Nearest, Random, Scripted321
from tanteo.planning.context import Choice, DecisionContext, Policy
from tanteo.planning.feature_candidates import Feature, features, joint_information
from tanteo.planning.utility import UTILITIES, Utility, outlook
from tanteo.words.findings import MostInformation


def most_information(context: DecisionContext) -> float:
    """What the best candidate is expected to tell [nats], whichever one a policy takes: by this a session ends."""
    return float(outlook(context).told.max())


@dataclass(frozen=True, slots=True)
class Greedy:
    """The reading of the greatest utility; or of the most for its time, travelling included.

    Attributes:
        utility: its name in the registry.
        per_second: divide by the time that it takes.
        name: of the policy.

    Raises:
        InputError: if no utility has that name.
    """

    utility: str = "information"
    per_second: bool = False
    name: str = "information"

    def __post_init__(self) -> None:
        if self.utility not in UTILITIES:
            known = ", ".join(UTILITIES)
            raise InputError(f"utility: expected one of {known}, got {self.utility!r}. Register it, or name one.")

    def choose(self, context: DecisionContext) -> Choice:
        """The candidate with the greatest utility, or utility a second."""
        ahead = outlook(context)
        worth = UTILITIES[self.utility](ahead)
        seconds = context.seconds() if self.per_second else None
        k = int(np.argmax(worth if seconds is None else worth / seconds))
        gain = float(ahead.told[k])
        return Choice(k, gain, MostInformation(gain), None if seconds is None else float(seconds[k]))


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
        ahead = outlook(s)
        found = features(s.state, s.candidates)
        gains = joint_information(found, ahead.samples, ahead.predicted, s)
        seconds = np.array([_seconds(s, feature) for feature in found])
        best = int(np.argmax(gains / seconds))
        chosen = found[best]
        k = int(chosen.rows[np.argmax((ahead.told / s.seconds())[chosen.rows])])
        gain = float(gains[best])
        reason = MostInformation(gain, chosen.name, len(chosen.rows) - 1)
        return Choice(k, gain, reason, float(seconds[best]))


def _seconds(s: DecisionContext, feature: Feature) -> float:
    """Time that the readings of a feature take, one after another."""
    way = np.linalg.norm(np.diff(s.candidates.origins[feature.rows], axis=0), axis=1).sum()
    return float(s.probe.seconds * len(feature.rows) + (s.travel()[feature.rows[0]] + way) / s.probe.speed)


POLICIES: dict[str, Policy] = {
    policy.name: policy
    for policy in (Greedy(), Greedy(per_second=True, name="information-per-second"),
                   Features(), Random(), Nearest(), LargestFace(), Scripted321())
}  # fmt: skip
"""All policies by name."""


def register_utility(name: str, utility: Utility) -> None:
    """Make a utility known under its name, and the policy that takes the reading of which it is greatest.

    Raises:
        InputError: if another policy has that name.
    """
    if name in POLICIES and UTILITIES.get(name) is not utility:
        raise InputError(f"utility: expected a name of its own, got {name!r}, which is taken. Choose another name.")
    UTILITIES[name] = utility
    POLICIES[name] = Greedy(name, name=name)


def policy_named(name: str) -> Policy:
    """The policy of that name.

    Raises:
        InputError: there is none.
    """
    if name not in POLICIES:
        raise InputError(f"policy: expected one of {', '.join(POLICIES)}, got '{name}'. Name one of these.")
    return POLICIES[name]
