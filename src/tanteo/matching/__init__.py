"""Where the sensed side meets the model side: interpretation tree, evidence, belief, recognition."""

from typing import TYPE_CHECKING

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.matching.belief import Belief, Mode, believe
    from tanteo.matching.model import PartModel, prepare
    from tanteo.matching.recognition import identify_features

__all__ = [
    "Belief",
    "Mode",
    "PartModel",
    "believe",
    "identify_features",
    "prepare",
]

__getattr__, __dir__ = lazy(
    __name__,
    {
        "belief": "Belief Mode believe",
        "model": "PartModel prepare",
        "recognition": "identify_features",
    },
)
