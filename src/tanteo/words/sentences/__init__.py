"""Sentences of findings: what is found, its value, and what to do."""

from tanteo.words.sentences import (
    calibrations,
    causes,
    hand,
    images,
    input_checks,
    live,
    pairings,
    plans,
    reasons,
    sessions,
    too_little,
    verdicts,
)
from tanteo.words.sentences.base import details_of, headline_of, message_of, sentence
from tanteo.words.sentences.input_checks import HANDED, size_advice

__all__ = [
    "HANDED",
    "calibrations",
    "causes",
    "details_of",
    "hand",
    "headline_of",
    "images",
    "input_checks",
    "live",
    "message_of",
    "pairings",
    "plans",
    "reasons",
    "sentence",
    "sessions",
    "size_advice",
    "too_little",
    "verdicts",
]
