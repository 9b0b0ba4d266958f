"""Where to sense next, and when to stop: candidates, what they would tell, policies, stopping rules, plans."""

from tanteo.active.candidates import Candidates, propose, within_cone
from tanteo.active.cell import CellCheck, CellError, NextForCell, check_cell
from tanteo.active.clearance import has_room
from tanteo.active.context import Choice, DecisionContext, Policy, SharedOf
from tanteo.active.discrimination import Discrimination, discriminate
from tanteo.active.explanation import Added, Direction, Explanation, explain
from tanteo.active.features import Feature, features
from tanteo.active.measures import (
    AcceptProbability,
    GateDiscrimination,
    accept_matrix,
    accept_probability,
    bhattacharyya,
    gate_discrimination,
    information_bounds,
    kl_divergence,
    mutual_information,
)
from tanteo.active.places import Places, check_feature, places_of
from tanteo.active.plans import Plan, PlannedReading, plan
from tanteo.active.policies import POLICIES, Greedy, most_information, policy_named, register_utility
from tanteo.active.predictions import RangePrediction, predict, predict_range
from tanteo.active.probe import Probe, probe_of
from tanteo.active.samples import Samples, draw
from tanteo.active.shared import SharedAhead
from tanteo.active.start import ORIGIN_SDS, Start, around, at_origin, at_pose, from_hypotheses
from tanteo.active.state import SensingState, begin, update
from tanteo.active.stopping import Stop, chance_within, corner_distances, largest_corner_sd
from tanteo.active.utility import UTILITIES, Outlook, Utility, about_mode, about_pose, expected_information
from tanteo.active.whole import WHOLE, Offers, PartFeatures, WholeFeature, WholeKind, whole_information, whole_seconds

__all__ = [
    "ORIGIN_SDS",
    "POLICIES",
    "UTILITIES",
    "WHOLE",
    "AcceptProbability",
    "Added",
    "Candidates",
    "CellCheck",
    "CellError",
    "Choice",
    "DecisionContext",
    "Direction",
    "Discrimination",
    "Explanation",
    "Feature",
    "GateDiscrimination",
    "Greedy",
    "NextForCell",
    "Offers",
    "Outlook",
    "PartFeatures",
    "Places",
    "Plan",
    "PlannedReading",
    "Policy",
    "Probe",
    "RangePrediction",
    "Samples",
    "SensingState",
    "SharedAhead",
    "SharedOf",
    "Start",
    "Stop",
    "Utility",
    "WholeFeature",
    "WholeKind",
    "about_mode",
    "about_pose",
    "accept_matrix",
    "accept_probability",
    "around",
    "at_origin",
    "at_pose",
    "begin",
    "bhattacharyya",
    "chance_within",
    "check_cell",
    "check_feature",
    "corner_distances",
    "discriminate",
    "draw",
    "expected_information",
    "explain",
    "features",
    "from_hypotheses",
    "gate_discrimination",
    "has_room",
    "information_bounds",
    "kl_divergence",
    "largest_corner_sd",
    "most_information",
    "mutual_information",
    "places_of",
    "plan",
    "policy_named",
    "predict",
    "predict_range",
    "probe_of",
    "propose",
    "register_utility",
    "update",
    "whole_information",
    "whole_seconds",
    "within_cone",
]
