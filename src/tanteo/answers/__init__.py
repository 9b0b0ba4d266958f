"""What is asked beforehand and what is answered: priors, the pose's among them, hypotheses, status and message."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.answers.furniture import Furniture
    from tanteo.answers.hypothesis import hypothesis_at
    from tanteo.answers.misfit import Misfit
    from tanteo.answers.part_motions import (
        box_corners,
        corner_moves,
        corner_sd,
        motion_of,
        observed_covariance,
        part_scale,
        point_moves,
        spins,
        without_spin,
        without_spins,
    )
    from tanteo.answers.pose_prior import PosePrior, Table, in_box, log_density_within, prior_residuals, prior_rows
    from tanteo.answers.priors import STATED, Priors, sized
    from tanteo.answers.question import Clock, check_question, with_elapsed
    from tanteo.answers.results import Answer, Hypothesis, Status
    from tanteo.answers.seen_outline import OTHERWISE, SeenOutline
    from tanteo.answers.status import CONFIDENCE, doubt, verdict
    from tanteo.answers.whole_object import WholeObject

__all__ = [
    "CONFIDENCE",
    "OTHERWISE",
    "STATED",
    "Answer",
    "Clock",
    "Furniture",
    "Hypothesis",
    "Misfit",
    "PosePrior",
    "Priors",
    "SeenOutline",
    "Status",
    "Table",
    "WholeObject",
    "box_corners",
    "check_question",
    "corner_moves",
    "corner_sd",
    "doubt",
    "hypothesis_at",
    "in_box",
    "log_density_within",
    "motion_of",
    "observed_covariance",
    "part_scale",
    "point_moves",
    "prior_residuals",
    "prior_rows",
    "sized",
    "spins",
    "verdict",
    "with_elapsed",
    "without_spin",
    "without_spins",
]

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {
        "furniture": "Furniture",
        "hypothesis": "hypothesis_at",
        "misfit": "Misfit",
        "seen_outline": "OTHERWISE SeenOutline",
        "status": "CONFIDENCE doubt verdict",
        "part_motions": (
            "box_corners corner_moves corner_sd motion_of observed_covariance part_scale "
            "point_moves spins without_spin without_spins"
        ),
        "question": "Clock check_question with_elapsed",
        "pose_prior": "PosePrior Table in_box log_density_within prior_residuals prior_rows",
        "priors": "STATED Priors sized",
        "whole_object": "WholeObject",
        "results": "Answer Hypothesis Status",
    },
)
