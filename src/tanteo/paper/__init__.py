"""Recognition as the paper of 1991 describes it, for teaching and comparison."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.paper.labelled import identify_labelled_as_published
    from tanteo.paper.recognition import identify_as_published

__all__ = ["identify_as_published", "identify_labelled_as_published"]

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__, {"labelled": "identify_labelled_as_published", "recognition": "identify_as_published"}
)
