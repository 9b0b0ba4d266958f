"""Recognition as the paper of 1991 describes it, for teaching and comparison."""

from typing import TYPE_CHECKING

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.paper.recognition import identify_as_published

__all__ = ["identify_as_published"]

__getattr__, __dir__ = lazy(__name__, {"recognition": "identify_as_published"})
