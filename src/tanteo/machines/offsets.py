"""Work offsets that a controller of G-code was told, and whether it has them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from tanteo.geometry.typing import Vectors
from tanteo.machines.protocol import MachineError

_SLOTS = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")
_NEAR = 2e-3
"""Within which a controller shows what it was told: GRBL rounds to a micrometre [mm]."""


@dataclass(frozen=True, slots=True, eq=False)
class WorkFrame:
    """The coordinates that a program is in: ``machine = turn (program + shift) + offset``.

    Attributes:
        offset: of the frame ``(3,)`` [m].
        turn: of it ``(3, 3)``.
        shift: of ``G92`` ``(3,)`` [m].
    """

    offset: Vectors = field(default_factory=lambda: np.zeros(3))
    turn: Vectors = field(default_factory=lambda: np.eye(3))
    shift: Vectors = field(default_factory=lambda: np.zeros(3))

    def program(self, place: Vectors) -> Vectors:
        """Of a place of the machine ``(3,)`` [m]."""
        return np.asarray(self.turn.T @ (place - self.offset) - self.shift)

    def machine(self, place: Vectors) -> Vectors:
        """Of a place of the program ``(3,)`` [m]."""
        return np.asarray(self.turn @ (place + self.shift) + self.offset)


def commands(text: str) -> Iterator[str]:
    """Lines of G-code that are no comment."""
    return (row for row in text.splitlines() if row.strip() and not row.lstrip().startswith("("))


def frames_in(text: str) -> dict[str, dict[str, float]]:
    """Of ``G10 L2 P1 X1 Y2 Z3`` lines: letters and numbers of each frame, as typed."""
    found = dict[str, dict[str, float]]()
    for row in commands(text):
        words = {a: float(v) for a, v in re.findall(r"([A-Z])\s*([-+]?\d*\.?\d+)", row.upper())}
        if words.get("G") == 10 and words.get("L") == 2 and 1 <= words.get("P", 0) <= len(_SLOTS):
            found[_SLOTS[int(words["P"]) - 1]] = {a: words[a] for a in "XYZR" if a in words}
    return found


def number_of(slot: str) -> int:
    """1 of ``G54``, and so on."""
    return _SLOTS.index(slot) + 1


def check(name: str, slot: str, wanted: dict[str, float], has: Vectors) -> None:
    """Whether the controller has what it was told ``(4,)``: x, y, z [mm] and the turn [deg].

    Raises:
        MachineError: it has not.
    """
    for letter, value in wanted.items():
        there = float(has["XYZR".index(letter)])
        if not abs(there - value) <= _NEAR:
            raise MachineError(
                f"{name}: expected {slot} to be set to {letter}{value:g}, got {letter}{there:g} when it was read "
                "back. Look at the controller before you use that frame."
            )


def padded(place: Vectors, turn: float = 0.0) -> Vectors:
    """Three lengths and a turn as :func:`check` takes them ``(4,)``."""
    return np.array([*place, turn])
