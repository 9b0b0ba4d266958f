"""G-code: the words that drivers send, and what fakes of controllers know: modes, offsets, where a block goes."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from tanteo.geometry import SO3
from tanteo.geometry.typing import Vectors

_WORD = re.compile(r"([A-Z])\s*([-+]?\d*\.?\d+)")
_MOTIONS = ("0", "1", "38.2", "38.3")


def place_words(place: Vectors) -> str:
    """``X1.0000 Y2.0000 Z3.0000`` of a place ``(3,)`` [m], in millimetres."""
    return " ".join(f"{axis}{1e3 * v + 0.0:.4f}" for axis, v in zip("XYZ", place, strict=True))


def feed_word(speed: float) -> str:
    """``F120.000`` of a speed [m/s], in millimetres a minute."""
    return f"F{60e3 * speed:.3f}"


@dataclass(frozen=True, slots=True)
class Block:
    """A line of G-code.

    Attributes:
        codes: of ``G``, as typed.
        words: the other letters.
    """

    codes: frozenset[str]
    words: Mapping[str, float]

    @property
    def sets(self) -> bool:
        """Whether it sets an offset."""
        return "10" in self.codes

    @property
    def moves(self) -> bool:
        """Whether an axis is told where to go."""
        return not self.sets and any(axis in self.words for axis in "XYZ")


@dataclass(slots=True)
class Modal:
    """What stays from block to block.

    Attributes:
        offsets: of the work coordinates, by number, ``(3,)`` [m].
        turns: of them about z, by number [rad].
        active: which of them.
        absolute: ``G90``.
        unit: of lengths [m].
        feed: [m/s].
        motion: the last of ``G0``, ``G1``, ``G38.2``, ``G38.3``.
    """

    offsets: dict[int, Vectors] = field(default_factory=dict)
    turns: dict[int, float] = field(default_factory=dict)
    active: int = 1
    absolute: bool = True
    unit: float = 1e-3
    feed: float = 0.0
    motion: str = "0"

    @property
    def offset(self) -> Vectors:
        """Of the coordinates in use ``(3,)`` [m]."""
        return self.offsets.get(self.active, np.zeros(3))

    def read(self, line: str) -> Block:
        """A line, and the modes that it sets.

        Raises:
            ValueError: it is not made of letters with numbers; a number has no exponent.
        """
        said = re.sub(r"\([^)]*\)", "", line.upper())
        found = _WORD.findall(said)
        if _WORD.sub("", said).strip():
            raise ValueError(line)
        block = Block(
            frozenset(value for letter, value in found if letter == "G"),
            {letter: float(value) for letter, value in found if letter != "G"},
        )
        for code in block.codes:
            self._mode(code)
        if "F" in block.words:
            self.feed = block.words["F"] * self.unit / 60
        return block

    def goal(self, block: Block, place: Vectors) -> Vectors:
        """Where a block goes ``(3,)`` from a place, in machine coordinates [m]."""
        here = self.program(place)
        goal = here.copy() if self.absolute else np.zeros(3)
        for k, axis in enumerate("XYZ"):
            goal[k] = self.unit * block.words.get(axis, goal[k] / self.unit)
        return self._turn @ (goal if self.absolute else here + goal) + self.offset

    def program(self, place: Vectors) -> Vectors:
        """A place of the machine ``(3,)`` in the coordinates in use [m]."""
        return np.asarray(self._turn.T @ (place - self.offset))

    @property
    def _turn(self) -> Vectors:
        return np.asarray(SO3.axis_rotation(2, self.turns.get(self.active, 0.0)))

    def set_offset(self, block: Block) -> None:
        """``G10 L2 P1``."""
        number = int(block.words.get("P", 0)) or self.active
        place = self.offsets.get(number, np.zeros(3)).copy()
        for k, axis in enumerate("XYZ"):
            place[k] = self.unit * block.words[axis] if axis in block.words else place[k]
        self.offsets[number] = place
        if "R" in block.words:
            self.turns[number] = np.radians(block.words["R"])

    def _mode(self, code: str) -> None:
        if code in _MOTIONS:
            self.motion = code
        elif code in ("20", "21"):
            self.unit = 25.4e-3 if code == "20" else 1e-3
        elif code in ("90", "91"):
            self.absolute = code == "90"
        elif code in ("54", "55", "56", "57", "58", "59"):
            self.active = int(code) - 53
