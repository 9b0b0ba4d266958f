"""A piece of the page: a title, a sentence that says what it shows, and what it shows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from tanteo.report.html import Html, element, join
from tanteo.report.scene import Candidate


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
    heading = element("h2", section.title)
    return element("section", heading, element("p", section.lead), switched(section.bodies), id=section.key)
