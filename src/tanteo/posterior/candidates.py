"""Candidate parts: sizes and tables that are available without opening a part."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from tanteo.catalogue import Catalogue, tables_of
from tanteo.catalogue.signatures import coarse_field, field_table, signature
from tanteo.geometry.typing import FloatArray, IntArray, Vectors
from tanteo.parts import StoredParts, as_parts
from tanteo.parts.symmetry import chirality
from tanteo.posterior.answers.whole_object import WholeObject
from tanteo.posterior.prepared import PreparedPart, prepare
from tanteo.posterior.settings import PruningSettings

_CHIRAL = 1e-5
"""Numerical: chirality above which it is no rounding error of a part that is its own mirror image."""


class Candidates:
    """Parts of a list or of a catalogue.

    Attributes:
        parts: the parts, prepared or not.
    """

    def __init__(self, parts: Any) -> None:
        self.parts: Sequence[Any] = as_parts("parts", parts)

    def __len__(self) -> int:
        return len(self.parts)

    def prepared(self, row: int) -> PreparedPart:
        """Open one part and return it prepared."""
        return prepare(self.parts[row])

    @cached_property
    def _numbers(self) -> FloatArray:
        """Return area, volume, radius, centroid and box of the parts, as in the signature ``(n, 17)``."""
        if isinstance(self.parts, StoredParts):
            return self.parts.numbers
        out = np.zeros((len(self), 17))
        for row, one in enumerate(self.parts):
            part = getattr(one, "part", one)
            out[row, :3], out[row, 5:8], out[row, 8:14] = (
                (part.area, part.volume, part.radius), part.centroid, part.box.ravel(),
            )  # fmt: skip
        return out

    @property
    def areas(self) -> FloatArray:
        """Return the surface areas ``(n,)`` [m^2]."""
        return self._numbers[:, 0]

    @property
    def volumes(self) -> FloatArray:
        """Return the volumes ``(n,)`` [m^3]."""
        return self._numbers[:, 1]

    @property
    def radii(self) -> FloatArray:
        """Return the radii of the balls about the centroids ``(n,)`` [m]."""
        return self._numbers[:, 2]

    @property
    def centroids(self) -> Vectors:
        """Return the centroids ``(n, 3)`` [m]."""
        return self._numbers[:, 5:8]

    @property
    def diagonals(self) -> FloatArray:
        """Return the diagonals of the boxes ``(n,)`` [m]."""
        return np.asarray(np.linalg.norm(self._numbers[:, 11:14] - self._numbers[:, 8:11], axis=1))

    def log_odds(self, whole: WholeObject | None) -> FloatArray:
        """Return log odds of each part by its global properties ``(n,)``; 0 without measurements of these."""
        if whole is None:
            return np.zeros(len(self))
        out = whole.log_odds(self.volumes, self._numbers[:, 11:14] - self._numbers[:, 8:11])
        return out if whole.outline is None else out + whole.outline.log_odds(self.parts)

    def named(self, odds: FloatArray, rows: Iterable[int]) -> dict[str, float]:
        """Return the log odds of some parts by name, from those of all parts."""
        return {self.name(int(row)): float(odds[row]) for row in rows}

    def names_of_same_shape(self, part: Any) -> tuple[list[str], list[str]]:
        """Return the names of the parts with the shape of a part, and of its mirror images.

        The shape is the same if area and volume are, up to single precision.
        """
        rounding = float(np.finfo(np.float32).resolution)
        same = np.isclose(self._numbers[:, :2], (part.area, part.volume), rtol=rounding, atol=0).all(axis=1)
        names: tuple[list[str], list[str]] = ([], [])
        rows = np.flatnonzero(same)
        own = chirality(part) if len(rows) > 1 else 0.0  # alone, it is the part itself
        for row in map(int, rows):
            other = chirality(self.prepared(row).part) if abs(own) > _CHIRAL else 0.0
            names[own * other < -(_CHIRAL**2)].append(self.name(row))
        return names

    def similar(self, prepared: PreparedPart, rows: IntArray, settings: PruningSettings) -> list[int]:
        """Return the rows of parts with nearly the box, centroid, area and volume of a part, nearest first.

        Args:
            prepared: the part.
            rows: rows of the parts that are compared with it.
            settings: tolerance of the comparison, and largest number of rows.
        """
        part = prepared.part
        own = np.r_[part.centroid, part.box.ravel(), np.sqrt(part.area / 6), np.cbrt(part.volume)]
        sizes = np.column_stack([np.sqrt(self.areas[rows] / 6), np.cbrt(self.volumes[rows])])
        off = np.abs(np.column_stack([self._numbers[rows, 5:14], sizes]) - own).max(axis=1)
        near = np.flatnonzero(off < settings.similar * part.diagonal)
        return [int(row) for row in rows[near[np.argsort(off[near], kind="stable")]][: settings.least]]

    def name(self, row: int) -> str:
        """Return the name of a part, without opening it if possible."""
        if isinstance(self.parts, Catalogue):
            return self.parts.name(row)
        one = self.parts[row]
        return str(getattr(one, "part", one).name)

    @cached_property
    def tables(self) -> list[tuple[int, Any]]:
        """Return the first row of each table of parts, and its arrays; those of a catalogue are memory-mapped."""
        if isinstance(self.parts, Catalogue):
            starts = self.parts.starts
            return [(int(s), segment.table) for s, segment in zip(starts, self.parts.segments, strict=False)]
        return [(0, tables_of([_signed(prepare(part)) for part in self.parts]))]

    @cached_property
    def fields(self) -> list[tuple[int, Any]]:
        """Return the columns of the coarse fields; for a list of parts no other columns are computed."""
        if isinstance(self.parts, Catalogue):
            return self.tables
        opened = [prepare(part) for part in self.parts]
        return [(0, field_table(self._numbers, [coarse_field(one.part, one.compiled) for one in opened]))]


def _signed(prepared: PreparedPart) -> dict[str, Any]:
    """Return the signature of a part, which is kept with it."""
    derived = prepared.part.derived
    if "signature" not in derived:
        derived["signature"] = signature(prepared.part, prepared.compiled)
    known: dict[str, Any] = derived["signature"]
    return known


def sizes_of(parts: Any) -> tuple[float, ...]:
    """Return the diagonals of parts [m]."""
    return tuple(Candidates(parts).diagonals.tolist())
