"""HTML out of text: whatever is not :class:`Html` is escaped, so nothing that a file says becomes markup."""

from __future__ import annotations

import html
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Html:
    """Markup that is finished.

    Attributes:
        text: The markup.
    """

    text: str


def element(name: str, /, *children: Html | str, **attributes: object) -> Html:
    """One element. A trailing underscore of an attribute's name is dropped, others become hyphens; None leaves it out.

    Args:
        name: Of the element; ``input`` and ``br`` have no end.
        children: Content; plain text is escaped.
        attributes: ``True`` writes the name alone.
    """
    words = "".join(_attribute(key, value) for key, value in attributes.items() if value is not None)
    if name in ("input", "br"):
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
    head = element("tr", *(element("th", h, scope="col") for h in headers))
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
