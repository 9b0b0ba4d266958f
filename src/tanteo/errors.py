"""Define the exceptions of tanteo.

The hierarchy::

    TanteoError
    ├── InputError (also a ValueError)     an argument or a file is invalid
    │   ├── CovarianceError                not finite, not symmetric or not positive semidefinite
    │   ├── UnitError                      a unit is missing, unknown or contradictory
    │   ├── ReadingsError                  a readings file, with file, line, column and value
    │   ├── PartError                      a CAD file that does not describe a usable part
    │   └── SideError                      readings of one plane that disagree about its outer side
    ├── DegenerateError                    the geometry does not determine the result (parallel, collinear, too few)
    ├── PluginError                        a plug-in of another distribution cannot be used
    └── MissingExtraError (an ImportError) an optional dependency is not installed

Messages read ``<name>: expected <what>, got <what>. <what to do>.`` If no part or several parts
fit, that is a result with a status, not an error.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterable


class TanteoError(Exception):
    """Base of every exception that tanteo raises on purpose.

    Example:
        >>> issubclass(tanteo.InputError, tanteo.TanteoError)
        True
    """


class InputError(TanteoError, ValueError):
    """An argument or a file is invalid.

    Example:
        >>> try:
        ...     tanteo.read_part("no_such_file.step")
        ... except tanteo.InputError as error:
        ...     print(error)
        no_such_file.step: expected a file, got nothing there. Check the path.
    """


class CovarianceError(InputError):
    """A covariance is not finite, not symmetric or not positive semidefinite."""


class UnitError(InputError):
    """A unit is missing, unknown or contradicts another."""


class ReadingsError(InputError):
    """A readings file is malformed; the message names file, line, column and value."""


class PartError(InputError):
    """A CAD file does not describe a usable part; the message names the file and the reason."""


class SideError(InputError):
    """The readings of a plane do not agree on which side of it is outside."""


class DegenerateError(TanteoError):
    """The geometry leaves the answer undefined: parallel, collinear, coincident or too few."""


class PluginError(TanteoError):
    """A plug-in cannot be used; the message names its distribution, its entry point and the reason."""


class MissingExtraError(TanteoError, ImportError):
    """An optional dependency is not installed; the message gives the pip command."""


def check_kind(name: str, value: object, kinds: type | tuple[type, ...], advice: str) -> None:
    """Check the type of an argument, so that a wrong one is refused by its name and not by a missing attribute.

    Args:
        name: name of the argument.
        value: argument that the caller passed.
        kinds: accepted types; the message names the first.
        advice: last sentence of the message: how to get such a value.

    Raises:
        InputError: the value has another type; the message names it.
    """
    if isinstance(value, kinds):
        return
    kind = kinds[0] if isinstance(kinds, tuple) else kinds
    got = repr(str(value)) if isinstance(value, (str, os.PathLike)) else f"one of type {type(value).__name__}"
    raise InputError(f"{name}: expected {kind.__name__}, got {got}. {advice}")


_BEGINNING = 3
"""Numerical: least number of letters that count as the beginning of a name."""


def did_you_mean(name: str, known: Iterable[str], likeness: float = 0.5) -> str:
    """Return `` Did you mean '...'?`` for the end of a message on an unknown name; empty if no known name is similar.

    Names that begin with the unknown one win over similar ones.

    Args:
        name: unknown name, in any case.
        known: known names.
        likeness: required similarity of the nearest name, from 0 to 1.
    """
    names = list(known)
    near = [other for other in names if other.casefold() == name.casefold()]
    if len(name) >= _BEGINNING:
        near = near or [other for other in names if other.casefold().startswith(name.casefold())][:2]
    near = near or difflib.get_close_matches(name, names, n=1, cutoff=likeness)
    near = near or difflib.get_close_matches(name.lower(), names, n=1, cutoff=likeness)
    return f" Did you mean {' or '.join(repr(one) for one in near)}?" if near else ""


def install_command(*extras: str) -> str:
    """Return the command that installs some extras; tanteo is not on PyPI, so it runs in the folder of its source.

    Args:
        extras: names of the extras.

    Example:
        >>> install_command("step", "vision")
        "python -m pip install -e '.[step,vision]' (in the folder of tanteo's source)"
    """
    return f"python -m pip install -e '.[{','.join(extras)}]' (in the folder of tanteo's source)"
