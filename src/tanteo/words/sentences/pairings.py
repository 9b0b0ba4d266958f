"""Sentences on a pose that is fitted to pairings of features."""

from __future__ import annotations

from tanteo.words import findings as f
from tanteo.words.figures import listed, p_equals
from tanteo.words.sentences.base import Words, words_of


@words_of.register
def _(one: f.PairingsAgree) -> Words:
    return "All six directions are observed and the pairings agree.", ""


@words_of.register
def _(one: f.PairingsFree) -> Words:
    return f"The pairings leave {listed(list(one.motions)) or 'a motion'} free.", "Sense a feature that resists it."


@words_of.register
def _(one: f.PairingsContradict) -> Words:
    return (
        f"The pairings contradict each other ({p_equals(one.p_value)})."
    ), "Check the pairing with the largest distance."
