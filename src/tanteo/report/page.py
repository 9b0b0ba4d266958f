"""The page: the answer in words, the picture beside what else it may be, then the sections. All in one file."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import resources
from typing import Any

from tanteo.matching import Recognition
from tanteo.report.charts import bar
from tanteo.report.html import Html, data, element, join
from tanteo.report.scene import Candidate, distance_enlarged, ghost_words
from tanteo.report.section import Section, render, switched
from tanteo.report.sensed import Sensed
from tanteo.report.words import SIGNS, facts, headline, percent

_POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"
"""Browsers refuse any request that the page might make: what is in the file is all there is."""


def make_page(
    answer: Recognition,
    candidates: Sequence[Candidate],
    sensed: Sensed,
    scene: dict[str, Any],
    sections: Sequence[Section],
) -> str:
    """The whole file.

    Args:
        answer: Status, message and probabilities.
        candidates: Its hypotheses.
        sensed: The readings.
        scene: What the program draws.
        sections: What follows below the picture.
    """
    title = headline(answer)
    head = [
        Html('<meta charset="utf-8">'),
        Html(f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'),
        Html('<meta name="viewport" content="width=device-width, initial-scale=1">'),
        Html('<meta name="color-scheme" content="light dark">'),
        element("title", f"tanteo: {title}"),
        element("style", Html(_asset("page.css"))),
    ]
    side = element("div", _hypotheses(answer), _facts(candidates, sensed), class_="side")
    body = [
        _answer(answer, title),
        element("main", element("div", _picture(candidates, sensed), side, class_="top"), *map(render, sections)),
        data(scene, "scene"),
        element("script", Html(f"{_asset('draw.js')}\n{_asset('page.js')}")),
    ]
    document = element("html", element("head", *head), element("body", *body), lang="en")
    return f"<!doctype html>\n{document.text}\n"


def _asset(name: str) -> str:
    return resources.files("tanteo.report").joinpath(name).read_text(encoding="utf-8")


def _answer(answer: Recognition, title: str) -> Html:
    chip = element("span", f"{SIGNS[answer.status]} {answer.status}", class_=f"chip {answer.status}")
    return element("header", chip, element("h1", title), element("p", answer.message))


def _hypotheses(answer: Recognition) -> Html:
    """The probabilities as bars; each hypothesis is also the switch to itself."""
    several = len(answer.hypotheses) > 1
    names = [h.part for h in answer.hypotheses]
    rows = []
    for k, h in enumerate(answer.hypotheses):
        box = element("input", type="radio", name="hypothesis", value=k, checked=True if k == 0 else None)
        again = f", pose {names[: k + 1].count(h.part)}" if names.count(h.part) > 1 else ""
        words = element("span", h.part + again, class_="name")
        shown = element("span", percent(h.probability), class_="value")
        rows.append(element("label", *([box] if several else []), words, shown, bar(h.probability)))
    rest = 1 - answer.unknown_probability - sum(h.probability for h in answer.hypotheses)
    if rest > 0.0005:
        rows.append(_plain_row("others, not shown", rest))
    rows.append(_plain_row("none of these parts", answer.unknown_probability))
    heading = element("h2", "What it may be")
    hint = [element("p", "Choose one to see it everywhere on this page.", class_="note")] if several else []
    return element("div", heading, *hint, element("div", *rows, class_="bars"))


def _plain_row(words: str, p: float) -> Html:
    name, value = element("span", words, class_="name"), element("span", percent(p), class_="value")
    return element("div", name, value, bar(p, "none"))


def _facts(candidates: Sequence[Candidate], sensed: Sensed) -> Html:
    lists = [
        join(join([element("dt", name), element("dd", value)]) for name, value in facts(c.hypothesis, c.part, sensed))
        for c in candidates
    ]
    return switched(lists, "dl") if lists else Html("")


def _picture(candidates: Sequence[Candidate], sensed: Sensed) -> Html:
    canvas = element("canvas", id="view", tabindex="0", role="img", aria_label="The part with the readings, in 3-D")
    overlay = Html('<svg id="overlay" aria-hidden="true"></svg><div id="tip" hidden></div>')
    words = "The picture needs JavaScript; everything else on this page does not."
    no_script = element("noscript", element("p", words))
    stage = element("div", canvas, overlay, element("p", id="no3d", hidden=True), no_script, class_="stage")
    return element("div", stage, _controls(candidates), _legend(candidates, sensed), class_="picture")


def _controls(candidates: Sequence[Candidate]) -> Html:
    names = ("Reset", "Top", "Front", "Side")
    views = [element("button", name, type="button", data_view=name.lower()) for name in names]
    layers = [("readings", "readings"), ("beams", "beams")]
    if candidates:
        layers += [("sticks", "distances")]
    boxes = [
        element("label", element("input", type="checkbox", data_layer=key, checked=True), f" {words}", class_="box")
        for key, words in layers
    ]
    return element("div", *views, *boxes, *([_ghost_choice(candidates)] if candidates else []), class_="controls")


def _ghost_choice(candidates: Sequence[Candidate]) -> Html:
    choices = []
    for candidate in candidates:
        options = [element("option", f"off by {words}", value=key) for key, words in ghost_words(candidate).items()]
        none = element("option", "no ghosts", value="")
        choices.append(element("select", *options, none, aria_label="Ghosts: how the pose may be off"))
    return switched(choices, "span", class_="ghosts")


def _legend(candidates: Sequence[Candidate], sensed: Sensed) -> Html:
    wrong = any(not c.contacts.used.all() for c in candidates)
    entries = [("dot", "reading that fits" if candidates else "reading")]
    entries += [("cross", "reading that does not fit")] if wrong else []
    entries += [("beam", "beam or touch, as it moved")]
    entries += [("free", "beam that met nothing")] if len(sensed.measured.free) else []
    fixed = [element("span", element("i", class_=f"mark {key}"), words) for key, words in entries]
    if not candidates:
        return element("div", *fixed, class_="legend")
    return element("div", *fixed, switched([_scaled(c) for c in candidates], "span", class_="scaled"), class_="legend")


def _scaled(candidate: Candidate) -> Html:
    """What is drawn enlarged, and how much."""
    stick = f"distance to the surface{_times(distance_enlarged(candidate))}"
    ghost = f"ghosts: off by 1, 2 and 3 sd{_times(candidate.enlarged)}"
    return join(element("span", element("i", class_=f"mark {k}"), w) for k, w in (("stick", stick), ("ghost", ghost)))


def _times(enlarged: int) -> str:
    return "" if enlarged == 1 else f", {enlarged} × enlarged"
