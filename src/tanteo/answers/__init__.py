"""What is asked beforehand and what is answered: priors, the pose's among them, hypotheses, status and message."""

from typing import TYPE_CHECKING

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.answers.pose_prior import PosePrior, Table
    from tanteo.answers.priors import Priors
    from tanteo.answers.results import Answer, Hypothesis

__all__ = [
    "Answer",
    "Hypothesis",
    "PosePrior",
    "Priors",
    "Table",
]

__getattr__, __dir__ = lazy(
    __name__,
    {
        "pose_prior": "PosePrior Table",
        "priors": "Priors",
        "results": "Hypothesis Answer",
    },
)
