"""Packages whose names are imported when they are first used, so that a command loads what it needs and no more."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazy(package: str, names: Mapping[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """``__getattr__`` and ``__dir__`` of a package that imports its names on first use.

    Args:
        package: the package's ``__name__``.
        names: of each module, relative to the package, the names that it has, separated by blanks. None may be the
            name of a module of the package: importing that one would hide it.
    """
    home = {name: f"{package}.{module}" for module, row in names.items() for name in row.split()}

    def of_package(name: str) -> Any:
        if name not in home:
            raise AttributeError(f"module {package!r} has no attribute {name!r}; it has {', '.join(sorted(home))}")
        value = getattr(import_module(home[name]), name)
        setattr(sys.modules[package], name, value)
        return value

    def names_of_package() -> list[str]:
        return sorted({*vars(sys.modules[package]), *home})

    return of_package, names_of_package
