"""Where text goes: answers to standard output, everything else to standard error, colour only on a terminal."""

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
from tanteo.render import PLAIN, Layout, printable

if TYPE_CHECKING:
    from collections.abc import Callable

UNDECIDED = 3
_ESCAPES = re.compile(r"\x1b\[[0-9;]*m")

_WARNED: ContextVar[list[str] | None] = ContextVar("warned", default=None)
"""Warnings of the command that runs."""


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


def say(text: str, stream: TextIO | None = None) -> None:
    """Write a sentence, whatever it quotes."""
    emit([printable(text)], stream)


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


def put_json(document: dict[str, Any]) -> None:
    """A document on standard output."""
    put(json.dumps(_finite(document), indent=2, allow_nan=False) + "\n")


def _finite(value: Any) -> Any:
    """JSON has no NaN and no infinity: a number that is not finite is ``null``."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


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


def layout() -> Layout:
    """That of standard output: as wide as the terminal, or 120 columns elsewhere, and bold where there is colour."""
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else PLAIN.width
    return Layout(width, has_colour(sys.stdout))


def leave(*, decided: bool) -> None:
    """End a command that answers, with code 3 unless the answer is what was asked for."""
    if not decided:
        raise typer.Exit(UNDECIDED)


@contextmanager
def progress(label: str, *, quiet: bool) -> Iterator[Callable[[int, int], None]]:
    """A bar on standard error, to be called with how many are done of how many; silent if that is no terminal."""
    if quiet or not sys.stderr.isatty():
        yield lambda done, total: None
        return
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True, no_color=not has_colour(sys.stderr))
    with Progress(console=console, transient=True) as bar:
        task = bar.add_task(label, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
