"""Sentences of the live page."""

from __future__ import annotations

import math

from tanteo.words import findings as f
from tanteo.words.figures import millimetres, percent
from tanteo.words.sentences.base import Words, words_of


def _spread(corner_sd: float) -> str:
    return "" if math.isnan(corner_sd) else f", largest corner sd {millimetres(corner_sd, 3)}"


@words_of.register
def _(one: f.NothingSensedYet) -> Words:
    if one.parts < 2:
        return "No reading yet.", ""
    if one.probability is not None:
        return f"Before the first reading, {one.drawn} is most probable ({percent(one.probability)}).", ""
    return f"No reading yet: {one.parts} parts may be here, {one.drawn} is drawn.", ""


@words_of.register
def _(one: f.Leader) -> Words:
    if not one.decided:
        return f"Undecided: {one.part} is most probable ({percent(one.probability)}).", ""
    return f"{one.part} ({percent(one.probability)}){_spread(one.corner_sd)}.", ""


@words_of.register
def _(one: f.PlacesSensed) -> Words:
    total = one.policy + one.user
    if one.user and one.policy:
        return f"Places sensed: {total} ({one.user} by you, {one.policy} by the policy)", ""
    return f"Places sensed: {total}{', all by you' if one.user else ''}", ""


@words_of.register
def _(one: f.StepResult) -> Words:
    head = f"{one.number}. {'You' if one.user else 'Policy'}, {one.target or 'not requested'}:"
    if not one.part:
        return f"{head} no part explains the readings.", ""
    return f"{head} {one.part} {percent(one.probability)}{_spread(one.corner_sd)}.", ""


@words_of.register
def _(one: f.PlannerResult) -> Words:
    if not one.places:
        return "The planner has sensed no place yet.", ""
    verb = "needed only" if one.finished else "has sensed"
    places = "1 place" if one.places == 1 else f"{one.places} places"
    return f"The planner {verb} {places}: {percent(one.probability)} sure{_spread(one.corner_sd)}.", ""


@words_of.register
def _(one: f.ClickFailed) -> Words:
    return {
        "nothing": ("Nothing is there.", "Click on a part or near one."),
        "space": ("The probe has no free space to sense there.", "Click on another place."),
        "reach": ("The hand cannot reach the place from which it would sense there.", "Click on another place."),
    }[one.cause]


@words_of.register
def _(one: f.TruthWithin) -> Words:
    return f"The true surface is within {millimetres(one.distance, 3)} of the estimate everywhere.", ""
