"""Parts as they are passed: several, one, or by mistake the path of a file."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

from tanteo.errors import InputError
from tanteo.parts.part import Part


def as_parts(name: str, parts: Any) -> tuple[Any, ...]:
    """What was passed as parts, as a tuple: parts, or what rooms above prepare of them (it has a ``part``).

    Args:
        name: of the argument.
        parts: any iterable of them, ``Parts`` of a catalogue too; or one alone.

    Raises:
        InputError: a path, which has to be read first, or something else.
    """
    several = parts if isinstance(parts, Iterable) and not isinstance(parts, (str, bytes, os.PathLike)) else (parts,)
    found = tuple(several)
    for one in found:
        if isinstance(one, Part) or hasattr(one, "part"):
            continue
        if isinstance(one, (str, os.PathLike)):
            how = f"got the path '{os.fspath(one)}'. Read it first: tanteo.read_parts('{os.fspath(one)}')."
        else:
            how = f"got one of type {type(one).__name__}. tanteo.read_parts(path) reads them."
        raise InputError(f"{name}: expected parts, {how}")
    return found


def as_part(name: str, part: Any) -> Any:
    """One part, or what was prepared of it; the only one of several, too.

    Raises:
        InputError: several, or no part at all.
    """
    found = as_parts(name, part)
    if len(found) != 1:
        raise InputError(f"{name}: expected one part, got {len(found)}. tanteo.identify asks which of several it is.")
    return found[0]
