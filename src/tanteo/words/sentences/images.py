"""Sentences on what an image shows."""

from __future__ import annotations

from tanteo.words import findings as f
from tanteo.words.figures import p_equals, percent
from tanteo.words.sentences.base import Words, words_of


@words_of.register
def _(one: f.NothingSeen) -> Words:
    return "The image shows nothing that can be a part.", "Check light, focus and the camera's file."


@words_of.register
def _(one: f.NoPartOnTable) -> Words:
    return "The image shows no part on the table, and no prior pose is given.", "Give --pose-prior."


@words_of.register
def _(one: f.OutlineCut) -> Words:
    return (
        f"The object leaves the image, so its outline does not select among the {one.count:,} parts."
    ), "Move it into the image, or give fewer parts."


@words_of.register
def _(one: f.SimilarOutlines) -> Words:
    best = f"It may be {one.part}, or" if one.part else "It may be"
    return (
        f"{best} one of {one.count:,} parts with similar outlines that were not searched."
    ), "Take an image from nearer or from steeper above, or sense it (tanteo identify READINGS --image)."


@words_of.register
def _(one: f.UnknownInImage) -> Words:
    closest = f" The closest part is {one.part} ({percent(one.probability)})." if one.part else ""
    return (
        f"An unknown object explains the image best ({percent(one.unknown)}).{closest}"
    ), "Check camera file, marks, light and focus, or add the part's file."


@words_of.register
def _(one: f.EdgesFitBadly) -> Words:
    return f"The edges fit badly ({p_equals(one.p_value)}).", "Check the camera's file, the marks and the CAD file."


def touch_words(one: f.DecidingTouch) -> str:
    """Return the touch as a clause: where to sense, and what either answer predicts there."""
    x, y = 1e3 * one.place[0], 1e3 * one.place[1]
    a, b = (
        f"the table, if {name}" if z <= 0 else f"z {1e3 * z:.1f} mm, if {name}"
        for name, z in zip(one.answers, one.heights, strict=True)
    )
    return f"sense from above at x {x:z.1f} y {y:z.1f} mm: {a}; {b}"


@words_of.register
def _(one: f.DecidingTouch) -> Words:
    a, b = one.answers
    left = f"two poses of {a}" if a == b else f"{a} and {b}"
    touch = touch_words(one)
    return f"The image leaves {left}.", f"{touch[0].upper()}{touch[1:]}."
