"""tanteo: which part is it, where is it, and where to sense next.

The whole path in a few names::

    parts = tanteo.read_parts("parts/")
    readings = tanteo.read_readings("contact_points.csv")
    answer = tanteo.identify(readings, parts, tolerance=0.1e-3)
    print(answer.message, answer.pose, answer.covariance)

Everything is in metres and radians. A pose ``T_world_part`` maps points of the part to the world; its covariance is
6 x 6 over ``x y z rx ry rz`` in the part frame. Names are imported on first use. Rooms for those who build on the
mathematics: ``lie``, ``frames``, ``features``, ``constraints``, ``localization``.
"""

from __future__ import annotations

from importlib import import_module as _import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tanteo import features, fitting, geometry
    from tanteo.catalogue import open_catalogue, part_from_mesh, read_parts
    from tanteo.errors import InputError, TanteoError
    from tanteo.factors import PythonFactor
    from tanteo.geometry import UncertainFrame
    from tanteo.io import read_camera, read_image, read_prior, read_readings, read_rig
    from tanteo.parts import Part, read_part
    from tanteo.planning import Action, Done, Probe, Sensing, Session, Stop, around, discriminate, plan, probe_of
    from tanteo.posterior import Answer, Furniture, Hypothesis, PosePrior, Priors
    from tanteo.recognition import identify, locate
    from tanteo.sensors import Readings, calibrate, robot_preset, sensor_preset
    from tanteo.vision import Camera, see

__version__ = "0.1.0"

_ROOMS = ("constraints", "features", "frames", "lie", "localization")
_HOMES = {
    "active": ("Probe", "Stop", "around", "discriminate", "plan", "probe_of"),
    "answers": ("Furniture", "Hypothesis", "PosePrior", "Priors", "Answer"),
    "calibration": ("calibrate",),
    "catalogue": ("open_catalogue", "part_from_mesh", "read_parts"),
    "errors": ("InputError", "TanteoError"),
    "frames": ("UncertainFrame",),
    "io": ("read_camera", "read_image", "read_prior", "read_readings", "read_rig"),
    "measurements": ("PythonFactor",),
    "parts": ("Part", "read_part"),
    "recognition": ("identify", "locate"),
    "sensors": ("Readings", "robot_preset", "sensor_preset"),
    "session": ("Action", "Done", "Sensing", "Session"),
    "vision": ("Camera", "see"),
}
_HOME = {name: room for room, names in _HOMES.items() for name in names}

__all__ = [
    "Action",
    "Answer",
    "Camera",
    "Done",
    "Furniture",
    "Hypothesis",
    "InputError",
    "Part",
    "PosePrior",
    "Priors",
    "Probe",
    "PythonFactor",
    "Readings",
    "Sensing",
    "Session",
    "Stop",
    "TanteoError",
    "UncertainFrame",
    "__version__",
    "around",
    "calibrate",
    "constraints",
    "discriminate",
    "features",
    "frames",
    "identify",
    "lie",
    "localization",
    "locate",
    "open_catalogue",
    "part_from_mesh",
    "plan",
    "probe_of",
    "read_camera",
    "read_image",
    "read_part",
    "read_parts",
    "read_prior",
    "read_readings",
    "read_rig",
    "robot_preset",
    "see",
    "sensor_preset",
]


def __getattr__(name: str) -> object:
    if name in _ROOMS:
        return _import_module(f"tanteo.{name}")
    if name not in _HOME:
        raise AttributeError(f"module 'tanteo' has no attribute {name!r}; it has {', '.join(__all__)}")
    return getattr(_import_module(f"tanteo.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return list(__all__)
