"""What is seen first of an answer: the words, the picture, what else it may be, the few figures that matter."""

from __future__ import annotations

from collections.abc import Sequence

from tanteo.answers import Answer
from tanteo.report.charts import bar
from tanteo.report.html import Html, element, join
from tanteo.report.page import Front, fact_list
from tanteo.report.picture import Layer, picture, times
from tanteo.report.scene import Candidate, distance_enlarged
from tanteo.report.section import switched
from tanteo.report.sensed import Sensed
from tanteo.report.words import SIGNS, facts, headline, percent

_NAMED = 15
"""With more readings their names are not written into the picture, unless they are asked for."""


def answer_front(
    answer: Answer, candidates: Sequence[Candidate], sensed: Sensed, more: Sequence[tuple[str, str]] = ()
) -> Front:
    """The front of an answer.

    Args:
        answer: Status, message and probabilities.
        candidates: Its hypotheses.
        sensed: The readings.
        more: Further facts, of the run.
    """
    lists = [fact_list([*facts(c.hypothesis, c.part, sensed), *more]) for c in candidates] or [fact_list(more)]
    return Front(
        headline(answer),
        f"{SIGNS[answer.status]} {answer.status}",
        answer.status,
        answer.message,
        _picture(candidates, sensed),
        join([_hypotheses(answer), switched(lists, "dl")]),
    )


def _hypotheses(answer: Answer) -> Html:
    """The probabilities as bars; each hypothesis is also the switch to itself."""
    if answer.status == "insufficient" and not answer.hypotheses:
        return element("p", "With so little any part may be there: no probabilities are given.", class_="note")
    several = len(answer.hypotheses) > 1
    names = [h.part for h in answer.hypotheses]
    rows = []
    for k, h in enumerate(answer.hypotheses):
        again = f", pose {names[: k + 1].count(h.part)}" if names.count(h.part) > 1 else ""
        rows.append(switch_row(k if several else None, h.part + again, percent(h.probability), bar(h.probability)))
    rest = 1 - answer.unknown_probability - sum(h.probability for h in answer.hypotheses)
    if rest > 0.0005:
        rows.append(_plain_row("others, not shown", rest))
    rows.append(_plain_row("unknown object parts", answer.unknown_probability))
    heading = element("h2", "What it may be")
    hint = [element("p", "Choose one to see it everywhere on this page.", class_="note")] if several else []
    return element("div", heading, *hint, element("div", *rows, class_="bars"))


def switch_row(k: int | None, name: str, value: str, drawn: Html) -> Html:
    """A row that switches the page to a hypothesis; to none if there is nothing to switch."""
    box = element("input", type="radio", name="hypothesis", value=k, checked=True if k == 0 else None)
    words, shown = element("span", name, class_="name"), element("span", value, class_="value")
    return element("label", *([] if k is None else [box]), words, shown, drawn)


def _plain_row(words: str, p: float) -> Html:
    name, value = element("span", words, class_="name"), element("span", percent(p), class_="value")
    return element("div", name, value, bar(p, "none"))


def _picture(candidates: Sequence[Candidate], sensed: Sensed) -> Html:
    layers = [Layer("readings", "readings"), Layer("beams", "beams")]
    if candidates:
        layers.append(Layer("sticks", "distances"))
    layers.append(Layer("names", "names", shown=len(sensed.measured) <= _NAMED))
    wrong = any(not c.contacts.used.all() for c in candidates)
    legend = [("dot", "reading that fits" if candidates else "reading")]
    legend += [("cross", "reading that does not fit")] if wrong else []
    legend += [("beam", "beam or touch, as it moved")]
    legend += [("free", "beam that met nothing")] if len(sensed.measured.free) else []
    return picture(layers, [c.ways for c in candidates], legend, [_scaled(c) for c in candidates])


def _scaled(candidate: Candidate) -> list[tuple[str, str]]:
    """What is drawn enlarged, and how much."""
    stick = f"distance to the surface{times(distance_enlarged(candidate))}"
    return [("stick", stick), ("overlay", f"overlays: off by 1, 2 and 3 sd{times(candidate.enlarged)}")]
