"""Policies that choose the next reading: by expected information, by features, or by rules for comparison."""

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
    """Return the largest expected information of a candidate [nats].

    A session ends if it is below the goal's smallest gain.

    Args:
        context: posterior, candidates and goal.
    """
    return float(outlook(context).gain.max())


@dataclass(frozen=True, slots=True)
class Greedy:
    """Policy that chooses the reading with the greatest utility, or the greatest utility per time.

    Attributes:
        utility: name of the utility, see :func:`register_utility`.
        per_second: whether to divide the utility by the duration including travel.
        name: name of the policy.

    Raises:
        InputError: the utility is not registered.
    """

    utility: str = "information"
    per_second: bool = False
    name: str = "information"

    def __post_init__(self) -> None:
        if self.utility not in UTILITIES:
            known = ", ".join(UTILITIES)
            raise InputError(f"utility: expected one of {known}, got {self.utility!r}. Register it, or name one.")

    def choose(self, context: DecisionContext) -> Choice:
        """Return the candidate with the greatest utility, or the greatest utility per second."""
        ahead = outlook(context)
        worth = UTILITIES[self.utility](ahead)
        seconds = context.seconds() if self.per_second else None
        k = int(np.argmax(worth if seconds is None else worth / seconds))
        gain = float(ahead.gain[k])
        return Choice(k, gain, MostInformation(gain), None if seconds is None else float(seconds[k]))


@dataclass(frozen=True, slots=True)
class Features:
    """Policy that chooses the feature with the most information per time, and then its best reading.

    The information is that of all readings that the feature needs. After each reading the policy chooses again, so it
    may change to another feature.

    Attributes:
        name: name of the policy.
    """

    name: str = "features"

    def choose(self, context: DecisionContext) -> Choice:
        """Return the reading with the most information per time of the feature with the most information per time."""
        s = context
        ahead = outlook(s)
        found = features(s.state, s.candidates)
        gains = joint_information(found, ahead.samples, ahead.predicted, s)
        seconds = np.array([_seconds(s, feature) for feature in found])
        best = int(np.argmax(gains / seconds))
        chosen = found[best]
        k = int(chosen.rows[np.argmax((ahead.gain / s.seconds())[chosen.rows])])
        gain = float(gains[best])
        reason = MostInformation(gain, chosen.name, len(chosen.rows) - 1)
        return Choice(k, gain, reason, float(seconds[best]))


def _seconds(s: DecisionContext, feature: Feature) -> float:
    """Return the duration of all readings of a feature [s]."""
    way = np.linalg.norm(np.diff(s.candidates.origins[feature.rows], axis=0), axis=1).sum()
    return float(s.probe.seconds * len(feature.rows) + (s.travel()[feature.rows[0]] + way) / s.probe.speed)


POLICIES: dict[str, Policy] = {
    policy.name: policy
    for policy in (Greedy(), Greedy(per_second=True, name="information-per-second"),
                   Features(), Random(), Nearest(), LargestFace(), Scripted321())
}  # fmt: skip
"""All policies by name."""


def register_utility(name: str, utility: Utility) -> None:
    """Register a utility and the greedy policy for it.

    Args:
        name: name of the utility and of the policy.
        utility: function that returns the utility of each candidate.

    Raises:
        InputError: another policy has that name.
    """
    if name in POLICIES and UTILITIES.get(name) is not utility:
        raise InputError(f"utility: expected a name of its own, got {name!r}, which is taken. Choose another name.")
    UTILITIES[name] = utility
    POLICIES[name] = Greedy(name, name=name)


def policy_named(name: str) -> Policy:
    """Return the policy with a name.

    Raises:
        InputError: no policy has that name.
    """
    if name not in POLICIES:
        raise InputError(f"policy: expected one of {', '.join(POLICIES)}, got '{name}'. Name one of these.")
    return POLICIES[name]
