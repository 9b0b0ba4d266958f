"""What an image shows, as JSON: the result document of the first object, and all objects under ``objects``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from tanteo.answers import Answer
from tanteo.io.result_json import document_json, recognition_document

if TYPE_CHECKING:
    from tanteo.vision import Descriptors, Question, Sight, Sighting

EMPTY = Answer("unknown", "Nothing was seen that could be a part: check light, focus and camera file.", (), 1.0)
"""The answer of an image that shows nothing."""


def sight_document(sight: Sight) -> dict[str, Any]:
    """The document ``tanteo.recognition/1`` of the largest object, with ``objects`` for every one, itself included."""
    first = sight.objects[0].answer if sight.objects else EMPTY
    objects = [_object(seen, sight.frame) for seen in sight.objects]
    return {**recognition_document(first, sight.frame), "objects": objects}


def sight_json(sight: Sight, warnings: Sequence[str] = ()) -> str:
    """The same as one JSON document, indented, ending in a newline, with what a person was warned of."""
    return document_json(sight_document(sight), warnings)


def _object(seen: Sighting, frame: str) -> dict[str, Any]:
    answer = recognition_document(seen.answer, frame)
    kept = {key: answer[key] for key in ("status", "message", "hypotheses", "unknown_probability")}
    region = None
    if seen.region is not None:
        x0, x1, y0, y1 = seen.region.box
        region = {
            "box_px": [x0, y0, x1, y1],
            "leaves_the_image": seen.region.cut,
            "outline": None if seen.outline is None else _outline(seen.outline),
        }
    return {**kept, "region": region, "question": None if seen.question is None else _question(seen.question)}


def _outline(outline: Descriptors) -> dict[str, Any]:
    from tanteo.vision import NAMES

    return {name: {"value": outline[name], "sd": outline.sd(name)} for name in NAMES}


def _question(question: Question) -> dict[str, Any]:
    return {
        "point_m": [float(v) for v in question.point],
        "answers": [
            {"part": name, "height_m": float(height)}
            for name, height in zip(question.answers, question.heights, strict=True)
        ],
        "words": question.words,
    }
