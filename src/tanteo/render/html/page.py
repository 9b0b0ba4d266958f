"""The page in one file: what it says first, the picture, then the sections; and HTML out of text.

Whatever is not :class:`Html` is escaped, so nothing that a file says becomes markup.
"""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

from tanteo.render.html.scene import Candidate


@dataclass(frozen=True, slots=True)
class Html:
    """Markup that is finished."""

    text: str


def element(name: str, /, *children: Html | str, **attributes: object) -> Html:
    """One element. A trailing underscore of an attribute's name is dropped, others become hyphens; None leaves it out.

    Args:
        name: Of the element; ``input``, ``br`` and ``img`` have no end.
        children: Content; plain text is escaped.
        attributes: ``True`` writes the name alone.
    """
    words = "".join(_attribute(key, value) for key, value in attributes.items() if value is not None)
    if name in ("input", "br", "img"):
        return Html(f"<{name}{words}>")
    return Html(f"<{name}{words}>{join(children).text}</{name}>")


def join(children: Iterable[Html | str]) -> Html:
    """Markup and text, one after the other."""
    return Html("".join(c.text if isinstance(c, Html) else escape(c) for c in children))


def escape(text: str) -> str:
    """Text as markup shows it; control characters and lone surrogates become visible escapes."""
    shown = "".join(
        c if c.isprintable() or c == "\n" else c.encode("unicode_escape", "surrogatepass").decode() for c in text
    )
    return html.escape(shown)


def table(headers: Sequence[str], rows: Iterable[Sequence[Html | str]], **attributes: object) -> Html:
    """A table that scrolls by itself where it is wider than the page; the first column names its row."""
    head = element("tr", *(element("th", h, scope="col") if h else element("td") for h in headers))
    body = [
        element("tr", element("th", row[0], scope="row"), *(element("td", cell) for cell in row[1:])) for row in rows
    ]
    inner = element("table", element("thead", head), element("tbody", *body), **attributes)
    return element("div", inner, class_="scroll", tabindex="0")


def data(document: Any, name: str) -> Html:
    """Data for the page's program: JSON that no content can end early."""
    text = json.dumps(document, allow_nan=False, separators=(",", ":"))
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Html(f'<script type="application/json" id="{name}">{text}</script>')


def _attribute(key: str, value: object) -> str:
    name = key.rstrip("_").replace("_", "-")
    return f" {name}" if value is True else f' {name}="{escape(str(value))}"'


@dataclass(frozen=True, slots=True)
class Section:
    """One section of a report; whoever has something more to tell adds one of these.

    Attributes:
        key: Its anchor, unique in the page: letters and hyphens.
        title: A few words.
        lead: What is to be seen, in a sentence.
        bodies: One for the whole page, or one a hypothesis, best first: then the page shows that of the chosen one.
    """

    key: str
    title: str
    lead: str
    bodies: tuple[Html, ...]


def per_hypothesis(candidates: Sequence[Candidate], body: Callable[[Candidate], Html]) -> tuple[Html, ...]:
    """A body for each hypothesis."""
    return tuple(body(candidate) for candidate in candidates)


def switched(bodies: Sequence[Html], name: str = "div", **attributes: object) -> Html:
    """Bodies of which the page shows one at a time: the first, until another hypothesis is chosen."""
    if len(bodies) == 1:
        return element(name, bodies[0], **attributes)
    return join(
        element(name, body, data_h=k, hidden=True if k else None, **attributes) for k, body in enumerate(bodies)
    )


def render(section: Section) -> Html:
    """The section as markup; nothing if it has no body."""
    if not section.bodies:
        return Html("")
    heading = element("summary", element("h2", section.title))
    folded = element("details", heading, element("p", section.lead), switched(section.bodies), class_="fold", open=True)
    return element("section", folded, id=section.key)


_POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"
"""Browsers refuse any request that the page might make: what is in the file is all there is."""


@dataclass(frozen=True, slots=True)
class Front:
    """The top of a page.

    Attributes:
        title: the verdict, as a sentence.
        chip: the status with its sign.
        status: class of the status in ``page.css``.
        message: what follows the title, which it does not repeat; may be empty.
        picture: the drawing and its controls.
        side: what stands beside the drawing.
    """

    title: str
    chip: str
    status: str
    message: str
    picture: Html
    side: Html


def make_page(front: Front, scene: dict[str, Any], sections: Sequence[Section]) -> str:
    """The whole file."""
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
    message = [element("p", front.message)] if front.message else []
    body = [
        element("header", chip, element("h1", front.title), *message),
        element("main", top, *map(render, sections)),
        data(scene, "scene"),
        element("script", Html(f"{_asset('draw.js')}\n{_asset('page.js')}")),
    ]
    document = element("html", element("head", *head), element("body", *body), lang="en")
    return f"<!doctype html>\n{document.text}\n"


def photo_section(key: str, title: str, lead: str, png: bytes, said: str) -> Section:
    """A section that shows an image, which the page holds.

    Args:
        key: Its anchor.
        title: A few words.
        lead: What is to be seen.
        png: The image as a PNG file.
        said: For those who do not see it.
    """
    source = f"data:image/png;base64,{base64.b64encode(png).decode('ascii')}"
    return Section(key, title, lead, (element("img", src=source, alt=said, class_="photo"),))


def fact_list(facts: Sequence[tuple[str, str]]) -> Html:
    """Names and values, one below the other, to stand in a ``dl``."""
    return join(join([element("dt", name), element("dd", value)]) for name, value in facts)


def _asset(name: str) -> str:
    return resources.files("tanteo.render.html").joinpath(name).read_text(encoding="utf-8")
