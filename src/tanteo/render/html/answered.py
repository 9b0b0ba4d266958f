"""Top of the report of an answer: verdict, drawing with controls, probabilities and main figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tanteo.posterior import Answer
from tanteo.render.html.charts import bar
from tanteo.render.html.contacts import Sensed
from tanteo.render.html.distinctive import Distinction
from tanteo.render.html.page import Front, Html, element, fact_list, join, switched
from tanteo.render.html.scene import Candidate, distance_enlarged
from tanteo.render.html.shapes import Shapes
from tanteo.render.html.ways import Way
from tanteo.render.html.words import SIGNS, facts, headline, uncertain
from tanteo.words import details_of, percent

_VIEWS = ("Reset", "Top", "Front", "Side")


@dataclass(frozen=True, slots=True)
class Layer:
    """Layer of the drawing that the user can hide.

    Attributes:
        key: key in the script of the page.
        words: name for the user.
        shown: whether the layer is visible at first.
    """

    key: str
    words: str
    shown: bool = True


def picture(
    layers: Sequence[Layer],
    overlays: Sequence[Sequence[Way]],
    legend: Sequence[tuple[str, str]],
    scaled: Sequence[Sequence[tuple[str, str]]] = (),
    *,
    overlays_shown: bool = True,
) -> Html:
    """Return the drawing in 3-D with its controls and legend.

    Args:
        layers: layers that the user can hide.
        overlays: principal errors of the pose, for each hypothesis.
        legend: entries of the legend, as mark and description.
        scaled: further entries of the legend, for each hypothesis.
        overlays_shown: whether the overlays of the first hypothesis are visible at first.
    """
    canvas = element("canvas", id="view", tabindex="0", role="img", aria_label="The part with the readings, in 3-D")
    overlay = Html('<svg id="overlay" aria-hidden="true"></svg><div id="tip" hidden></div>')
    words = "The picture needs JavaScript; everything else on this page does not."
    no_script = element("noscript", element("p", words))
    stage = element("div", canvas, overlay, element("p", id="no3d", hidden=True), no_script, class_="stage")
    return element("div", stage, _controls(layers, overlays, overlays_shown), _legend(legend, scaled), class_="picture")


def _controls(layers: Sequence[Layer], overlays: Sequence[Sequence[Way]], overlays_shown: bool) -> Html:
    views = [element("button", name, type="button", data_view=name.lower()) for name in _VIEWS]
    boxes = [
        element(
            "label",
            element("input", type="checkbox", data_layer=layer.key, checked=True if layer.shown else None),
            f" {layer.words}",
            class_="box",
        )
        for layer in layers
    ]
    choice = (
        switched([_overlays(ways, overlays_shown) for ways in overlays], "span", class_="overlays")
        if any(overlays)
        else Html("")
    )
    return element("div", *views, *boxes, choice, class_="controls")


def _overlays(ways: Sequence[Way], overlays_shown: bool) -> Html:
    """Return the control by which the user selects an overlay."""
    options = [
        element("option", f"off by {way.motion.brief}: {uncertain(way.moves)} at the farthest corner", value=k)
        for k, way in enumerate(ways)
    ]
    none = element("option", "no overlays", value="", selected=None if overlays_shown else True)
    return element("select", *options, none, aria_label="Overlays: how the pose may be off")


def _legend(legend: Sequence[tuple[str, str]], scaled: Sequence[Sequence[tuple[str, str]]]) -> Html:
    bodies = [join(_entry(*entry) for entry in entries) for entries in scaled]
    more = switched(bodies, "span", class_="scaled") if bodies else Html("")
    return element("div", *(_entry(*entry) for entry in legend), more, class_="legend")


def _entry(mark: str, words: str) -> Html:
    return element("span", element("i", class_=f"mark {mark}"), words)


def times(enlarged: int) -> str:
    """Return a magnification as text for a legend; empty if it is 1.

    Args:
        enlarged: magnification of a drawing.
    """
    return "" if enlarged == 1 else f", {enlarged} × enlarged"


_NAMED = 15
"""Number of readings above which their names are hidden at first."""


def answer_front(
    answer: Answer,
    candidates: Sequence[Candidate],
    sensed: Sensed,
    more: Sequence[tuple[str, str]],
    shapes: Shapes,
    distinction: Distinction,
) -> Front:
    """Return the top of the report of an answer.

    Args:
        answer: answer to report.
        candidates: hypotheses of the answer, best first.
        sensed: readings of the answer.
        more: further facts, as name and value.
        shapes: features of labelled readings.
        distinction: what distinguishes the hypotheses.
    """
    lists = [fact_list([*facts(c.hypothesis, c.part, sensed, answer.significance), *more]) for c in candidates] or [
        fact_list(more)
    ]
    return Front(
        headline(answer),
        f"{SIGNS[answer.status]} {answer.status}",
        answer.status,
        details_of(answer.findings),
        _picture(answer, candidates, sensed, shapes, distinction),
        join([_hypotheses(answer), switched(lists, "dl")]),
    )


def _hypotheses(answer: Answer) -> Html:
    """Return the probabilities as bars; each row selects its hypothesis."""
    if answer.status == "insufficient" and not answer.hypotheses:
        return element("p", "With so few readings any part is possible, so no probabilities are given.", class_="note")
    several = len(answer.hypotheses) > 1
    rows = []
    for k, (name, h) in enumerate(zip(_names(answer), answer.hypotheses, strict=True)):
        rows.append(switch_row(k if several else None, name, percent(h.probability), bar(h.probability)))
    rows += [_plain_row(f"{name} in any pose", P) for name, P in answer.several_poses]
    rest = 1 - answer.unknown_probability - sum(h.probability for h in answer.hypotheses)
    if rest > 0.0005:
        rows.append(_plain_row("others, not shown", rest))
    rows.append(_plain_row("unknown object", answer.unknown_probability))
    heading = element("h2", "What it may be")
    note = [element("p", "Choose one to show it everywhere on this page.", class_="note")] if several else []
    return element("div", heading, *note, element("div", *rows, class_="bars"))


def _names(answer: Answer) -> list[str]:
    """Return the name of each hypothesis: its part, and the number of the pose if there are several."""
    names = [h.part for h in answer.hypotheses]
    return [
        f"{name}, pose {names[: k + 1].count(name)}" if names.count(name) > 1 else name for k, name in enumerate(names)
    ]


def switch_row(k: int | None, name: str, value: str, drawn: Html) -> Html:
    """Return a row that selects a hypothesis, or a plain row.

    Args:
        k: index of the hypothesis; None for a plain row.
        name: name of the row.
        value: value as text.
        drawn: drawing at the end of the row, such as a bar.
    """
    box = element("input", type="radio", name="hypothesis", value=k, checked=True if k == 0 else None)
    words, shown = element("span", name, class_="name"), element("span", value, class_="value")
    return element("label", *([] if k is None else [box]), words, shown, drawn)


def _plain_row(words: str, p: float) -> Html:
    name, value = element("span", words, class_="name"), element("span", percent(p), class_="value")
    return element("div", name, value, bar(p, "none"))


def _picture(
    answer: Answer, candidates: Sequence[Candidate], sensed: Sensed, shapes: Shapes, distinction: Distinction
) -> Html:
    layers = [Layer("readings", "readings"), Layer("beams", "beams")]
    if candidates:
        layers.append(Layer("sticks", "distances"))
    if shapes:
        layers.append(Layer("features", "features", shown=not shapes.flat))
    if distinction.touch is not None:
        layers.append(Layer("next", "next touch"))
    layers.append(Layer("names", "names", shown=len(sensed.measured) <= _NAMED))
    wrong = any(not c.contacts.used.all() for c in candidates)
    legend = [("dot", "reading that fits" if candidates else "reading")]
    legend += [("cross", "reading that does not fit")] if wrong else []
    legend += [("beam", "beam or path of the touch")]
    legend += [("free", "beam that hit nothing")] if len(sensed.measured.free) else []
    if shapes:
        legend += [("feature", f"feature of labelled readings, and off by 2 sd{times(shapes.enlarged)}")]
    legend += [("next", "next touch, to its expected place")] if distinction.touch is not None else []
    scaled = [_scaled(c) for c in candidates]
    for k, faces in enumerate(distinction.faces):
        if len(faces):
            scaled[k].append(("differs", f"face where {_names(answer)[0 if k else 1]} has none"))
    return picture(layers, [c.ways for c in candidates], legend, scaled)


def _scaled(candidate: Candidate) -> list[tuple[str, str]]:
    """Return the legend of the magnified drawings, with their magnification."""
    stick = f"distance to the surface{times(distance_enlarged(candidate))}"
    return [("stick", stick), ("overlay", f"overlays: off by 1, 2 and 3 sd{times(candidate.enlarged)}")]
