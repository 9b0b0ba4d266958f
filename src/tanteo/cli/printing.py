"""Print text: answers to standard output, everything else to standard error, with colour only on a terminal."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import sys
import textwrap
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, TextIO

import typer

from tanteo.errors import InputError
from tanteo.render.text import PLAIN, Layout, printable

if TYPE_CHECKING:
    from collections.abc import Callable

UNDECIDED = 3
_ESCAPES = re.compile(r"\x1b\[[0-9;]*m")

_WARNED: ContextVar[list[str] | None] = ContextVar("warned", default=None)
"""Warnings of the running command."""


def emit(lines: Iterable[str], stream: TextIO | None = None) -> None:
    """Write lines; on a terminal, fold long lines between words with an indent.

    Args:
        lines: lines to write.
        stream: stream to write to; None for standard output.
    """
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


def print_text(text: str, stream: TextIO | None = None) -> None:
    """Write a sentence, with unprintable characters escaped.

    Args:
        text: sentence to write.
        stream: stream to write to; None for standard output.
    """
    emit([printable(text)], stream)


def put(text: str, stream: TextIO | None = None) -> None:
    """Write text to a stream immediately; characters that the stream cannot encode are escaped.

    A closed pipe (``| head -1``) is no error: the rest is discarded, files are still written, and the exit code is that
    of the answer.

    Args:
        text: text to write.
        stream: stream to write to; None for standard output.

    Raises:
        InputError: the stream cannot be written, for example because the disk is full.
    """
    stream = stream or sys.stdout
    encoding = stream.encoding or "utf-8"
    try:
        stream.write(text.encode(encoding, "backslashreplace").decode(encoding))
        stream.flush()
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())  # discards the rest of the buffer
        if isinstance(error, BrokenPipeError) or stream is sys.stderr:
            return
        why = error.strerror or error
        raise InputError(f"output: expected a place to write to, got: {why}. Send it elsewhere.") from None


def put_json(document: dict[str, Any]) -> None:
    """Write a JSON document to standard output.

    Args:
        document: document to write; numbers that are not finite become null.
    """
    put(json.dumps(_finite(document), indent=2, allow_nan=False) + "\n")


def _finite(value: Any) -> Any:
    """Return a value with None for numbers that are not finite, which JSON does not have."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@contextmanager
def listening() -> Iterator[None]:
    """Collect the warnings inside the context for :func:`warned`."""
    token = _WARNED.set([])
    try:
        yield
    finally:
        _WARNED.reset(token)


def warned() -> tuple[str, ...]:
    """Return the warnings of this command so far, for JSON documents."""
    return tuple(_WARNED.get() or ())


def complain(kind: str, message: str) -> None:
    """Print ``error: message`` or ``warning: message`` to standard error.

    Args:
        kind: ``error`` or ``warning``.
        message: text of the message.
    """
    if kind == "warning" and (kept := _WARNED.get()) is not None:
        kept.append(message)
    colour = {"error": "31", "warning": "33"}[kind]
    label = f"\x1b[{colour}m{kind}:\x1b[0m" if has_colour(sys.stderr) else f"{kind}:"
    emit([f"{label} {printable(message)}"], sys.stderr)


def has_colour(stream: TextIO) -> bool:
    """Return whether to use colour on a stream: it is a terminal, and ``NO_COLOR`` is unset (no-color.org).

    Args:
        stream: stream of the output.
    """
    return stream.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def layout() -> Layout:
    """Return the layout of standard output: as wide as the terminal, else 120 columns; bold if colour is possible."""
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else PLAIN.width
    return Layout(width, has_colour(sys.stdout))


def leave(*, decided: bool) -> None:
    """End a command with exit code 3 unless its answer is decided.

    Args:
        decided: whether the command found the requested answer.

    Raises:
        Exit: the answer is not decided.
    """
    if not decided:
        raise typer.Exit(UNDECIDED)


@contextmanager
def progress(label: str, *, quiet: bool) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar on standard error if that is a terminal.

    Args:
        label: text beside the bar.
        quiet: whether to show no bar.

    Yields:
        A function that receives the number of finished items and their total.
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
