"""The frame of the picture: its buttons, what can be hidden, the choice of overlays, the legend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tanteo.report.html import Html, element, join
from tanteo.report.overlays import Way
from tanteo.report.section import switched
from tanteo.report.words import MM

_VIEWS = ("Reset", "Top", "Front", "Side")


@dataclass(frozen=True, slots=True)
class Layer:
    """Something that can be hidden.

    Attributes:
        key: By which the program knows it.
        words: On the page.
        shown: At first.
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
    haunted: bool = True,
) -> Html:
    """The canvas with everything about it.

    Args:
        layers: What can be hidden.
        overlays: Ways in which the pose may be off, of each hypothesis.
        legend: Marks (``page.css``) and words.
        scaled: More of them, of each hypothesis.
        haunted: Whether overlays are shown at first.
    """
    canvas = element("canvas", id="view", tabindex="0", role="img", aria_label="The part with the readings, in 3-D")
    overlay = Html('<svg id="overlay" aria-hidden="true"></svg><div id="tip" hidden></div>')
    words = "The picture needs JavaScript; everything else on this page does not."
    no_script = element("noscript", element("p", words))
    stage = element("div", canvas, overlay, element("p", id="no3d", hidden=True), no_script, class_="stage")
    return element("div", stage, _controls(layers, overlays, haunted), _legend(legend, scaled), class_="picture")


def _controls(layers: Sequence[Layer], overlays: Sequence[Sequence[Way]], haunted: bool) -> Html:
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
        switched([_overlays(ways, haunted) for ways in overlays], "span", class_="overlays")
        if any(overlays)
        else Html("")
    )
    return element("div", *views, *boxes, choice, class_="controls")


def _overlays(ways: Sequence[Way], haunted: bool) -> Html:
    """Keys and words of the ways, for the choice of overlays."""
    options = [
        element("option", f"off by {way.words}: {MM * way.moves:.2g} mm at the farthest corner", value=k)
        for k, way in enumerate(ways)
    ]
    none = element("option", "no overlays", value="", selected=None if haunted else True)
    return element("select", *options, none, aria_label="Overlays: how the pose may be off")


def _legend(legend: Sequence[tuple[str, str]], scaled: Sequence[Sequence[tuple[str, str]]]) -> Html:
    bodies = [join(_entry(*entry) for entry in entries) for entries in scaled]
    more = switched(bodies, "span", class_="scaled") if bodies else Html("")
    return element("div", *(_entry(*entry) for entry in legend), more, class_="legend")


def _entry(mark: str, words: str) -> Html:
    return element("span", element("i", class_=f"mark {mark}"), words)


def times(enlarged: int) -> str:
    """How many times something is enlarged, in words; nothing where it is not."""
    return "" if enlarged == 1 else f", {enlarged} × enlarged"
