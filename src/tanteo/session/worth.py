"""Whether it is enough, whether the reading that a policy chose is worth making, and in which words it ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tanteo.active import POLICIES, Candidates, Choice, DecisionContext, SensingState, Stop, most_information
from tanteo.session.again import information_of_repeat
from tanteo.session.answer import contradiction, moved_words
from tanteo.session.values import Done

_AGAIN = "a reading of this beam does not fit, and once more it shows whether the sensor erred"

OUT_OF_REACH = (
    "The probe reaches no place of the part, wherever that may be: give it more room, a larger stand-off, another "
    "approach or a better prior pose."
)
"""What is said where no candidate can be made."""


def enough(stop: Stop, state: SensingState, count: int) -> Done | None:
    """The end: the goal is reached, the readings contradict what they are of, or there are no more; else None.

    Args:
        stop: when to end.
        state: what is known.
        count: readings told.
    """
    why = stop.reached(state)
    if against := contradiction(state, stop, reached=bool(why)):
        return Done(False, against)
    if why:
        return Done(True, f"Enough: {why}.{moved_words(state)}")
    return Done(False, all_made(stop.max_measurements, count)) if count >= stop.max_measurements else None


def worth_making(
    stop: Stop, context: DecisionContext, choice: Choice, repeats: Candidates
) -> tuple[DecisionContext, Choice] | Done:
    """What is chosen and among what, or another reading that confirms what is known; the end where none is worth it.

    Args:
        stop: when to end.
        context: what was decided on.
        choice: of the policy. Where it does not say what it tells, the best of the candidates counts.
        repeats: readings that did not fit, to make once more where that tells more.
    """
    state, best = context.state, choice.gain
    if np.isnan(best) and stop.least_gain > 0:
        best = most_information(context)
    told = information_of_repeat(state) if len(repeats) else 0.0
    if told > 0 and told >= stop.least_gain and told >= best:
        return replace(context, candidates=repeats), Choice(0, told, _AGAIN)
    if not best < stop.least_gain or stop.settles(state, best, stop.max_measurements - context.count):
        return context, choice
    if stop.confirms(state):
        return context, _to_confirm(context)
    return Done(False, f"No reading is worth its cost: the best would tell {best:.3f} nats.")


def all_made(max_measurements: int, count: int) -> str:
    """That there are no more readings to make: those that nobody asked for count too, so it may be more than that."""
    asked = "1 reading was" if max_measurements == 1 else f"{max_measurements} readings were"
    made = "1 was" if count == 1 else f"{count} were"
    return f"{asked} asked for at most, and {made} made."


def _to_confirm(context: DecisionContext) -> Choice:
    """A reading where a part that is only like the likeliest one may differ: on the face that was sensed least."""
    choice = POLICIES["largest-face"].choose(context)
    return replace(choice, why=f"{choice.why}: a part that is only like this one would differ there")
