"""Layout of text output: width of tables, and bold headings."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import zip_longest

_FOLDED = 12
"""Smallest width of a folded column of text [characters]."""


def printable(text: str) -> str:
    """Return text with control characters and lone surrogates escaped, so that a file cannot control the terminal.

    Args:
        text: any text.
    """
    return "".join(c if c.isprintable() else c.encode("unicode_escape", "surrogatepass").decode() for c in text)


@dataclass(frozen=True, slots=True)
class Layout:
    """Layout of text output.

    Attributes:
        width: largest width of a table [characters].
        colour: whether headings are bold, by the escape sequences of terminals.
    """

    width: int = 120
    colour: bool = False

    def bold(self, text: str) -> str:
        """Return text in bold if the output supports it.

        Args:
            text: heading.
        """
        return f"\x1b[1m{text}\x1b[0m" if self.colour else text

    def table(
        self, headers: Sequence[str], rows: Iterable[Sequence[str]], *, left: Sequence[int] = (0,), indent: int = 0
    ) -> list[str]:
        """Return the lines of a table that fits into the width, without cutting numbers.

        If the columns do not fit, each row becomes several lines with a name and a value.

        Args:
            headers: headers of the columns.
            rows: cells of each row as text.
            left: indices of left-aligned columns, whose text may be folded; the others are right-aligned.
            indent: number of spaces before each line.
        """
        cells = [[printable(cell) for cell in row] for row in rows]
        wide = [max(len(header), *(len(row[k]) for row in cells), 0) for k, header in enumerate(headers)]
        least = sum(min(w, _FOLDED) if k in left else w for k, w in enumerate(wide)) + 2 * (len(headers) - 1) + indent
        inner = self.width - indent
        lines = _columns(headers, cells, left, inner) if least <= self.width else _records(headers, cells, inner)
        return [" " * indent + line if line else line for line in lines]


PLAIN = Layout()
"""Layout for files and logs."""


def _columns(headers: Sequence[str], cells: Sequence[Sequence[str]], left: Sequence[int], width: int) -> list[str]:
    from rich.console import Console  # loaded for the first table only
    from rich.markup import escape
    from rich.table import Table

    out = Table(box=None, pad_edge=False, header_style="")
    for k, header in enumerate(headers):
        out.add_column(header, justify="left" if k in left else "right", overflow="fold", no_wrap=k not in left)
    for row in cells:
        out.add_row(*map(escape, row))
    console = Console(width=width, color_system=None, highlight=False, emoji=False, force_terminal=False)
    with console.capture() as captured:
        console.print(out)
    return [line.rstrip() for line in captured.get().splitlines()]


def _records(headers: Sequence[str], cells: Sequence[Sequence[str]], width: int) -> list[str]:
    """Return each row as lines of name and value, with an empty line between rows."""
    name = min(max(map(len, headers)), width // 3)
    lines = list[str]()
    for row in cells:
        lines.append("")
        for header, cell in zip(headers, row, strict=True):
            pairs = zip_longest(textwrap.wrap(header, name), textwrap.wrap(cell, width - name - 2), fillvalue="")
            lines += [f"{a:<{name}}  {b}".rstrip() for a, b in pairs]
    return lines[1:]
