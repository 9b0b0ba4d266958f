"""Where the sensed side meets the model side: interpretation tree, evidence, belief, recognition."""

from typing import TYPE_CHECKING

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.matching.belief import Belief, Mode, believe
    from tanteo.matching.model import PartModel, prepare
    from tanteo.matching.prior import PosePrior, Table
    from tanteo.matching.priors import Priors
    from tanteo.matching.recognition import identify_features
    from tanteo.matching.results import Hypothesis, Recognition

__all__ = [
    "Belief",
    "Hypothesis",
    "Mode",
    "PartModel",
    "PosePrior",
    "Priors",
    "Recognition",
    "Table",
    "believe",
    "identify_features",
    "prepare",
]

__getattr__, __dir__ = lazy(
    __name__,
    {
        "belief": "Belief Mode believe",
        "priors": "Priors",
        "model": "PartModel prepare",
        "prior": "PosePrior Table",
        "recognition": "identify_features",
        "results": "Hypothesis Recognition",
    },
)
