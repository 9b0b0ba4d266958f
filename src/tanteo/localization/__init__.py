"""Pairings of sensed with model features -> the part's pose, its covariance, and what stays unobserved."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.localization.fusion import Fused, fuse_features
    from tanteo.localization.observability import describe_motion, unobserved_directions, weak_motions
    from tanteo.localization.pairing import ModelFeature, Pairing, build_blocks
    from tanteo.localization.pose import PoseEstimate, estimate_pose
    from tanteo.localization.relations import RELATIONS, Relation, relation_between
    from tanteo.localization.scaling import motion_scale, motions_about
    from tanteo.localization.shared_given import SharedGiven
    from tanteo.localization.solve import Block, Solution, assemble, gauss_newton, linearize, pose_information
    from tanteo.localization.start import first_pose
    from tanteo.localization.summary import covariance_with_free

__all__ = [
    "RELATIONS",
    "Block",
    "Fused",
    "ModelFeature",
    "Pairing",
    "PoseEstimate",
    "Relation",
    "SharedGiven",
    "Solution",
    "assemble",
    "build_blocks",
    "covariance_with_free",
    "describe_motion",
    "estimate_pose",
    "first_pose",
    "fuse_features",
    "gauss_newton",
    "linearize",
    "motion_scale",
    "motions_about",
    "pose_information",
    "relation_between",
    "unobserved_directions",
    "weak_motions",
]

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {
        "start": "first_pose",
        "fusion": "Fused fuse_features",
        "observability": "describe_motion unobserved_directions weak_motions",
        "pairing": "ModelFeature Pairing build_blocks",
        "pose": "PoseEstimate estimate_pose",
        "relations": "RELATIONS Relation relation_between",
        "scaling": "motion_scale motions_about",
        "shared_given": "SharedGiven",
        "solve": "Block Solution assemble gauss_newton linearize pose_information",
        "summary": "covariance_with_free",
    },
)
