"""Sentences of a session."""

from __future__ import annotations

from tanteo.words import findings as f
from tanteo.words.sentences.base import Words, words_of


@words_of.register
def _(one: f.NothingMet) -> Words:
    return "No reading has met a part yet.", ""


@words_of.register
def _(one: f.EmptySpace) -> Words:
    return "Beams met nothing at every place where the part may be.", "Check the prior pose and the parts."


@words_of.register
def _(one: f.NoPartLeft) -> Words:
    return "No part explains the readings.", "Check the readings, the prior pose and the parts."


@words_of.register
def _(one: f.WiderPrior) -> Words:
    return "", "Start a new session with a wider prior pose; it can use the same readings."


@words_of.register
def _(one: f.MovedMeanwhile) -> Words:
    span = f"{one.first} to {one.last}"
    which = f"{one.outliers} of the readings {span}" if one.outliers else f"Readings {span}"
    others = f"all {'after' if one.after else 'before'} {one.fitting}"
    return f"{which} do not fit, {others} do. Did the part or the sensor move?", ""
