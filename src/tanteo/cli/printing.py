"""Where text goes: answers to standard output, everything else to standard error, colour only on a terminal."""

from __future__ import annotations

import os
import re
import shutil
import sys
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from itertools import zip_longest
from typing import TYPE_CHECKING, TextIO

from tanteo.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable


_WARNED: ContextVar[list[str] | None] = ContextVar("warned", default=None)
"""Warnings of the command that runs."""


def printable(text: str) -> str:
    """The text with control characters and lone surrogates written as escapes: file contents cannot move a cursor."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape", "surrogatepass").decode() for c in text)


def emit(lines: Iterable[str], stream: TextIO | None = None) -> None:
    """Write lines; on a terminal, long ones are folded between words, further lines a little to the right."""
    stream = stream or sys.stdout
    if stream.isatty():
        width = shutil.get_terminal_size().columns
        lines = [part for line in lines for part in _folded(line, width)]
    put("".join(f"{line}\n" for line in lines), stream)


def _folded(line: str, width: int) -> list[str]:
    indent = " " * (len(line) - len(line.lstrip()))
    if len(_ESCAPES.sub("", line)) <= width:
        return [line]
    return textwrap.wrap(line, width, subsequent_indent=f"{indent}  ", break_long_words=False, break_on_hyphens=False)


def put(text: str, stream: TextIO | None = None) -> None:
    """Write text to standard output or another stream, at once; characters that it cannot show are escaped.

    A reader that has gone (``| head -1``) is no error: the rest is dropped, files are still written and the exit code
    is that of the answer.

    Raises:
        InputError: The stream takes no more, because its disk is full.
    """
    stream = stream or sys.stdout
    encoding = stream.encoding or "utf-8"
    try:
        stream.write(text.encode(encoding, "backslashreplace").decode(encoding))
        stream.flush()
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())  # what is left in the buffer goes nowhere
        if isinstance(error, BrokenPipeError) or stream is sys.stderr:
            return
        why = error.strerror or error
        raise InputError(f"output: expected a place to write to, got: {why}. Send it elsewhere.") from None


@contextmanager
def listening() -> Iterator[None]:
    """Inside, warnings are kept for :func:`warned`."""
    token = _WARNED.set([])
    try:
        yield
    finally:
        _WARNED.reset(token)


def warned() -> tuple[str, ...]:
    """What this command has warned of so far: for programs, which do not read standard error."""
    return tuple(_WARNED.get() or ())


def complain(kind: str, message: str) -> None:
    """``error: message`` or ``warning: message`` on standard error."""
    if kind == "warning" and (kept := _WARNED.get()) is not None:
        kept.append(message)
    colour = {"error": "31", "warning": "33"}[kind]
    label = f"\x1b[{colour}m{kind}:\x1b[0m" if has_colour(sys.stderr) else f"{kind}:"
    emit([f"{label} {printable(message)}"], sys.stderr)


def has_colour(stream: TextIO) -> bool:
    """Whether to colour what goes to this stream: a terminal, and ``NO_COLOR`` unset (no-color.org)."""
    return stream.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def bold(text: str) -> str:
    """Bold on a terminal."""
    return f"\x1b[1m{text}\x1b[0m" if has_colour(sys.stdout) else text


_ESCAPES = re.compile(r"\x1b\[[0-9;]*m")

_ELSEWHERE = 120
"""Columns that a table may take where it does not go to a terminal."""

_FOLDED = 12
"""Columns of text are folded down to this many characters, and not further."""


def table(
    headers: Sequence[str], rows: Iterable[Sequence[str]], *, left: Sequence[int] = (0,), indent: int = 0
) -> list[str]:
    """Lines of a table that fits the terminal (or 120 columns elsewhere); numbers to the right, and never cut.

    Where the numbers do not fit beside each other, each row becomes lines of their own: a name and a value.

    Args:
        headers: Of the columns.
        rows: Cells as text.
        left: Columns with text, which may fold; the others keep their width.
        indent: Of each line, in spaces.
    """
    cells = [[printable(cell) for cell in row] for row in rows]
    wide = [max(len(header), *(len(row[k]) for row in cells), 0) for k, header in enumerate(headers)]
    least = sum(min(w, _FOLDED) if k in left else w for k, w in enumerate(wide)) + 2 * (len(headers) - 1) + indent
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else _ELSEWHERE
    lines = (
        _columns(headers, cells, left, width - indent) if least <= width else _records(headers, cells, width - indent)
    )
    return [" " * indent + line if line else line for line in lines]


def _columns(headers: Sequence[str], cells: Sequence[Sequence[str]], left: Sequence[int], width: int) -> list[str]:
    from rich.console import Console
    from rich.table import Table

    out = Table(box=None, pad_edge=False, header_style="")
    for k, header in enumerate(headers):
        out.add_column(header, justify="left" if k in left else "right", overflow="fold", no_wrap=k not in left)
    for row in cells:
        out.add_row(*map(_plain, row))
    console = Console(width=width, color_system=None, highlight=False, emoji=False, force_terminal=False)
    with console.capture() as captured:
        console.print(out)
    return [line.rstrip() for line in captured.get().splitlines()]


def _records(headers: Sequence[str], cells: Sequence[Sequence[str]], width: int) -> list[str]:
    """Each row as lines of name and value, an empty line between rows."""
    name = min(max(map(len, headers)), width // 3)
    lines = list[str]()
    for row in cells:
        lines.append("")
        for header, cell in zip(headers, row, strict=True):
            pairs = zip_longest(textwrap.wrap(header, name), textwrap.wrap(cell, width - name - 2), fillvalue="")
            lines += [f"{a:<{name}}  {b}".rstrip() for a, b in pairs]
    return lines[1:]


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
