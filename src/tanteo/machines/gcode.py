"""Write and interpret G-code: words that drivers send; modes, offsets and goals of blocks for fake controllers."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from tanteo.geometry import SO3
from tanteo.geometry.typing import Vectors

MODES = "G21 G90 G94 G54"
"""Modes that every line with a motion sets: millimetres, absolute coordinates, feed a minute, work frame."""
_WORD = re.compile(r"([A-Z])\s*([-+]?\d*\.?\d+)")
_MOTIONS = ("0", "1", "2", "3", "38.2", "38.3", "38.4", "38.5", "80")
_GROUPS = (
    _MOTIONS, ("20", "21"), ("90", "91"), ("93", "94"), ("54", "55", "56", "57", "58", "59"), ("4", "10", "53", "92"),
    ("17", "18", "19"), ("43.1", "49"), ("40",),
)  # fmt: skip
"""Modal groups of the codes; a block has at most one code of each."""


def place_words(place: Vectors) -> str:
    """Return the words of a position, such as ``X1.0000 Y2.0000 Z3.0000``, in millimetres.

    Args:
        place: position ``(3,)`` [m].
    """
    return " ".join(f"{axis}{1e3 * v + 0.0:.4f}" for axis, v in zip("XYZ", place, strict=True))


def feed_word(speed: float) -> str:
    """Return the word of a speed, such as ``F120.000``, in millimetres a minute.

    Args:
        speed: speed [m/s].
    """
    return f"F{60e3 * speed:.3f}"


@dataclass(frozen=True, slots=True)
class Block:
    """Block, which is one line of G-code.

    Attributes:
        codes: numbers of the ``G`` words, as typed.
        words: numbers of the other words, by letter.
    """

    codes: frozenset[str]
    words: Mapping[str, float]

    @property
    def conflicts(self) -> bool:
        """Whether the block has two codes of one modal group."""
        return any(sum(code in group for code in self.codes) > 1 for group in _GROUPS)

    @property
    def of_machine(self) -> bool:
        """Whether the coordinates of the block are those of the machine (``G53``)."""
        return "53" in self.codes

    @property
    def sets(self) -> bool:
        """Whether the block sets an offset."""
        return "10" in self.codes

    @property
    def moves(self) -> bool:
        """Whether the block commands a motion of an axis."""
        return not self.sets and any(axis in self.words for axis in "XYZ")


@dataclass(slots=True)
class Modal:
    """Modal state of an interpreter, which persists from block to block.

    Attributes:
        offsets: offsets of the work coordinate systems, by number, each ``(3,)`` [m].
        turns: rotations of the work coordinate systems about z, by number [rad].
        active: number of the active work coordinate system; 1 is ``G54``.
        absolute: whether coordinates are absolute (``G90``).
        unit: metres per unit of length [m].
        feed: feed rate [m/s].
        per_minute: whether the feed is a length a minute (``G94``); otherwise it is the inverse of a time (``G93``).
        motion: number of the last motion code: ``0``, ``1``, ``38.2`` or ``38.3``.
    """

    offsets: dict[int, Vectors] = field(default_factory=dict)
    turns: dict[int, float] = field(default_factory=dict)
    active: int = 1
    absolute: bool = True
    unit: float = 1e-3
    feed: float = 0.0
    per_minute: bool = True
    motion: str = "0"

    def reset(self) -> None:
        """Set the modes that an interpreter has after a reset; offsets remain."""
        self.active, self.absolute, self.unit, self.per_minute, self.motion = 1, True, 1e-3, True, "0"

    @property
    def offset(self) -> Vectors:
        """Offset of the active work coordinate system ``(3,)`` [m]."""
        return self.offsets.get(self.active, np.zeros(3))

    def read(self, line: str) -> Block:
        """Return the block of a line, and update the modes that it sets.

        Args:
            line: line of G-code.

        Raises:
            ValueError: the line does not consist of letters with numbers without exponent.
        """
        text = re.sub(r"\([^)]*\)", "", line.upper())
        found = _WORD.findall(text)
        if _WORD.sub("", text).strip():
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
        """Return the goal of a block in machine coordinates ``(3,)`` [m].

        Args:
            block: block with a motion.
            place: current position in machine coordinates ``(3,)`` [m].
        """
        if block.of_machine:
            words = [block.words.get(axis, v / self.unit) for axis, v in zip("XYZ", place, strict=True)]
            return self.unit * np.array(words)
        here = self.program(place)
        goal = here.copy() if self.absolute else np.zeros(3)
        for k, axis in enumerate("XYZ"):
            goal[k] = self.unit * block.words.get(axis, goal[k] / self.unit)
        return self._turn @ (goal if self.absolute else here + goal) + self.offset

    def program(self, place: Vectors) -> Vectors:
        """Return a position in the active work coordinate system ``(3,)`` [m].

        Args:
            place: position in machine coordinates ``(3,)`` [m].
        """
        return np.asarray(self._turn.T @ (place - self.offset))

    @property
    def _turn(self) -> Vectors:
        return np.asarray(SO3.axis_rotation(2, self.turns.get(self.active, 0.0)))

    def set_offset(self, block: Block) -> None:
        """Set the offset and rotation of a work coordinate system, as ``G10 L2 P1`` does.

        Args:
            block: block with the new values.
        """
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
        elif code in ("93", "94"):
            self.per_minute = code == "94"
        elif code in ("54", "55", "56", "57", "58", "59"):
            self.active = int(code) - 53
