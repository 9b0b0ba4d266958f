"""Convert the options of shared errors (``--bias-sd``, ``--scale-sd``, ...) to error states."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from tanteo import io
from tanteo.cli import typed
from tanteo.cli.misuse import MisuseError

if TYPE_CHECKING:
    from tanteo.sensors.error_states import ErrorState

Errors = tuple["ErrorState", ...]

_BIAS_NAMES = "common, axes such as xy or z, backlash, lobes, or group"


def bias(text: str) -> Errors:
    """Return the offsets of ``--bias-sd``: one length, or lengths by name.

    Args:
        text: value as typed, such as ``0.05mm`` or ``xy=0.02mm,z=0.01mm``.

    Raises:
        MisuseError: a name is unknown or repeated.
        InputError: a length is outside of the accepted range.
    """
    from tanteo.sensors import error_states as e

    def named(name: str, sd: float) -> ErrorState:
        if name and set(name) <= set("xyz") and len(set(name)) == len(name):
            return e.OffsetByAxes(sd, name)
        classes: dict[str, Callable[[float], ErrorState]] = {
            "": e.Offset, "common": lambda sd: e.Offset(sd, common=True), "backlash": e.Backlash, "lobes": e.Lobes,
            "group": e.OffsetByGroup,
        }  # fmt: skip
        if name not in classes:
            raise MisuseError(f"--bias-sd: expected {_BIAS_NAMES}, got '{name}'. Write it as xy=0.02mm,z=0.01mm.")
        return classes[name](sd)

    return _by_name("--bias-sd", text, named)


def drift(text: str) -> Errors:
    """Return the drift of ``--drift-sd``: of the world, or of the trigger point (``trigger=LENGTH``).

    Args:
        text: value as typed.

    Raises:
        MisuseError: a name is unknown or repeated.
        InputError: a length is outside of the accepted range.
    """
    from tanteo.sensors import error_states as e

    classes: dict[str, Callable[[float], ErrorState]] = {"": e.Drift, "trigger": e.TriggerDrift}
    return _by_name("--drift-sd", text, lambda name, sd: _chosen("--drift-sd", classes, name)(sd))


def stock(text: str) -> Errors:
    """Return the stock of ``--stock``: by face, or the same on all faces (``uniform=LENGTH``).

    Args:
        text: value as typed.

    Raises:
        MisuseError: a name is unknown or repeated.
        InputError: a length is outside of the accepted range.
    """
    from tanteo.sensors.error_states import Stock

    classes: dict[str, Callable[[float], ErrorState]] = {"": Stock, "uniform": lambda sd: Stock(sd, uniform=True)}
    return _by_name("--stock", text, lambda name, sd: _chosen("--stock", classes, name)(sd))


def scale(text: str) -> Errors:
    """Return the scale error of ``--scale-sd``.

    Args:
        text: value as typed, such as ``1e-4``, ``0.01%`` or ``100ppm``.

    Raises:
        MisuseError: the value is not a fraction up to a tenth.
    """
    from tanteo.sensors.error_states import Scale

    number, factor = text.strip(), 1.0
    for unit, size in (("ppm", 1e-6), ("%", 1e-2)):
        if number.endswith(unit):
            number, factor = number[: -len(unit)], size
    try:
        sd = float(number) * factor
    except ValueError:
        sd = float("nan")
    if not 0 < sd <= 0.1:
        raise MisuseError(f"--scale-sd: expected a fraction above 0 and up to 0.1, got '{text}'. Write it as 100ppm.")
    return (Scale(sd),)


def warp(text: str) -> Errors:
    """Return the smooth form error of ``--warp-sd``.

    Args:
        text: value as typed.
    """
    from tanteo.sensors.error_states import Form

    return (Form(typed.spread("--warp-sd", True, text)),)


def fan(text: str) -> Errors:
    """Return the error of the beams' angles of ``--fan-sd``.

    Args:
        text: value as typed, such as ``0.3deg``.

    Raises:
        MisuseError: the angle is not between 0 and 30 degrees.
    """
    from tanteo.sensors.error_states import Fan

    sd = io.readings.parse_angle(text, "--fan-sd")
    if not 0 < sd <= 0.53:
        raise MisuseError(f"--fan-sd: expected an angle above 0 and up to 30deg, got '{text}'. Write it as 0.3deg.")
    return (Fan(sd),)


def _chosen(option: str, classes: dict[str, Callable[[float], ErrorState]], name: str) -> Callable[[float], ErrorState]:
    """Return the class of a name."""
    if name not in classes:
        known = ", ".join(f"{one}=LENGTH" if one else "LENGTH" for one in classes)
        raise MisuseError(f"{option}: expected {known}, got '{name}='. Correct the name.")
    return classes[name]


def _by_name(option: str, text: str, state: Callable[[str, float], ErrorState]) -> Errors:
    """Return the errors of a length, or of lengths by name separated by commas."""
    found: dict[str, ErrorState] = {}
    for item in text.split(","):
        name, equals, length = item.rpartition("=")
        name = name.strip().lower()
        if name in found or bool(equals) != bool(name):
            raise MisuseError(f"{option}: expected one length a name, got '{text}'. Write it as 0.05mm or NAME=0.05mm.")
        found[name] = state(name, typed.spread(option, True, length))
    return tuple(found.values())
