"""Layout of a report as one HTML file, and conversion of text to HTML.

Text that is not :class:`Html` is escaped, so that the content of files cannot become markup.
"""

from __future__ import annotations

import base64
import html
import json
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

from tanteo.render.html.scene import Candidate


@dataclass(frozen=True, slots=True)
class Html:
    """Finished markup."""

    text: str


def element(name: str, /, *children: Html | str, **attributes: object) -> Html:
    """Return an HTML element.

    Args:
        name: name of the element; ``input``, ``br`` and ``img`` have no end tag.
        children: content; plain text is escaped.
        attributes: attributes. A trailing underscore of a name is dropped, others become hyphens; None omits the
            attribute, and ``True`` writes only its name.
    """
    words = "".join(_attribute(key, value) for key, value in attributes.items() if value is not None)
    if name in ("input", "br", "img"):
        return Html(f"<{name}{words}>")
    return Html(f"<{name}{words}>{join(children).text}</{name}>")


def join(children: Iterable[Html | str]) -> Html:
    """Return pieces of markup and text joined; text is escaped.

    Args:
        children: markup and text in order.
    """
    return Html("".join(c.text if isinstance(c, Html) else escape(c) for c in children))


def escape(text: str) -> str:
    """Return text escaped for markup; control characters and lone surrogates become visible.

    Args:
        text: any text.
    """
    shown = "".join(
        c if c.isprintable() or c == "\n" else c.encode("unicode_escape", "surrogatepass").decode() for c in text
    )
    return html.escape(shown)


_UNBROKEN = re.compile(r"(--[a-z][a-z-]+|\d[\d.]* (?:%|(?:mm|deg|sd)\b))")
"""Options, and numbers with their units, which a line break would make unreadable."""


def prose(text: str) -> Html:
    """Return sentences as HTML in which options and numbers with their units stay on one line.

    Args:
        text: any text.
    """
    pieces = _UNBROKEN.split(text)
    return join(element("span", one, class_="word") if k % 2 else one for k, one in enumerate(pieces))


def table(headers: Sequence[str], rows: Iterable[Sequence[Html | str]], **attributes: object) -> Html:
    """Return a table as HTML, which scrolls if it is wider than the page.

    Args:
        headers: headers of the columns.
        rows: cells of each row; the first cell is the header of the row.
        attributes: attributes of the table, see :func:`element`.
    """
    head = element("tr", *(element("th", h, scope="col") if h else element("td") for h in headers))
    body = [
        element("tr", element("th", row[0], scope="row"), *(element("td", cell) for cell in row[1:])) for row in rows
    ]
    inner = element("table", element("thead", head), element("tbody", *body), **attributes)
    return element("div", inner, class_="scroll", tabindex="0")


def data(document: Any, name: str) -> Html:
    """Return data for the script of the page as an element with JSON, whose content cannot end the element.

    Args:
        document: plain dictionaries, lists, strings and numbers.
        name: id of the element.
    """
    text = json.dumps(document, allow_nan=False, separators=(",", ":"))
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Html(f'<script type="application/json" id="{name}">{text}</script>')


def _attribute(key: str, value: object) -> str:
    name = key.rstrip("_").replace("_", "-")
    return f" {name}" if value is True else f' {name}="{escape(str(value))}"'


@dataclass(frozen=True, slots=True)
class Section:
    """Section of a report.

    Attributes:
        key: anchor, unique in the page: letters and hyphens.
        title: short title.
        lead: introduction.
        bodies: content: one body, or one for each hypothesis, best first. The page shows the body of the selected
            hypothesis.
    """

    key: str
    title: str
    lead: str
    bodies: tuple[Html, ...]


def per_hypothesis(candidates: Sequence[Candidate], body: Callable[[Candidate], Html]) -> tuple[Html, ...]:
    """Return the body of a section for each hypothesis.

    Args:
        candidates: hypotheses, best first.
        body: function that returns the body for one hypothesis.
    """
    return tuple(body(candidate) for candidate in candidates)


def switched(bodies: Sequence[Html], name: str = "div", **attributes: object) -> Html:
    """Return the bodies of all hypotheses, of which the page shows that of the selected one, at first the best.

    Args:
        bodies: one body for each hypothesis, best first.
        name: name of the element around each body.
        attributes: attributes of that element, see :func:`element`.
    """
    if len(bodies) == 1:
        return element(name, bodies[0], **attributes)
    return join(
        element(name, body, data_h=k, hidden=True if k else None, **attributes) for k, body in enumerate(bodies)
    )


def render(section: Section) -> Html:
    """Return a section as a foldable HTML element; empty if it has no body.

    Args:
        section: section of a report.
    """
    if not section.bodies:
        return Html("")
    heading = element("summary", element("h2", section.title))
    folded = element(
        "details", heading, element("p", prose(section.lead)), switched(section.bodies), class_="fold", open=True
    )
    return element("section", folded, id=section.key)


_POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"
"""Content security policy: the page cannot request anything outside of its file."""


@dataclass(frozen=True, slots=True)
class Front:
    """Top of a page.

    Attributes:
        title: verdict as a sentence.
        chip: status with its sign.
        status: class of the status in ``page.css``.
        message: further sentences that do not repeat the title; may be empty.
        picture: drawing in 3-D with its controls.
        side: content beside the drawing.
    """

    title: str
    chip: str
    status: str
    message: str
    picture: Html
    side: Html


def make_page(front: Front, scene: dict[str, Any], sections: Sequence[Section]) -> str:
    """Return the text of a complete HTML file.

    Args:
        front: top of the page.
        scene: data of the drawing.
        sections: sections below the top, in order.
    """
    head = [
        Html('<meta charset="utf-8">'),
        Html(f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'),
        Html('<meta name="viewport" content="width=device-width, initial-scale=1">'),
        Html('<meta name="color-scheme" content="light dark">'),
        element("title", f"tanteo: {front.title}"),
        element("style", Html(_asset("page.css"))),
    ]
    chip = element("span", front.chip, class_=f"chip {front.status}")
    top = element("div", front.picture, element("div", front.side, class_="side"), class_="top")
    message = [element("p", prose(front.message))] if front.message else []
    body = [
        element("header", chip, element("h1", front.title), *message),
        element("main", top, *map(render, sections)),
        data(scene, "scene"),
        element("script", Html(f"{_asset('draw.js')}\n{_asset('page.js')}")),
    ]
    document = element("html", element("head", *head), element("body", *body), lang="en")
    return f"<!doctype html>\n{document.text}\n"


def photo_section(key: str, title: str, lead: str, png: bytes, alt: str) -> Section:
    """Return a section with an embedded image.

    Args:
        key: anchor.
        title: short title.
        lead: introduction.
        png: image as a PNG file.
        alt: description of the image for screen readers.
    """
    source = f"data:image/png;base64,{base64.b64encode(png).decode('ascii')}"
    return Section(key, title, lead, (element("img", src=source, alt=alt, class_="photo"),))


def fact_list(facts: Sequence[tuple[str, str]]) -> Html:
    """Return names and values as the content of an HTML ``dl`` element.

    Args:
        facts: name and value of each fact.
    """
    return join(join([element("dt", name), element("dd", value)]) for name, value in facts)


def _asset(name: str) -> str:
    return resources.files("tanteo.render.html").joinpath(name).read_text(encoding="utf-8")
