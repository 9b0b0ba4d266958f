"""Parse the work offsets in G-code, and check that a controller has them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from tanteo.geometry.typing import Vectors
from tanteo.machines.protocol import MachineError, in_mm

_SLOTS = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")
NEAR = 2e-3
"""Accepted difference between a set and a reported offset [mm]; GRBL rounds to a micrometre."""
_TURNED = 1e-6
"""Accepted difference of the elements of two rotations; LinuxCNC reports degrees with six decimals."""


@dataclass(frozen=True, slots=True, eq=False)
class WorkFrame:
    """Work coordinate system of a program: ``machine = turn (program + shift) + offset``.

    Attributes:
        offset: offset of the frame ``(3,)`` [m].
        turn: rotation of the frame ``(3, 3)``.
        shift: offset of ``G92`` ``(3,)`` [m].
    """

    offset: Vectors = field(default_factory=lambda: np.zeros(3))
    turn: Vectors = field(default_factory=lambda: np.eye(3))
    shift: Vectors = field(default_factory=lambda: np.zeros(3))

    def program(self, place: Vectors) -> Vectors:
        """Return a position in program coordinates ``(3,)`` [m].

        Args:
            place: position in machine coordinates ``(3,)`` [m].
        """
        return np.asarray(self.turn.T @ (place - self.offset) - self.shift)

    def machine(self, place: Vectors) -> Vectors:
        """Return a position in machine coordinates ``(3,)`` [m].

        Args:
            place: position in program coordinates ``(3,)`` [m].
        """
        return np.asarray(self.turn @ (place + self.shift) + self.offset)


def commands(text: str) -> Iterator[str]:
    """Return the lines of G-code that are not comments.

    Args:
        text: lines of G-code.
    """
    return (row for row in text.splitlines() if row.strip() and not row.lstrip().startswith("("))


def frames_in(text: str) -> dict[str, dict[str, float]]:
    """Return letters and numbers of each frame that ``G10 L2 P1 X1 Y2 Z3`` lines set, by slot.

    Args:
        text: lines of G-code.
    """
    found = dict[str, dict[str, float]]()
    for row in commands(text):
        words = {a: float(v) for a, v in re.findall(r"([A-Z])\s*([-+]?\d*\.?\d+)", row.upper())}
        if words.get("G") == 10 and words.get("L") == 2 and 1 <= words.get("P", 0) <= len(_SLOTS):
            found[_SLOTS[int(words["P"]) - 1]] = {a: words[a] for a in "XYZR" if a in words}
    return found


def number_of(slot: str) -> int:
    """Return the number of a slot from 1, which is ``G54``.

    Args:
        slot: code of the slot.
    """
    return _SLOTS.index(slot) + 1


def check(name: str, slot: str, wanted: dict[str, float], has: Vectors) -> None:
    """Check that a controller reports the frame that was set.

    Args:
        name: name of the machine, for messages.
        slot: code of the slot.
        wanted: letters and numbers that were set [mm, deg].
        has: reported x, y, z [mm] and rotation [deg] ``(4,)``.

    Raises:
        MachineError: the reported frame is another one.
    """
    for letter, value in wanted.items():
        there = float(has["XYZR".index(letter)])
        if not abs(there - value) <= NEAR:
            raise MachineError(
                f"{name}: expected {slot} to be set to {letter}{value:g}, got {letter}{there:g} when it was read "
                "back. Check the controller before you use that frame."
            )


def changes(before: WorkFrame, now: WorkFrame) -> str:
    """Return the difference of two frames for messages; empty if they agree within the rounding of controllers.

    Args:
        before: frame that the driver uses.
        now: frame that the controller reports.
    """
    pairs = ("a work offset", before.offset, now.offset), ("an offset of G92", before.shift, now.shift)
    for name, was, has in pairs:
        if not (1e3 * np.abs(has - was) <= NEAR).all():
            return f"{name} of {in_mm(has)} in place of {in_mm(was)}"
    return "" if (np.abs(now.turn - before.turn) <= _TURNED).all() else "another rotation of its work frame"


def padded(place: Vectors, turn: float = 0.0) -> Vectors:
    """Return a frame in the form of :func:`check` ``(4,)``.

    Args:
        place: offset ``(3,)`` [mm].
        turn: rotation about z [deg].
    """
    return np.array([*place, turn])
