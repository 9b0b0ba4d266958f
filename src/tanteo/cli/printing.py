"""Where text goes: answers to standard output, everything else to standard error, colour only on a terminal."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from collections.abc import Callable


def printable(text: str) -> str:
    """The text with control characters and lone surrogates written as escapes: file contents cannot move a cursor."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape", "surrogatepass").decode() for c in text)


def emit(lines: Iterable[str], stream: TextIO | None = None) -> None:
    """Write lines; characters that the stream cannot show are escaped."""
    stream = stream or sys.stdout
    encoding = stream.encoding or "utf-8"
    for line in lines:
        stream.write(line.encode(encoding, "backslashreplace").decode(encoding) + "\n")
    stream.flush()


def complain(kind: str, message: str) -> None:
    """``error: message`` or ``warning: message`` on standard error."""
    colour = {"error": "31", "warning": "33"}[kind]
    label = f"\x1b[{colour}m{kind}:\x1b[0m" if has_colour(sys.stderr) else f"{kind}:"
    emit([f"{label} {printable(message)}"], sys.stderr)


def has_colour(stream: TextIO) -> bool:
    """Whether to colour what goes to this stream: a terminal, and ``NO_COLOR`` unset (no-color.org)."""
    return stream.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def bold(text: str) -> str:
    """Bold on a terminal."""
    return f"\x1b[1m{text}\x1b[0m" if has_colour(sys.stdout) else text


def table(headers: Sequence[str], rows: Iterable[Sequence[str]], *, left: Sequence[int] = (0,)) -> list[str]:
    """Lines of a table that fits the terminal (or 120 columns elsewhere); numbers to the right.

    Args:
        headers: Of the columns.
        rows: Cells as text.
        left: Columns with text, which may fold; the others keep their width.
    """
    from rich.console import Console
    from rich.table import Table

    out = Table(box=None, pad_edge=False, header_style="")
    for k, header in enumerate(headers):
        out.add_column(header, justify="left" if k in left else "right", overflow="fold", no_wrap=k not in left)
    for row in rows:
        out.add_row(*(_plain(printable(cell)) for cell in row))
    width = None if sys.stdout.isatty() else 120
    console = Console(width=width, color_system=None, highlight=False, emoji=False, force_terminal=False)
    with console.capture() as captured:
        console.print(out)
    return [line.rstrip() for line in captured.get().splitlines()]


def _plain(text: str) -> str:
    from rich.markup import escape

    return escape(text)


@contextmanager
def progress(label: str, *, quiet: bool) -> Iterator[Callable[[int, int], None]]:
    """A bar on standard error while something long runs; silent if that is not a terminal.

    Yields:
        To call with the number done and the number of all.
    """
    if quiet or not sys.stderr.isatty():
        yield lambda done, total: None
        return
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True, no_color=not has_colour(sys.stderr))
    with Progress(console=console, transient=True) as bar:
        task = bar.add_task(label, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
