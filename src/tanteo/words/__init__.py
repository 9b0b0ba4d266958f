"""Typed findings of an answer, and the one place that puts them into sentences."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.words.figures import from_surface, p_equals, percent
    from tanteo.words.findings import Finding, Role
    from tanteo.words.motions import Motion
    from tanteo.words.sentences import HANDED, details_of, headline_of, message_of, sentence, size_advice
    from tanteo.words.sentences.images import touch_words

__all__ = [
    "HANDED",
    "Finding",
    "Motion",
    "Role",
    "details_of",
    "from_surface",
    "headline_of",
    "message_of",
    "p_equals",
    "percent",
    "sentence",
    "size_advice",
    "touch_words",
]

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {
        "figures": "from_surface p_equals percent",
        "findings": "Finding Role",
        "motions": "Motion",
        "sentences": "HANDED details_of headline_of message_of sentence size_advice",
        "sentences.images": "touch_words",
    },
)
