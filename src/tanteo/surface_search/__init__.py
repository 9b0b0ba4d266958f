"""Bare readings against the whole surface of any part: no labels, no first guess, every pose that explains them."""

from tanteo.inference.recognition import identify_points as identify_touches
from tanteo.surface_search.free_space import gone_through, log_free_paths
from tanteo.surface_search.shared_start import bend
from tanteo.surface_search.target import Target, prepare_target
from tanteo.surface_search.touches import FreePaths, Touches, as_free_paths, as_touches

__all__ = [
    "FreePaths",
    "Target",
    "Touches",
    "as_free_paths",
    "as_touches",
    "bend",
    "gone_through",
    "identify_touches",
    "log_free_paths",
    "prepare_target",
]
