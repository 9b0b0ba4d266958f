"""Define how robot brands and ROS write poses: units, order of the fields, and angle convention.

Each convention is a row of :data:`BRANDS`. ``verified`` states whether the convention was read in documentation of
the brand or of an integrator. The other conventions must be confirmed on the controller before use.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np

from tanteo.errors import InputError, did_you_mean
from tanteo.io.documents.schema import show

Rule = Literal["euler", "rotation vector", "wxyz", "xyzw"]


@dataclass(frozen=True, slots=True)
class Brand:
    """Pose convention of a robot brand.

    Attributes:
        name: name for look-up, in lower case.
        fields: names of the fields in order, position first.
        metre: metres per unit of position.
        rule: kind of the orientation fields.
        axes: axes of the Euler rotations, in product order: ``"zyx"`` is ``Rz Ry Rx``; empty for other rules.
        order: index of the angle field for each of the axes; used with Euler angles only.
        radian: radians per unit of angle.
        verified: whether the convention was read in documentation.
        source: document from which the convention was taken.
        syntax: format string of a pose in the controller's language, with one place for each field.
    """

    name: str
    fields: tuple[str, ...]
    metre: float
    rule: Rule
    axes: str
    order: tuple[int, int, int]
    radian: float
    verified: bool
    source: str
    syntax: str


_DEG = np.pi / 180

_RC = "docs.baslerweb.com rc_cube, pose_format_"

_RDK = "RoboDK-API, robomath.py, "

_MEMORY = "from memory: confirm"


def _euler(
    name: str, fields: str, axes: str, order: tuple[int, int, int], source: str, syntax: str, verified: bool = True
) -> Brand:
    return Brand(name, tuple(fields.split()), 1e-3, "euler", axes, order, _DEG, verified, source, syntax)


_BACK, _FORTH = (2, 1, 0), (0, 1, 2)

_LIST, _ROUND = "{}, {}, {}, {}, {}, {}", "({}, {}, {}, {}, {}, {})"

_ROWS = (
    Brand("paper", ("px", "py", "pz", "psi", "theta", "phi"), 1.0, "euler", "zyx", _BACK, 1.0, True,
          "Montano and Sagues 1991, appendix 1", _LIST),
    _euler("fanuc", "X Y Z W P R", "zyx", _BACK, _RC + "fanuc",
           "X = {} mm, Y = {} mm, Z = {} mm, W = {} deg, P = {} deg, R = {} deg"),
    _euler("kuka", "X Y Z A B C", "zyx", _FORTH, _RC + "kuka", "{{X {}, Y {}, Z {}, A {}, B {}, C {}}}"),
    _euler("yaskawa", "X Y Z Rx Ry Rz", "zyx", _BACK, _RC + "yaskawa", "{},{},{},{},{},{}"),
    _euler("mitsubishi", "X Y Z A B C", "zyx", _BACK, _RC + "mitsubishi", _ROUND),
    _euler("kawasaki", "X Y Z O A T", "zyz", _FORTH, _RC + "kawasaki", "TRANS" + _ROUND),
    _euler("staubli", "X Y Z Rx Ry Rz", "xyz", _FORTH, _RDK + "Pose_2_Staubli", "{{" + _LIST + "}}"),
    _euler("comau", "X Y Z A E R", "zyz", _FORTH, _RDK + "Pose_2_Comau", "POS({}, {}, {}, {}, {}, {}, '')"),
    _euler("doosan", "X Y Z A B C", "zyz", _FORTH, "visose/Robots, SystemDoosan.EulerZYZ", "posx" + _ROUND),
    _euler("omron", "X Y Z yaw pitch roll", "zyz", _FORTH, "V+ Language User's Guide 17.0, page 168", "TRANS" + _ROUND),
    _euler("techman", "X Y Z Rx Ry Rz", "zyx", _BACK, _RDK + "Pose_2_Techman", "{{" + _LIST + "}}"),
    _euler("ufactory", "X Y Z Roll Pitch Yaw", "zyx", _BACK, "UFACTORY Lite 6 manual, page 95", "[" + _LIST + "]"),
    Brand("abb", ("X", "Y", "Z", "Q1", "Q2", "Q3", "Q4"), 1e-3, "wxyz", "", _FORTH, 1.0, True, _RC + "abb",
          "[[{}, {}, {}], [{}, {}, {}, {}]]"),
    Brand("ur", ("x", "y", "z", "rx", "ry", "rz"), 1.0, "rotation vector", "", _FORTH, 1.0, True,
          _RC + "ur (metres as in URScript and RTDE; PolyScope shows mm)", "p[" + _LIST + "]"),
    Brand("ros", ("x", "y", "z", "qx", "qy", "qz", "qw"), 1.0, "xyzw", "", _FORTH, 1.0, True,
          "geometry_msgs; REP-103", _LIST + ", {}"),
    _euler("denso", "X Y Z RX RY RZ", "zyx", _BACK,
           "the RC8 manual (ID 1939) has the order RZ, RY, RX, not whether axes turn along: confirm", "P" + _ROUND,
           verified=False),
    _euler("epson", "X Y Z U V W", "zyx", _FORTH, _MEMORY, "XY" + _ROUND, verified=False),
    _euler("mecademic", "X Y Z alpha beta gamma", "xyz", _FORTH, _MEMORY, _ROUND, verified=False),
)  # fmt: skip

BRANDS: Mapping[str, Brand] = MappingProxyType({b.name: b for b in _ROWS})
"""All pose conventions by name."""

_ALIASES = {"staeubli": "staubli", "stäubli": "staubli", "motoman": "yaskawa", "universal": "ur"}


def brand(name: str) -> Brand:
    """Return the pose convention of a brand.

    Args:
        name: name of the brand, or an alias; case does not matter.

    Raises:
        InputError: the name is unknown; the message lists the known names and the nearest one.
    """
    name = _ALIASES.get(name.lower(), name.lower())
    if name not in BRANDS:
        suggestion = did_you_mean(name, BRANDS)
        raise InputError(f"brand: expected one of {', '.join(BRANDS)}, got '{show(name)}'.{suggestion}")
    return BRANDS[name]
