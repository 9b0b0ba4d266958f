"""Typed findings of an answer, and the one place that puts them into sentences."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.words.findings import Finding, Role
    from tanteo.words.motions import Motion
    from tanteo.words.sentences import HANDED, message_of, sentence, size_advice

__all__ = ["HANDED", "Finding", "Motion", "Role", "message_of", "sentence", "size_advice"]

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {"findings": "Finding Role", "motions": "Motion", "sentences": "HANDED message_of sentence size_advice"},
)
