"""tanteo: which part is it, where is it, and how sure are we.

The whole path in a few names; the rooms have the rest::

    readings = tanteo.read_readings("touches.csv")
    parts = tanteo.read_parts(["parts/"]).parts
    answer = tanteo.identify(readings, parts, tolerance=0.1e-3)

Everything inside is in metres and radians; poses ``T_world_part`` map points of the part to the world; covariances
are 6 x 6 over ``x y z rx ry rz`` in the part frame. Names are imported when they are first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tanteo.answers import Recognition
    from tanteo.catalogue import read_parts
    from tanteo.errors import TanteoError
    from tanteo.features import Feature
    from tanteo.inference import identify_features
    from tanteo.io import read_readings
    from tanteo.localization import ModelFeature, Pairing, estimate_pose
    from tanteo.parts import Part, read_part
    from tanteo.recognition import identify, locate
    from tanteo.sensors import Readings

__version__ = "0.1.0"

_HOME = {
    "Feature": "features",
    "ModelFeature": "localization",
    "Pairing": "localization",
    "Part": "parts",
    "Readings": "sensors",
    "Recognition": "answers",
    "TanteoError": "errors",
    "estimate_pose": "localization",
    "identify": "recognition",
    "identify_features": "inference",
    "locate": "recognition",
    "read_part": "parts",
    "read_parts": "catalogue",
    "read_readings": "io",
}

__all__ = [
    "Feature",
    "ModelFeature",
    "Pairing",
    "Part",
    "Readings",
    "Recognition",
    "TanteoError",
    "__version__",
    "estimate_pose",
    "identify",
    "identify_features",
    "locate",
    "read_part",
    "read_parts",
    "read_readings",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'tanteo' has no attribute {name!r}; it has {', '.join(__all__)}")
    return getattr(import_module(f"tanteo.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
