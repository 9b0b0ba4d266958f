"""Define the parsed content of a log, and the entry of a log format."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tanteo.geometry.typing import BoolArray, FloatArray

if TYPE_CHECKING:
    from tanteo.io.logs.contents import Contents
from tanteo.io.logs.ends import EndMark

AS_MILLIMETRES = "Coordinates are taken as millimetres; for inches use --units in."
"""Note on the unit of programs that report millimetres unless they are set otherwise."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Log:
    """Parsed content of a log with ``n`` rows in the file's own length unit; None where the file has no such content.

    Attributes:
        points: positions ``(n, 3)``; None for a log of ranges or of poses only.
        unit: length unit of the file (``mm``, ``m``, ``um``, ``in``); None if the file does not state it.
        assumed: whether the unit is the format's usual one, which the file itself does not state.
        centres: whether the points are centres of the tip's ball, so that its radius is required.
        radii: radius of the tip's ball ``(n,)``.
        directions: approach or viewing directions into the material ``(n, 3)``.
        outward: vectors I, J, K out of the material, as commanded or reported ``(n, 3)``.
        normals: sensed surface normals ``(n, 3)``.
        kinds: kind of each row: ``circle``, ``cylinder``, ``sphere`` or ``cone`` for the centre (apex) of a round
            feature, ``point`` otherwise.
        sizes: radius of each round feature, half angle of a cone [rad]; NaN if unknown and for points ``(n,)``.
        sides: material side of each round feature, ``hole`` or ``boss``; empty if unknown.
        sds: standard deviation of each point or centre ``(n,)``; NaN if unknown.
        ids: unique names of the rows.
        brand: brand whose convention ``poses`` follow, a name of ``tanteo.io.BRANDS``.
        poses: poses of the hand ``(n, k)``, in the brand's fields and units.
        zones: numbers of rows and columns of a multi-zone sensor's frame.
        cells: row and column of each range in its frame ``(n, 2)``, counted from 1.
        ranges: ranges ``(n,)``, NaN where the beam hit nothing.
        free: mask of beams that hit nothing ``(n,)``.
        alternatives: other interpretations of the same file, of which the rig selects one.
        notes: sentences about assumptions and ignored content.
        unit_note: sentence about the assumed unit, for a user who does not state one.
        moves: whether each row is a probe move of a controller, which searches a place in several steps.
    """

    points: FloatArray | None = None
    unit: str | None = None
    assumed: bool = False
    centres: bool = False
    radii: FloatArray | None = None
    directions: FloatArray | None = None
    outward: FloatArray | None = None
    normals: FloatArray | None = None
    kinds: tuple[str, ...] | None = None
    sizes: FloatArray | None = None
    sides: tuple[str, ...] | None = None
    sds: FloatArray | None = None
    ids: tuple[str, ...] | None = None
    brand: str = ""
    poses: FloatArray | None = None
    zones: tuple[int, int] | None = None
    cells: np.ndarray | None = None
    ranges: FloatArray | None = None
    free: BoolArray | None = None
    alternatives: tuple[Log, ...] = ()
    notes: tuple[str, ...] = ()
    unit_note: str = ""
    moves: bool = False

    def __len__(self) -> int:
        first = next((c for c in (self.points, self.poses, self.ranges) if c is not None), ())
        return len(first)


@dataclass(frozen=True, slots=True)
class LogFormat:
    """Format of logs.

    Attributes:
        name: name of the format, as in ``--format``.
        words: description for messages, such as ``a LinuxCNC probe log``.
        recognise: function that returns whether contents are in this format; it should use only their start.
        read: function that parses the contents; it raises ReadingsError if they are malformed.
        ends: statements that end a file of the format; empty for formats without one.
    """

    name: str
    words: str
    recognise: Callable[[Contents], bool]
    read: Callable[[Contents], Log]
    ends: tuple[EndMark, ...] = ()


def unique(names: list[str]) -> tuple[str, ...]:
    """Return names made unique: repeated ones get their count after a dot.

    Args:
        names: names in order.
    """
    seen: dict[str, int] = {}
    out = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        out.append(name if seen[name] == 1 else f"{name}.{seen[name]}")
    return tuple(out) if len(set(out)) == len(out) else tuple(str(k) for k in range(1, len(out) + 1))


_SEARCH, _STEPS, _STILL = 0.3e-3, 3, 1e-9
"""Largest distance between touches of one search [m], largest number of them, and least motion of an axis [m]."""


def last_of_each_search(points: FloatArray) -> BoolArray:
    """Return which touches are the last of their search ``(n,)``.

    A controller searches a surface fast, retracts and touches it again slowly. Two or three touches in a row that
    differ along one axis at most, by up to 0.3 mm, are one search; more are repeats of one place.

    Args:
        points: positions of the touches in the order of the log ``(n, 3)`` [m].
    """
    step = np.abs(np.diff(points, axis=0))
    again = ((step > _STILL).sum(axis=1) <= 1) & (step.max(axis=1, initial=0.0) <= _SEARCH)
    last = np.ones(len(points), dtype=np.bool_)
    ends = np.flatnonzero(np.append(~again, True))
    for first, end in zip(np.append(0, ends[:-1] + 1), ends, strict=True):
        if end - first < _STEPS:
            last[first:end] = False
    return last


def counted(n: int, one: str, many: str = "") -> str:
    """Return a number with its noun: ``1 line`` or ``2 lines``.

    Args:
        n: number.
        one: singular of the noun.
        many: plural of the noun; empty to append an s.
    """
    return f"{n} {one if n == 1 else many or one + 's'}"
