"""What the options say, checked and in SI units before any file is touched."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

from tanteo.errors import InputError, ReadingsError, TanteoError

TYPED: ContextVar[tuple[str, ...]] = ContextVar("TYPED", default=("tanteo",))
"""The words of the command that runs, as they were typed: a report says how to run it again."""

_TYPED_AS = {
    "sd": "--sd", "tolerance": "--tolerance", "tip_sd": "--tip-sd", "sensor": "--sensor", "robot": "--robot",
    "as_published": "--as-published", "priors, outlier_rate": "--outlier-rate", "priors, unknown": "--unknown-prior",
    "table, sd": "--table", "prior, box": "--box",
    "prior, T_world_part": "--pose-prior", "prior, covariance": "--pose-prior", "feature": "--feature",
}  # fmt: skip
"""Names in messages of what an option says, and the option."""

_MANY = ("--parts", "--discriminate")
_READINGS_SUFFIXES = (".csv", ".txt", ".json", ".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")


class MisuseError(TanteoError):
    """The command was called wrongly: exit code 2."""


@contextmanager
def misuse() -> Iterator[None]:
    """Errors inside are the caller's options, unless they are the readings'."""
    try:
        yield
    except ReadingsError:
        raise
    except TanteoError as error:
        raise MisuseError(_as_typed(error) or str(error)) from None


@contextmanager
def misuse_of_options() -> Iterator[None]:
    """Errors inside are the caller's options if their message begins with one; others stay what they are."""
    try:
        yield
    except InputError as error:
        if typed := _as_typed(error):
            raise MisuseError(typed) from None
        raise


def _as_typed(error: TanteoError) -> str:
    """The message with the option in place of the argument that it begins with; empty if that is of no option."""
    name, _, rest = str(error).partition(": ")
    return f"{_TYPED_AS[name]}: {rest}" if name in _TYPED_AS else ""


@dataclass(frozen=True, slots=True)
class RunOptions:
    """Options of ``identify`` and ``locate``, lengths in metres.

    Attributes:
        units: Of part files that carry none.
        sensor: Name of a sensor preset.
        robot: Name of a robot preset.
        sd: One standard deviation of readings without their own.
        tolerance: Standard deviation of the made part against its CAD.
        tip_sd: Of the tip's offset in the hand's frame.
        outlier_rate: Share of readings expected to be off the part; None for the usual.
        unknown_prior: Probability beforehand that it is none of the parts; None for the usual.
        significance: Share of true hypotheses that the tests may lose.
        top: How many hypotheses to report.
        as_published: Use the paper's equations as printed.
        seed: Of the search.
    """

    units: str | None
    sensor: str | None
    robot: str | None
    sd: float | None
    tolerance: float
    tip_sd: tuple[float, ...] | None
    outlier_rate: float | None
    unknown_prior: float | None
    significance: float
    top: int
    as_published: bool
    seed: int


def read_options(
    *,
    units: str | None,
    sensor: str | None,
    robot: str | None,
    sd: str | None,
    tolerance: str,
    tip_sd: str | None,
    outlier_rate: str | None,
    unknown_prior: str | None,
    significance: float,
    top: int,
    as_published: bool,
    seed: int,
) -> RunOptions:
    """The options from what was typed.

    Raises:
        InputError: The first one that cannot be meant, named as on the command line.
    """
    from tanteo.io import parse_length, parse_lengths
    from tanteo.sensors import robot_preset, sensor_preset

    if sensor is not None:
        sensor_preset(sensor)
    if robot is not None:
        robot_preset(robot)
    if not 0 < significance < 1:
        raise InputError(f"--significance: expected a number between 0 and 1, got {significance:g}. Use 0.01.")
    read_top(top)
    if seed < 0:
        raise InputError(f"--seed: expected 0 or more, got {seed}. Use 0.")
    return RunOptions(
        units=None if units is None else read_unit(units),
        sensor=sensor,
        robot=robot,
        sd=None if sd is None else _require("--sd", parse_length(sd, "--sd"), sd, positive=True),
        tolerance=_require("--tolerance", parse_length(tolerance, "--tolerance"), tolerance, positive=False),
        tip_sd=None if tip_sd is None else _three("--tip-sd", parse_lengths(tip_sd, "--tip-sd"), tip_sd),
        outlier_rate=read_outlier_rate(outlier_rate),
        unknown_prior=read_unknown_prior(unknown_prior),
        significance=significance,
        top=top,
        as_published=as_published,
        seed=seed,
    )


def read_outlier_rate(text: str | None) -> float | None:
    """The share of ``--outlier-rate``; None if it was not typed."""
    return None if text is None else _share("--outlier-rate", text, 0.5, "one half")


def read_unknown_prior(text: str | None) -> float | None:
    """The probability of ``--unknown-prior``; None if it was not typed."""
    return None if text is None else _share("--unknown-prior", text, 1.0, "one")


def _share(name: str, text: str, max_measurements: float, word: str) -> float:
    """A share between 0 and the most that it may be, which has that name, as ``10%`` or ``0.1``."""
    try:
        value = float(text[:-1]) / 100 if text.endswith("%") else float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < max_measurements:
        raise InputError(f"{name}: expected a share above 0 and below {word}, got '{text}'. Write it as 5%.")
    return value


def read_top(top: int) -> int:
    """The number of ``--top``.

    Raises:
        InputError: Less than one.
    """
    if top < 1:
        raise InputError(f"--top: expected 1 or more, got {top}. Use 5.")
    return top


def read_unit(units: str) -> str:
    """The unit of ``--units``.

    Raises:
        UnitError: Not a unit that part files can have.
    """
    from tanteo.parts import unit_name

    return unit_name(units)


def spread_values(argv: Sequence[str]) -> list[str]:
    """``--parts A B C`` as ``--parts A --parts B --parts C``, which is what the parser understands.

    The values end at the next option, or at a readings file (``.csv``), a record (``.json``) or an image, which is
    never a part: so these may come after the parts, too.
    """
    out: list[str] = []
    many = ""
    for k, word in enumerate(argv):
        if word == "--":
            return out + list(argv[k:])
        fresh = bool(out) and out[-1] in _MANY
        if word.startswith("-") and len(word) > 1:
            many = word if word in _MANY else ""
        elif many and not fresh:
            if word.lower().endswith(_READINGS_SUFFIXES):
                many = ""
            else:
                out.append(many)
        out.append(word)
    return out


def _require(name: str, value: float, text: str, *, positive: bool) -> float:
    if not math.isfinite(value) or value < 0 or (positive and value == 0):
        expected = "a positive length" if positive else "a length of zero or more"
        raise InputError(f"{name}: expected {expected}, got '{text}'. Write it as 0.3mm.")
    from tanteo.limits import LARGEST, LEAST_SD

    if value > LARGEST or (positive and value < LEAST_SD):
        least = f"from {LEAST_SD:g} " if positive else ""
        raise InputError(f"{name}: expected a length {least}up to {LARGEST:g} m, got '{text}'. Check its unit.")
    return value


def _three(name: str, values: tuple[float, ...], text: str) -> tuple[float, ...]:
    if len(values) != 3 or min(values) < 0 or max(values) == 0:
        raise InputError(
            f"{name}: expected three lengths of zero or more (x, y, z of the hand), got '{text}'. "
            "Write it as 1.5,1.5,0.3mm."
        )
    from tanteo.limits import LARGEST

    if max(values) > LARGEST:
        raise InputError(f"{name}: expected lengths up to {LARGEST:g} m, got '{text}'. Check their unit.")
    return values
