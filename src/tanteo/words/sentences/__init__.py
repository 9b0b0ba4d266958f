"""Sentences of findings: what is found, its value, and what to do."""

from tanteo.words.sentences import calibrations as calibrations  # each registers its sentences
from tanteo.words.sentences import causes as causes
from tanteo.words.sentences import hand as hand
from tanteo.words.sentences import images as images
from tanteo.words.sentences import input_checks as input_checks
from tanteo.words.sentences import live as live
from tanteo.words.sentences import pairings as pairings
from tanteo.words.sentences import plans as plans
from tanteo.words.sentences import reasons as reasons
from tanteo.words.sentences import sessions as sessions
from tanteo.words.sentences import too_little as too_little
from tanteo.words.sentences import verdicts as verdicts
from tanteo.words.sentences.base import details_of, headline_of, message_of, sentence
from tanteo.words.sentences.calibrations import parameter_words
from tanteo.words.sentences.hand import acquisition_message
from tanteo.words.sentences.images import touch_words
from tanteo.words.sentences.input_checks import HANDED, size_advice

__all__ = [
    "HANDED",
    "acquisition_message",
    "details_of",
    "headline_of",
    "message_of",
    "parameter_words",
    "sentence",
    "size_advice",
    "touch_words",
]
