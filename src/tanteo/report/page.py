"""The page: what it says first, the picture beside what else may be, then the sections. All in one file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

from tanteo.report.html import Html, data, element, join
from tanteo.report.section import Section, render

_POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"
"""Browsers refuse any request that the page might make: what is in the file is all there is."""


@dataclass(frozen=True, slots=True)
class Front:
    """What is seen first.

    Attributes:
        title: One sentence.
        chip: Status: a sign and a word.
        status: Its class (``page.css``).
        message: What it means, and what to do.
        picture: In 3-D; see :func:`tanteo.report.picture.picture`.
        side: Beside the picture.
    """

    title: str
    chip: str
    status: str
    message: str
    picture: Html
    side: Html


def make_page(front: Front, scene: dict[str, Any], sections: Sequence[Section]) -> str:
    """The whole file.

    Args:
        front: What stands above.
        scene: What the program draws.
        sections: What follows below the picture.
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
    body = [
        element("header", chip, element("h1", front.title), element("p", front.message)),
        element("main", top, *map(render, sections)),
        data(scene, "scene"),
        element("script", Html(f"{_asset('draw.js')}\n{_asset('page.js')}")),
    ]
    document = element("html", element("head", *head), element("body", *body), lang="en")
    return f"<!doctype html>\n{document.text}\n"


def fact_list(facts: Sequence[tuple[str, str]]) -> Html:
    """Names and values, one below the other, to stand in a ``dl``."""
    return join(join([element("dt", name), element("dd", value)]) for name, value in facts)


def _asset(name: str) -> str:
    return resources.files("tanteo.report").joinpath(name).read_text(encoding="utf-8")
