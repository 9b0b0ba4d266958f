"""Which part measurements are of, and where it is: one posterior over parts, poses and the unknown object."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.inference.alternatives import Alternatives, NormalPoses
    from tanteo.inference.around import outlier_log_density
    from tanteo.inference.candidates import Candidates
    from tanteo.inference.covariances import mode_covariances
    from tanteo.inference.diagnostics import face_elsewhere
    from tanteo.inference.features import identify_features
    from tanteo.inference.findings import (
        Scale,
        about_directions,
        about_frames,
        about_readings,
        about_size,
        about_spread,
        about_units,
        scale_of,
    )
    from tanteo.inference.fit_at_mode import GoodnessOfFit, face_names, goodness_of_fit, information_by_point
    from tanteo.inference.free_space import gone_through
    from tanteo.inference.limits import what_limits
    from tanteo.inference.modes import Mode
    from tanteo.inference.otherwise import Ask, about_conventions
    from tanteo.inference.part_search import PartSearch
    from tanteo.inference.posterior import Posterior, infer, posterior_of_factors, search_about, weigh
    from tanteo.inference.prepared import PreparedPart, prepare, prepare_all
    from tanteo.inference.prior_check import p_of_prior
    from tanteo.inference.problem import PoseMixture, Problem
    from tanteo.inference.proposals import PROPOSERS, InitialPoses, Proposer, SearchState
    from tanteo.inference.recognition import identify_points
    from tanteo.inference.result import as_hypothesis, worst_reading
    from tanteo.inference.settings import DEFAULTS, Effort, Settings
    from tanteo.inference.settling import settle
    from tanteo.inference.update import on_part, posterior_about, update_posterior

__all__ = [
    "DEFAULTS",
    "PROPOSERS",
    "Alternatives",
    "Ask",
    "Candidates",
    "Effort",
    "GoodnessOfFit",
    "InitialPoses",
    "Mode",
    "NormalPoses",
    "PartSearch",
    "PoseMixture",
    "Posterior",
    "PreparedPart",
    "Problem",
    "Proposer",
    "Scale",
    "SearchState",
    "Settings",
    "about_conventions",
    "about_directions",
    "about_frames",
    "about_readings",
    "about_size",
    "about_spread",
    "about_units",
    "as_hypothesis",
    "face_elsewhere",
    "face_names",
    "gone_through",
    "goodness_of_fit",
    "identify_features",
    "identify_points",
    "infer",
    "information_by_point",
    "mode_covariances",
    "on_part",
    "outlier_log_density",
    "p_of_prior",
    "posterior_about",
    "posterior_of_factors",
    "prepare",
    "prepare_all",
    "scale_of",
    "search_about",
    "settle",
    "update_posterior",
    "weigh",
    "what_limits",
    "worst_reading",
]

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {
        "alternatives": "Alternatives NormalPoses",
        "candidates": "Candidates",
        "covariances": "mode_covariances",
        "diagnostics": "face_elsewhere",
        "features": "identify_features",
        "findings": ("Scale about_directions about_frames about_readings about_size about_spread about_units scale_of"),
        "free_space": "gone_through",
        "otherwise": "Ask about_conventions",
        "modes": "Mode",
        "posterior": "Posterior infer posterior_of_factors search_about weigh",
        "prepared": "PreparedPart prepare prepare_all",
        "part_search": "PartSearch",
        "prior_check": "p_of_prior",
        "around": "outlier_log_density",
        "problem": "PoseMixture Problem",
        "recognition": "identify_points",
        "fit_at_mode": "GoodnessOfFit face_names goodness_of_fit information_by_point",
        "limits": "what_limits",
        "result": "as_hypothesis worst_reading",
        "proposals": "PROPOSERS InitialPoses Proposer SearchState",
        "settings": "DEFAULTS Effort Settings",
        "settling": "settle",
        "update": "on_part posterior_about update_posterior",
    },
)
