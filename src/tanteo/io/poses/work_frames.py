"""Write a part's frame as a work coordinate system of a machine or a user frame of a robot.

Sources: LinuxCNC ``G10 L2 P R`` (G-code reference, "Set Coordinate System"; the tests run the lines with ``rs274``);
Haas' pages on programmable offsets (``G10 L2 P1 G90``, no rotation) and on ``G68`` (rotation of the programmed values
about a point of the work frame, three decimals of a degree), which FANUC's controls of machine tools have, too; Siemens
``$P_UIFR[n] = CTRANS(..) : CROT(..)``, whose angles turn about Z, Y', X'' (SINUMERIK, Function Manual K2, "Frames");
Heidenhain's cycles 7 (datum shift) and 10 (rotation, three decimals of a degree) of its user's manuals;
FANUC ``PR[n,k]=`` and ``UFRAME[n]=`` of robots (public TP programs); KUKA ``BASE_DATA`` and ``$BASE``; ABB
``wobjdata``; URScript pose variables. A work offset of a 3-axis machine rotates about z at most. A frame is refused if
the omitted rotation moves a corner of the part by more than :data:`LOST` and is not explained by the uncertainty of the
pose (chi-square test, :data:`LEVEL`); otherwise a warning states the displacement.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Literal

import numpy as np

from tanteo.errors import InputError, did_you_mean
from tanteo.geometry import SE3, SO3, UncertainFrame
from tanteo.geometry.special import chi2_quantile
from tanteo.geometry.typing import Transforms, Vectors
from tanteo.io.poses.pose_text import brand_fields
from tanteo.io.readings.brands import BRANDS

OFFSETS: Mapping[str, int] = MappingProxyType(
    {f"G{n}": n - 53 for n in range(54, 60)} | {f"G59.{n}": 6 + n for n in range(1, 4)}
)
"""Work coordinate systems of LinuxCNC, with their ``P`` number in ``G10 L2``."""

_TILT = np.radians(45.0)
"""Tilt of the part's z axis from the machine's above which a rotation about z is meaningless [rad]."""

_NOTABLE = 1e-6
"""Position error at a corner above which a warning is given [m]."""

_Turn = Literal["none", "R", "rounded"]
"""How a work offset rotates about z: not at all, by its ``R`` word, or by a modal code with three decimals after it."""

LOST = 1e-4
"""Displacement of a corner by the omitted rotation above which a frame is refused [m]; the user accepts it by name."""

LEVEL = 0.95
"""Level of the chi-square test above which an omitted rotation is not explained by its uncertainty."""

_EXACT = 1e-9
"""Numerical: standard deviation of a rotation that counts as exact [rad]."""


@dataclass(frozen=True, slots=True)
class WorkFrame:
    """Frame of a controller that is to be set.

    Attributes:
        controller: ``linuxcnc``, ``grbl``, or another key of :data:`CONTROLLERS`.
        slot: number or name of the frame.
        within: work coordinate system of the readings; empty for machine coordinates.
    """

    controller: str
    slot: str
    within: str = ""


@dataclass(frozen=True, slots=True)
class WrittenFrame:
    """Program lines that set a frame.

    Attributes:
        text: lines, each ending in a line break.
        warnings: errors of the frame's approximation, and conditions for its use.
    """

    text: str
    warnings: tuple[str, ...]


def parse_work_frame(text: str) -> WorkFrame:
    """Return the frame of a text such as ``G54``, ``G55@G54``, ``grbl:G54``, ``fanuc:3``, ``abb:w`` or ``ur:p``.

    Args:
        text: controller and frame; a frame alone is one of LinuxCNC, and ``@`` names that of the readings.

    Raises:
        InputError: the controller is unknown, or it does not have the frame.
    """
    head, _, slot = text.partition(":")
    frame, _, within = head.upper().partition("@")
    if frame in OFFSETS and not slot and (not within or within in OFFSETS):
        if frame == within:
            raise InputError(f"expected another frame than that of the readings, got '{text}'. Set G55, or another.")
        return WorkFrame("linuxcnc", frame, within)
    name = head.lower()
    if name not in CONTROLLERS:
        known = (*OFFSETS, *CONTROLLERS)
        raise InputError(
            f"expected G54 to G59.3 or one of {', '.join(CONTROLLERS)} (as fanuc:1), got '{text}'."
            f"{did_you_mean(head, known)}"
        )
    pattern, example, usual, _ = CONTROLLERS[name]
    slot = slot or usual
    slot = slot.upper() if slot[:1] in "gG" and slot.upper() in OFFSETS else slot
    if not re.fullmatch(pattern, slot):
        raise InputError(f"expected {name}:{example}, got '{text}'. Correct the frame's number or name.")
    return WorkFrame(name, slot)


Note = Callable[[float], str]
"""Comment line of a frame, from the displacement of the farthest corner by an omitted rotation [m]."""


def write_work_frame(
    where: WorkFrame, frame: UncertainFrame, corners: Vectors, note: Note, *, accept_lost: bool = False
) -> WrittenFrame:
    """Return the lines that set a frame of a controller to a pose.

    Args:
        where: frame to set.
        frame: pose of the part in the machine's or the robot's world, with covariance.
        corners: corners of the part's box, part frame ``(n, 3)`` [m].
        note: returns the comment line that names the part and the uncertainty, see :data:`Note`.
        accept_lost: whether to write a frame that omits a rotation of the part, with a warning.

    Raises:
        InputError: the frame omits a rotation that displaces a corner of the part by more than 0.1 mm and that the
            uncertainty of the pose does not explain, or the part's z axis is tilted by more than 45 degrees.
    """
    write = CONTROLLERS[where.controller][3]
    return write(where, frame, corners, note, accept_lost)


def yaw_only(T: Transforms) -> Transforms:
    """Return the nearest pose that rotates about z only: same origin, smallest squared error of the rotation matrix.

    Args:
        T: pose ``(4, 4)``.
    """
    R = T[:3, :3]
    angle = np.arctan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1])
    return SE3.from_parts(SO3.axis_rotation(2, angle), T[:3, 3])


@dataclass(frozen=True, slots=True)
class _AboutZ:
    """Frame that rotates about z only.

    Attributes:
        x, y, z: origin, as text [mm].
        a: rotation about z, as text [deg].
        off: displacement of the part's farthest corner by the omitted rotation [m].
        lost: sentence on the omitted rotation; empty if it is negligible.
    """

    x: str
    y: str
    z: str
    a: str
    off: float
    lost: str


def _about_z(
    where: WorkFrame, frame: UncertainFrame, corners: Vectors, accept_lost: bool, turn: _Turn, name: str
) -> _AboutZ:
    """Return the frame without its tilt, and what this displaces.

    Raises:
        InputError: the omitted rotation displaces a corner by more than 0.1 mm and is not explained by its uncertainty,
            or the part's z axis is tilted.
    """
    T = frame.T
    tilt = float(np.arccos(np.clip(T[2, 2], -1.0, 1.0)))
    if tilt > _TILT:
        raise InputError(
            f"--wcs: expected a part whose z axis points up, because a work offset has no tilt, got a tilt of "
            f"{np.degrees(tilt):.1f} deg. Turn the part's frame in CAD, or write its pose (--as matrix)."
        )
    nearest = yaw_only(T)
    x, y, z, a, _, _ = brand_fields("kuka", UncertainFrame(nearest, frame.C))
    a = {"none": "0", "rounded": f"{float(a):.3f}", "R": a}[turn]
    kept_part = SE3.from_parts(SO3.axis_rotation(2, np.radians(float(a))), T[:3, 3])
    off = float(np.linalg.norm(SE3.apply(T, corners) - SE3.apply(kept_part, corners), axis=-1).max())
    omitted = SO3.log(T[:3, :3] @ kept_part[:3, :3].T)  # world axes
    C = T[:3, :3] @ frame.C[3:, 3:] @ T[:3, :3].T + _EXACT**2 * np.eye(3)
    own = slice(0, 3 if turn == "none" else 2)
    explained = omitted[own] @ np.linalg.solve(C[own, own], omitted[own]) <= chi2_quantile(LEVEL, own.stop)
    leaning = float(np.linalg.norm(omitted[:2]))
    across = omitted[:2] / leaning if leaning > _EXACT else np.array([1.0, 0.0])
    what = f"a tilt of {_degrees(tilt, float(across @ C[:2, :2] @ across))}"
    if turn == "none":
        yaw = np.arctan2(nearest[1, 0], nearest[0, 0])
        what = f"any rotation of the part (it has a turn of {_degrees(yaw, float(C[2, 2]))} and {what})"
    lost = f"{name} cannot represent {what}: the part's farthest corner is {1e3 * off:.3g} mm off."
    if off > LOST and not (accept_lost or explained):
        raise InputError(
            f"--wcs: expected a frame that holds the part to {1e3 * LOST:g} mm, got {where.controller}:{where.slot}. "
            f"{lost} Align the part, write its pose (--as matrix), or state --accept-turn-lost."
        )
    if off > LOST and explained:
        lost += " The readings do not distinguish this rotation from none."
    return _AboutZ(x, y, z, a, off, lost if off > _NOTABLE else "")


def _degrees(angle: float, variance: float) -> str:
    """Return an angle with two digits of its standard deviation, from an angle [rad] and a variance [rad^2]."""
    sd = np.degrees(np.sqrt(variance))
    places = int(np.clip(1 - np.floor(np.log10(sd)), 0, 9))
    return f"{np.degrees(angle):.{places}f} +- {sd:.{places}f} deg"


def _offset(
    where: WorkFrame, frame: UncertainFrame, corners: Vectors, note: Note, accept_lost: bool, turn: _Turn
) -> WrittenFrame:
    """Return a work offset of a machine that reads G-code."""
    slot = where.slot
    at = _about_z(where, frame, corners, accept_lost, turn, slot)
    x, y, z, a = at.x, at.y, at.z, at.a
    of = f"coordinates of {where.within}" if where.within else "machine coordinates (G53), without work offset"
    warnings = [f"positions of the readings are taken as {of}."]
    after = []
    if turn == "rounded" and float(a):
        after = [slot, f"G17 G68 X0. Y0. R{a}"]
        warnings.insert(0, f"G68 turns {slot} until G69 or the end of the program, and is an option of the control.")
    if at.lost:
        warnings.insert(0, at.lost)
    words = f"X{x} Y{y} Z{z}" + (f" R{a}" if turn == "R" else "")
    before: list[str] = []
    if where.within:
        before, words = _after(OFFSETS[where.within], x, y, z, a)
    lines = [
        f"({_gcode_comment(note(at.off))})",
        f"(readings in {where.within or 'machine coordinates'}, millimetres)",
        "G21 G90",
    ]
    lines += [f"(warning: {_gcode_comment(text)})" for text in warnings[:-1]]
    return WrittenFrame("\n".join([*lines, *before, f"G10 L2 P{OFFSETS[slot]} {words}", *after, ""]), tuple(warnings))


def _after(number: int, x: str, y: str, z: str, a: str) -> tuple[list[str], str]:
    """Return the lines before, and the words of, a frame that is relative to a work coordinate system.

    LinuxCNC stores offset and rotation in parameters from 5221 on, 20 per system, in machine units.
    """
    first = 5201 + 20 * number
    turn, (ox, oy, oz) = f"#{first + 9}", (f"#<_unit> * #{first + k}" for k in range(3))
    x_ = "#<_part_x>"
    y_ = "#<_part_y>"
    along = f"X[{ox} + {x_} * COS[{turn}] - {y_} * SIN[{turn}]] Y[{oy} + {x_} * SIN[{turn}] + {y_} * COS[{turn}]]"
    before = ["#<_unit> = [25.4 - 24.4 * [#<_metric_machine> EQ 1]]", f"{x_} = {x}", f"{y_} = {y}"]
    return before, f"{along} Z[{oz} + [{z}]] R[{turn} + [{a}]]"


def _gcode_comment(text: str) -> str:
    """Return a text without characters that end or start a G-code comment."""
    return re.sub(r"[^\x20-\x7e]", "?", text.replace("(", "[").replace(")", "]"))


def _fanuc(where: WorkFrame, frame: UncertainFrame, _: Vectors, note: Note, __: bool) -> WrittenFrame:
    """Return a TP program; ``LPOS`` makes the position register Cartesian before its elements are written."""
    register = 100
    values = brand_fields("fanuc", frame)
    steps = [
        f"!{words[:30]}" for words in re.split(r"[:,] |(?<=mm) ", note(0.0).replace("farthest corner", "corner"))
    ] + [
        "UFRAME_NUM=0",
        f"PR[{register}]=LPOS",
    ]
    steps += [f"PR[{register},{k}]={value}" for k, value in enumerate(values, 1)]
    steps += [f"UFRAME[{where.slot}]=PR[{register}]", f"UFRAME_NUM={where.slot}"]
    body = [f"{n:4d}:  {step} ;" for n, step in enumerate(steps, 1)]
    text = ["/PROG  TANTEO_UF", "/ATTR", 'COMMENT\t\t= "TANTEO";', "/MN", *body, "/POS", "/END", ""]
    return WrittenFrame("\n".join(text), (f"position register {register} is overwritten.",))


def _fanuc_frame(
    where: WorkFrame, frame: UncertainFrame, corners: Vectors, note: Note, accept_lost: bool
) -> WrittenFrame:
    """Return a work offset of a machine tool, or the TP program of a robot."""
    if where.slot in OFFSETS:
        return _offset(where, frame, corners, note, accept_lost, "rounded")
    return _fanuc(where, frame, corners, note, accept_lost)


def _siemens(where: WorkFrame, frame: UncertainFrame, _: Vectors, note: Note, __: bool) -> WrittenFrame:
    """Return a settable frame with all three rotations, in the order Z, Y', X'' of RPY angles."""
    x, y, z, a, b, c = brand_fields("kuka", frame)
    value = f"CTRANS(X,{x},Y,{y},Z,{z}) : CROT(X,{c},Y,{b},Z,{a})"
    lines = [f"; {note(0.0)}", "; readings in machine coordinates, millimetres", "G710 G90",
             f"$P_UIFR[{OFFSETS[where.slot]}] = {value}", where.slot, ""]  # fmt: skip
    return WrittenFrame("\n".join(lines), (
        "positions of the readings are taken as machine coordinates (G53), without work offset.",
        "the angles are RPY angles, which the control uses unless MD10600 is 2.",
    ))  # fmt: skip


def _heidenhain(
    where: WorkFrame, frame: UncertainFrame, corners: Vectors, note: Note, accept_lost: bool
) -> WrittenFrame:
    """Return a datum shift and a rotation in the working plane, relative to the active preset."""
    at = _about_z(where, frame, corners, accept_lost, "rounded", "cycle 10")
    lines = [f"; {note(at.off)}", "; readings relative to the active preset, millimetres", "CYCL DEF 7.0 DATUM SHIFT"]
    shift = zip("XYZ", (at.x, at.y, at.z), strict=True)
    lines += [f"CYCL DEF 7.{k} {axis}{float(value):+.4f}" for k, (axis, value) in enumerate(shift, 1)]
    lines += ["CYCL DEF 10.0 ROTATION", f"CYCL DEF 10.1 ROT{float(at.a):+.3f}"]
    taken = "positions of the readings are taken as relative to the active preset, without a datum shift or rotation."
    warnings = ((at.lost,) if at.lost else ()) + (taken, "cycles 7 and 10 act until they are programmed with 0.")
    return WrittenFrame("\n".join([*lines, ""]), warnings)


def _kuka(where: WorkFrame, frame: UncertainFrame, _: Vectors, note: Note, __: bool) -> WrittenFrame:
    value = BRANDS["kuka"].syntax.format(*brand_fields("kuka", frame)).replace("{X", "{FRAME: X")
    return WrittenFrame(f"; {note(0.0)}\nBASE_DATA[{where.slot}] = {value}\n$BASE = BASE_DATA[{where.slot}]\n", ())


def _abb(where: WorkFrame, frame: UncertainFrame, _: Vectors, note: Note, __: bool) -> WrittenFrame:
    value = BRANDS["abb"].syntax.format(*brand_fields("abb", frame))
    data = f'[FALSE, TRUE, "", {value}, [[0, 0, 0], [1, 0, 0, 0]]]'
    return WrittenFrame(f"! {note(0.0)}\nPERS wobjdata {where.slot} := {data};\n", ())


def _ur(where: WorkFrame, frame: UncertainFrame, _: Vectors, note: Note, __: bool) -> WrittenFrame:
    value = BRANDS["ur"].syntax.format(*brand_fields("ur", frame))
    use = f"# a point p of the part: movel(pose_trans({where.slot}, p))"
    return WrittenFrame(f"# {note(0.0)}\n{use}\nglobal {where.slot} = {value}\n", ())


_Writer = Callable[[WorkFrame, UncertainFrame, Vectors, Note, bool], WrittenFrame]
_NAME = r"[A-Za-z][A-Za-z0-9_]{0,30}"
_G = r"G5[4-9]"

CONTROLLERS: Mapping[str, tuple[str, str, str, _Writer]] = MappingProxyType(
    {
        "linuxcnc": (_G + r"|G59\.[1-3]", "G54", "G54", partial(_offset, turn="R")),
        "grbl": (_G, "G54", "G54", partial(_offset, turn="none")),
        "haas": (_G, "G54", "G54", partial(_offset, turn="rounded")),
        "siemens": (r"G5[4-7]", "G54", "G54", _siemens),
        "heidenhain": ("shift", "shift", "shift", _heidenhain),
        "fanuc": (_G + "|[1-9]", "G54 (machine tool) or fanuc:1 (robot)", "1", _fanuc_frame),
        "kuka": (r"[1-9]|[12]\d|3[0-2]", "1", "1", _kuka),
        "abb": (_NAME, "wobj_part", "wobj_part", _abb),
        "ur": (_NAME, "part_frame", "part_frame", _ur),
    }
)
"""Controllers by name: pattern of the frame's name, example, default, and function that writes it."""
