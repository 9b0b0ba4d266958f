"""Split cells that hold a list of numbers, such as all ranges of a frame, into columns of their own."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

_LIST = re.compile(r"[^\[(\d\-]{0,20}[\[(]?\s*(-?[\d.]+(?:[\s,;|]+-?[\d.]+)+)\s*[\])]?[^\])]{0,20}")
_SPLIT = re.compile(r"[\s,;|]+")
_LEAST = 4
"""Smallest number of numbers in a list of ranges."""


@dataclass(frozen=True, slots=True)
class ListCells:
    """Columns with lists.

    Attributes:
        header: header with one column for each element of a list: ``name_0``, ``name_1``, ..
        lengths: number of elements of each column; 0 for a column without lists.
    """

    header: tuple[str, ...]
    lengths: tuple[int, ...]

    def row(self, cells: Sequence[str]) -> list[str]:
        """Return the cells of a row with its lists split; a list of another length keeps its own.

        Args:
            cells: cells of a row.
        """
        out: list[str] = []
        for k, cell in enumerate(cells):
            length = self.lengths[k] if k < len(self.lengths) else 0
            words = _words(cell) if length else [cell]
            out += words if words or not length else [""] * length
        return out


def find_lists(header: Sequence[str], first: Sequence[str] | None) -> ListCells | None:
    """Return the columns whose first row holds a list of numbers; None if there is none.

    Args:
        header: cells of the header.
        first: cells of the first row below it; None for an empty table.
    """
    lengths = [len(_words(cell)) for cell in first or ()]
    lengths = [n if n >= _LEAST else 0 for n in lengths]
    if not any(lengths) or len(lengths) != len(header):
        return None
    names = [
        name if not n else f"{name}_{k}" for name, n in zip(header, lengths, strict=True) for k in range(max(n, 1))
    ]
    return ListCells(tuple(names), tuple(lengths))


def _words(cell: str) -> list[str]:
    """Return the numbers of a list as words; empty for another cell."""
    found = _LIST.fullmatch(cell.strip())
    return [] if found is None else _SPLIT.split(found[1])
