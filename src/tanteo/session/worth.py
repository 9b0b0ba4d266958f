"""Whether the reading that a policy chose is worth making, and in which words it ends if none is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tanteo.active import POLICIES, Choice, Situation, Stop
from tanteo.active.policies import most_told
from tanteo.session.values import Done


def worth_making(stop: Stop, situation: Situation, choice: Choice) -> Choice | Done:
    """What is chosen, or another reading that confirms what is known; the end where no reading is worth its cost.

    Args:
        stop: when to end.
        situation: what was decided on.
        choice: of the policy. Where it does not say what it tells, the best of the candidates counts.
    """
    belief, best = situation.belief, choice.gain
    if np.isnan(best) and stop.least_gain > 0:
        best = most_told(situation)
    if not best < stop.least_gain or stop.settles(belief, best, stop.most - situation.count):
        return choice
    if stop.confirms(belief):
        return _to_confirm(situation)
    return Done(False, f"No reading is worth its cost: the best would tell {best:.3f} nats.")


def all_made(most: int, count: int) -> str:
    """That there are no more readings to make: those that nobody asked for count too, so it may be more than that."""
    asked = "1 reading was" if most == 1 else f"{most} readings were"
    made = "1 was" if count == 1 else f"{count} were"
    return f"{asked} asked for at most, and {made} made."


def _to_confirm(situation: Situation) -> Choice:
    """A reading where a part that is only like the likeliest one may differ: on the face that was sensed least."""
    choice = POLICIES["largest-face"].choose(situation)
    return replace(choice, why=f"{choice.why}: a part that is only like this one would differ there")
