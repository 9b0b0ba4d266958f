"""Exclude rows of a table that are no readings: remarks and statistics; and find units written in its cells."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from tanteo.io.logs.log import counted
from tanteo.io.logs.value_words import LENGTH_UNITS, plain

_STATISTIC = re.compile(
    r"mean|average|avg|min(?:imum)?|max(?:imum)?|range|std(?:ev|\.? ?dev\.?)?|sigma|rms|sum|total|median"
    r"|mittel(?:wert)?|durchschnitt|summe|moyenne|ecart[- ]type|media|promedio|somme|suma|(?:平均|最大|最小)[値值]?"
)
"""Names of rows that summarize the others."""
_UNIT = re.compile(r"[-+]?\.?\d[\d.,eE+-]*\s*([a-z]{1,11}|\")")
_DIGIT = re.compile(r"\d")
_WITH_UNIT = re.compile(r".*[\s_\[(./](?:mm|cm|m|um|in)[\])]?")
"""Name of a column that states its unit, which cells in another unit contradict."""


@dataclass(eq=False)
class Excluded:
    """Counter of rows that are no readings.

    Attributes:
        width: number of cells of a row.
        remarks: number of lines with fewer cells and without a digit.
        statistics: names of rows that summarize others.
    """

    width: int
    remarks: int = 0
    statistics: list[str] = field(default_factory=list)

    def rows(self, rows: Iterator[list[str]]) -> Iterator[list[str]]:
        """Return the rows without remarks and statistics, which are counted.

        Args:
            rows: rows below the header.
        """
        for row in rows:
            if len(row) < self.width and not _DIGIT.search("".join(row)):
                self.remarks += 1
            elif row and row[0][:1].isalpha() and _STATISTIC.fullmatch(plain(row[0].strip(" .:"))):
                self.statistics.append(row[0].strip())
            else:
                yield row

    def notes(self) -> list[str]:
        """Return sentences on the excluded rows."""
        out = [f"{counted(self.remarks, 'line')} without numbers excluded."] if self.remarks else []
        return out + ([f"Rows excluded as statistics of others: {', '.join(self.statistics)}."] * bool(self.statistics))


def units_of_cells(header: Sequence[str], row: Sequence[str]) -> list[str] | None:
    """Return the length units of cells such as ``264.1 mm`` in columns whose names have no unit; None without any.

    Args:
        header: cells of the header.
        row: cells of the first row.
    """
    if len(row) != len(header):
        return None
    found = [match[1] if (match := _UNIT.fullmatch(plain(cell.strip()))) else "" for cell in row]
    own = [_WITH_UNIT.fullmatch(plain(name.strip())) for name in header]
    units = ["" if name else LENGTH_UNITS.get(unit, "") for name, unit in zip(own, found, strict=True)]
    return units if any(units) else None
