"""What a log says, as arrays, and a row of the table of formats."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tanteo.typing import BoolArray, FloatArray

if TYPE_CHECKING:
    from tanteo.logs.contents import Contents


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Log:
    """``n`` rows of a log, in the file's own length unit; what the file does not say is None.

    Attributes:
        points: Places ``(n, 3)``; None of a log of ranges or of poses alone.
        unit: Length unit of the file (``mm``, ``m``, ``um``, ``in``), None if it does not say.
        assumed: The unit is what the format has as a rule; the file itself does not say it.
        centres: The points are centres of the tip's ball, so its radius has to be known.
        radii: Radius of the ball ``(n,)``.
        directions: Where the tip moved or the device looked ``(n, 3)``, into the material.
        outward: Vectors ``(n, 3)`` out of the material, as probes are told or reports say them: i, j, k.
        normals: Normals ``(n, 3)`` that were sensed.
        kinds: Of rows that give the centre of a round feature its kind (``circle``, ``cylinder``, ``sphere``,
            ``cone``), of others ``point``.
        sizes: Of centres the radius, of a cone the half angle [rad]; NaN where it is not said, and of points ``(n,)``.
        sides: Of centres ``hole`` or ``boss``, or nothing.
        sds: Standard deviation of each point or centre ``(n,)``; NaN where it is not said.
        ids: Names of the rows, unique.
        brand: Who writes ``poses`` so, a name of ``tanteo.io.BRANDS``.
        poses: Of the hand ``(n, k)``, in the brand's fields and units.
        zones: Rows and columns of a ranging sensor's frame.
        cells: Row and column ``(n, 2)`` of each range in its frame, from 1.
        ranges: ``(n,)``, NaN where the beam met nothing.
        free: The beam met nothing ``(n,)``.
        notes: Sentences of what was left out or taken as something.
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
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        first = next((c for c in (self.points, self.poses, self.ranges) if c is not None), ())
        return len(first)


@dataclass(frozen=True, slots=True)
class LogFormat:
    """A format of logs.

    Attributes:
        name: As ``--format`` says it.
        words: What it is, for messages, as ``a LinuxCNC probe log``.
        recognise: Whether contents are in this format; asked of the beginning, so it has to be quick.
        read: The whole contents as a log; raises ReadingsError where they are malformed.
    """

    name: str
    words: str
    recognise: Callable[[Contents], bool]
    read: Callable[[Contents], Log]


def unique(names: list[str]) -> tuple[str, ...]:
    """Names as they are where they differ, else with the count of the repeat behind a dot."""
    seen: dict[str, int] = {}
    out = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        out.append(name if seen[name] == 1 else f"{name}.{seen[name]}")
    return tuple(out) if len(set(out)) == len(out) else tuple(str(k) for k in range(1, len(out) + 1))


def counted(n: int, one: str, many: str = "") -> str:
    """``1 line`` or ``2 lines``."""
    return f"{n} {one if n == 1 else many or one + 's'}"
