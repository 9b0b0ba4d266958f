"""Read files of measurements as factors of the pose, with readers from plug-ins."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from pathlib import Path
from typing import Any, TypeAlias

from tanteo.errors import InputError, PluginError, did_you_mean
from tanteo.factors import PoseFactor, PythonFactor
from tanteo.plugins import Registry, guarded

FactorReader: TypeAlias = Callable[[Path], PoseFactor]
"""Function that reads a file of measurements as a factor."""

FACTORS: Registry[FactorReader] = Registry("tanteo.factors", Callable, {})
"""Factor readers by name; tanteo itself provides none."""


def read_factor(name: str, path: str | Path) -> PoseFactor:
    """Read a file of measurements as a factor, with the reader that a plug-in adds.

    Args:
        name: name of the entry point of the group ``tanteo.factors``.
        path: file, which the reader opens.

    Returns:
        Factor of the pose; errors in its functions name the plug-in.

    Raises:
        InputError: no plug-in has that name.
        PluginError: the plug-in fails, or does not return a factor.
    """
    reader = FACTORS.find(name.lower())
    if reader is None:
        known = FACTORS.names()
        listed = f"one of {', '.join(known)}" if known else "a plug-in that reads factors to be installed"
        raise InputError(f"--factor: expected {listed}, got '{name}'.{did_you_mean(name, known)}")
    origin = FACTORS.origin(name.lower())
    with guarded(origin, f"{path} to be read"):
        factor = reader(Path(path))
    if not isinstance(factor, PoseFactor):
        got = f"got {type(factor).__name__}. Return a tanteo.PythonFactor"
        raise PluginError(f"{origin or name}: expected a PoseFactor of {path}, {got}.")
    return _guarded_factor(factor, origin) if isinstance(factor, PythonFactor) and origin else factor


def _guarded_factor(factor: PythonFactor, origin: str) -> PythonFactor:
    """Return the factor with functions whose exceptions name the plug-in."""

    def guard(function: Any) -> Any:
        if function is None:
            return None

        @wraps(function)
        def call(*args: Any) -> Any:
            with guarded(origin, f"the factor '{factor.name}' to be evaluated"):
                return function(*args)

        return call

    return replace(
        factor,
        log_density=guard(factor.log_density),
        gradient=guard(factor.gradient),
        propose=guard(factor.propose),
    )
