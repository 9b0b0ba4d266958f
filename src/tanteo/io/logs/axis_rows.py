"""Read reports with one row for each coordinate of a feature, as programs of measuring machines print them.

A header names the column of the measured values, and each row the axis: ``X``, ``Position X``, ``xValue``, ``P1.X``.
The rows of one feature share a cell (its name), follow a line that names it, or follow each other until an axis
repeats; the reader chooses what makes most features complete. Forms known from public sources: PC-DMIS ``DIM LOC1=
LOCATION OF POINT PNT1 UNITS=MM`` above ``AX NOMINAL +TOL -TOL MEAS DEV OUTTOL`` (docs.hexagonmi.com, "Dimension Output
Format"); the table of characteristics of Zeiss Calypso (``idsymbol``, ``actual``, ``featureid``; sample in "zeiss
converter"); PolyWorks ``Name, Control, Nominal, Measured, Tol, Dev`` (tecnomatrix, "Kapture.io"); Mitutoyo GEOPAK
``ElemNo;TolName;FeatName;Nominal;UpperTol;LowerTol;Actual`` (F. Lehrbass, "Text file output using GEOPAK ASCII
Format").
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from tanteo.io.logs.contents import Contents, number
from tanteo.io.logs.log import Log, counted
from tanteo.io.logs.round_features import Feature, log_of
from tanteo.io.logs.value_words import BESIDE, LENGTH_UNITS, MEASURED, NOMINAL, VALUE, plain, stated_unit

_MARKS = ("\t", ";", "|", ",", "  ", "")
"""Delimiters in the order in which they are tried; the last ones are two blanks or more, and any blank."""
_OF_MEASURED = re.compile(rf"(?:{MEASURED}|real)(?:[\s_-]*{VALUE})?(?:[\s_]*[\[(].{{0,9}}[\])])?")
_OF_VALUES = re.compile(rf"[+-]?\s*(?:{NOMINAL}|{BESIDE}|(?:upper|lower|low|high|out)[\s_]?tol\w*)(?:[\s_-]*{VALUE})?")
_PLACE = rf"(?:posn?|position|coord\w*|koord\w*|axis|achse|axe|eje|asse|座標|坐标|{VALUE})"
_AXIS = re.compile(rf"(?:(.*?)[\s._:/-]+)?([xyz])(?:[\s._-]*{_PLACE})?")
_AXIS_FIRST = re.compile(rf"([xyz])[\s._-]*{_PLACE}[\s._:/-]+(.+)")
_DIAMETER = re.compile(r"(?:(.*?)[\s._:/-]+)?(?:d|df|dm|dia|diam\w*|durchm\w*|ø|⌀|直径)(?:[\s._-]*(?:value|wert))?")
_NO_PLACE = re.compile(rf"(?:.*[\s._:-])?(?:{BESIDE}|{NOMINAL}|n|nx|normal|dir\w*|vec\w*)")
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+")
_SHAPES = {
    "point": "point", "punkt": "point", "circle": "circle", "kreis": "circle", "cercle": "circle", "circulo": "circle",
    "cerchio": "circle", "hole": "circle", "bohrung": "circle", "cylinder": "cylinder", "zylinder": "cylinder",
    "cylindre": "cylinder", "sphere": "sphere", "kugel": "sphere", "line": "", "gerade": "", "cone": "", "kegel": "",
    "slot": "", "langloch": "", "ellipse": "", "droite": "",
}  # fmt: skip
"""Shape by its name in a report; empty for features whose coordinates are no point of the surface."""
_NAME = re.compile(r".*?([^\s:,=]+)(?:\s+UNITS\s*=.*)?[\s,$:]*", re.IGNORECASE)
_PLACED = re.compile(r"(?:LOCATION|POSITION) OF \w+\s+([^\s,]{1,60})", re.IGNORECASE)
_ENOUGH = 2
"""Smallest number of complete features by which the format is recognized."""


@dataclass(frozen=True, slots=True)
class _Header:
    """Header of a report.

    Attributes:
        mark: delimiter; empty for blanks.
        measured: index of the measured values among the cells, or after the axis where blanks separate cells.
    """

    mark: str
    measured: int


@dataclass(frozen=True, slots=True)
class _Row:
    """Row of one coordinate.

    Attributes:
        line: number of its line.
        axis: ``x``, ``y``, ``z`` or ``d``.
        value: measured value.
        cells: other cells.
        prefix: text beside the axis in its cell.
        block: number and text of the last line that is no row.
        width: number of cells of the line.
    """

    line: int
    axis: str
    value: str
    cells: tuple[str, ...]
    prefix: str
    block: tuple[int, str]
    width: int


def recognise(contents: Contents) -> bool:
    """Return whether the start of the file has features with measured X, Y and Z in rows of their own.

    Args:
        contents: file to test.
    """
    rows, _ = _rows(contents.head.splitlines())
    return len(rows) >= 3 * _ENOUGH and len(_complete(_features(rows))) >= _ENOUGH


def read(contents: Contents) -> Log:
    """Return the measured points and round features; notes count what is excluded.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: there is none, or values are malformed.
    """
    rows, others = _rows(contents.lines)
    if rows and rows[-1].line == len(contents.lines):
        contents.check_last([row.value for row in rows], rows[-1].line)
    cut = contents.is_open and rows and rows[-1].width < max(row.width for row in rows)
    rows = rows[:-1] if cut else rows
    found = _features(rows)
    features = [one for name, group in found if (one := _feature(name, group)) is not None]
    left = len(found) - len(features)
    if not features:
        got = f"{counted(left, 'feature')} without all of them or of other kinds" if left else "none"
        contents.fail("measured X, Y and Z of points or circles, one a row", got, "Export the points.")
    notes = ["The last line has fewer cells and no line break, and is excluded: the file is cut off."] if cut else []
    notes += [f"{counted(left, 'feature')} of other kinds or without all of X, Y and Z excluded."] if left else []
    notes += [f"{counted(others, 'characteristic')} of other kinds excluded."] if others else []
    notes.append("Positions are those of the report's alignment, which may be fitted to the part.")
    return log_of(contents, features, _unit(rows, contents.lines), notes)


def _rows(lines: Sequence[str]) -> tuple[list[_Row], int]:
    """Return the rows of coordinates below headers, and the number of other rows with a measured value."""
    header: _Header | None = None
    rows, others, block = list[_Row](), 0, (0, "")
    for k, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        if (new := _header(line)) is not None:
            header = new
            continue
        row = None if header is None else _row(header, k, line, block)
        if isinstance(row, _Row):
            rows.append(row)
        elif row is not None:
            others += 1
        else:
            block = (k, line.strip())
    return rows, others


def _cells(line: str, mark: str) -> list[str]:
    """Return the cells of a line without surrounding blanks and quotation marks."""
    if not mark.strip(" "):
        return re.split(r"\s{2,}", line.strip()) if mark else line.split()
    row = next(csv.reader([line.strip("|") if mark == "|" else line], delimiter=mark), [])
    return [cell.strip().strip('"') for cell in row]


def _header(line: str) -> _Header | None:
    """Return the header that a line is; None if it names no column of measured values, or holds numbers."""
    if len(line) > 2000 or re.search(rf"(?:{MEASURED}|real)", plain(line)) is None:
        return None
    for mark in _MARKS:
        cells = [plain(cell) for cell in _cells(line, mark)]
        measured = [k for k, cell in enumerate(cells) if _OF_MEASURED.fullmatch(cell)]
        if len(cells) < 3 or len(measured) != 1 or any(number(cell) == number(cell) for cell in cells):
            continue
        if mark.strip(" "):
            return _Header(mark, measured[0])
        first = next(k for k, cell in enumerate(cells) if k == measured[0] or _OF_VALUES.fullmatch(cell))
        return _Header("", measured[0] - first)
    return None


def _row(header: _Header, k: int, line: str, block: tuple[int, str]) -> _Row | bool | None:
    """Return the coordinate of a row; True for another measured value, None for another line."""
    cells = _cells(line, header.mark)
    names = [_axis(cell) for cell in cells]
    index = header.measured
    if not header.mark:
        bare = [name is not None and not name[1] for name in names]
        at = bare.index(True) if True in bare else -1
        index += at + 1
    else:
        at = next((i for i, name in enumerate(names) if name is not None and i != index), -1)
    if index >= len(cells):
        return None
    value = re.sub(r"\s*(?:mm|in|inch|m|um)$", "", cells[index])
    value = value.replace(",", ".") if _DECIMAL_COMMA.fullmatch(value) and header.mark != "," else value
    if number(value) != number(value):
        return None
    axis = names[at] if at >= 0 else None
    if axis is None:
        return True if header.mark else None
    others = (cell for i, cell in enumerate(cells) if i not in (at, index)) if header.mark else cells[:at]
    return _Row(k, axis[0], value, tuple(others), axis[1], block, len(cells))


def _axis(cell: str) -> tuple[str, str] | None:
    """Return the axis, or ``d`` for a diameter, that a cell names, and the text beside it; None for other cells."""
    text = plain(cell)
    if len(text) > 100:
        return None
    if match := _AXIS.fullmatch(text):
        prefix = match[1] or ""
        return None if _NO_PLACE.fullmatch(prefix) else (match[2], cell[: len(prefix)])
    if match := _AXIS_FIRST.fullmatch(text):
        return match[1], match[2]
    match = _DIAMETER.fullmatch(text)
    return None if match is None else ("d", cell[: len(match[1] or "")])


def _features(rows: Sequence[_Row]) -> list[tuple[str, list[_Row]]]:
    """Return the rows of each feature with its name, divided so that most features are complete."""
    width = max((len(row.cells) for row in rows), default=0)
    keys: list[Callable[[_Row], str]] = [partial(_cell, k) for k in range(width)]
    keys += [lambda row: row.prefix, lambda row: str(row.block[0])]
    divided = [_divide(rows, key) for key in keys]
    return max(divided, key=lambda found: (len(_complete(found)), len({name for name, _ in found})), default=[])


def _cell(k: int, row: _Row) -> str:
    return row.cells[k] if k < len(row.cells) else ""


def _divide(rows: Sequence[_Row], key: Callable[[_Row], str]) -> list[tuple[str, list[_Row]]]:
    """Return the rows by a name, which continues where it is empty; a repeated axis begins another feature."""
    out = list[tuple[str, list[_Row]]]()
    last = dict[str, list[_Row]]()
    name = ""
    for row in rows:
        name = key(row) or name
        group = last.get(name)
        if group is None or any(row.axis == other.axis for other in group):
            group = last[name] = []
            out.append((name, group))
        group.append(row)
    return out


def _complete(found: Sequence[tuple[str, list[_Row]]]) -> list[Feature]:
    return [one for name, group in found if (one := _feature(name, group)) is not None]


def _feature(name: str, rows: list[_Row]) -> Feature | None:
    """Return the feature of rows; None if it lacks coordinates, or they are no point of the surface."""
    axes = {row.axis: row.value for row in rows}
    words = {
        w for row in rows[:1] for text in (*row.cells, row.block[1]) for w in re.findall(r"[^\W\d_]+", plain(text))
    }
    found = [_SHAPES[word] for word in sorted(words & _SHAPES.keys())]
    shape = found[0] if found else "circle" if "d" in axes else "point"
    if shape in ("circle", "cylinder") and {"x", "y", "d"} <= axes.keys():
        axes.setdefault("z", "0")  # a centre counts at any height
    if not shape or not set("xyz") <= axes.keys():
        return None
    block = rows[0].block
    if name == str(block[0]):
        placed = _PLACED.search(block[1]) or _NAME.fullmatch(block[1])
        name = placed[1] if placed else ""
    diameter = axes.get("d", "") if shape != "point" else ""
    return Feature(rows[0].line, name, None if shape == "point" else shape, "", [axes[a] for a in "xyz"], [], diameter)


def _unit(rows: Sequence[_Row], lines: Sequence[str]) -> str | None:
    """Return the unit that cells of all rows, or lines of the report, state; None if there is none."""
    cells = [{LENGTH_UNITS[plain(cell)] for cell in row.cells if plain(cell) in LENGTH_UNITS} for row in rows]
    own = set.union(*cells) if all(cells) else set[str]()
    if len(own) == 1:
        return own.pop()
    titles = sorted({row.block[1] for row in rows} | set(lines[:20]))
    headers = [f"unit: {unit}" for line in lines[:20] for unit in re.findall(r"[\[(](\w{1,11})[\])]", line)]
    return stated_unit([*titles, *headers])
