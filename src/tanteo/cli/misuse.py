"""Turn errors of the library into errors about the options that caused them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

from tanteo.errors import ReadingsError, TanteoError

_MESSAGES = {
    "sd": "--sd", "tolerance": "--form-sd", "goal": "--goal", "tip_sd": "--tip-sd", "sensor": "--sensor",
    "robot": "--robot", "as_published": "--as-published", "priors, outlier_rate": "--outlier-rate",
    "priors, unknown": "--unknown-prior", "bias_sd": "--bias-sd", "mass": "--mass", "size": "--size",
    "scheduler": "--scheduler", "priors, noise_factor": "--noise-factor", "table, sd": "--table", "rests": "--rests",
    "prior, box": "--box", "prior, T_world_part": "--pose-prior", "prior, covariance": "--pose-prior",
    "feature": "--feature",
}  # fmt: skip
"""Options by the names in messages of the library."""


class MisuseError(TanteoError):
    """The command was called with invalid options (exit code 2)."""


@contextmanager
def misuse(*, always: bool = True) -> Iterator[None]:
    """Turn errors inside the context into errors about options, except errors of the readings.

    Args:
        always: whether to turn every error; otherwise only those whose message begins with the name of an option.

    Raises:
        MisuseError: an option is invalid.
    """
    try:
        yield
    except ReadingsError:
        raise
    except TanteoError as error:
        name, _, rest = str(error).partition(": ")
        if name in _MESSAGES:
            raise MisuseError(f"{_MESSAGES[name]}: {rest}") from None
        if always:
            raise MisuseError(str(error)) from None
        raise


def with_units_option(reason: str) -> str:
    """Return a reason in which the argument ``unit`` of the library is the option ``--units``.

    Examples:
        >>> with_units_option("unit: expected the length unit of a.stl, got none. Pass unit='mm'.")
        '--units: expected the length unit of a.stl, got none. Pass --units mm.'
    """
    return re.sub(r"^unit: ", "--units: ", re.sub(r"unit='(\w+)'", r"--units \1", reason))


def require_image(image: str | None, camera: str | None, marks: str | None) -> None:
    """Check that ``--camera`` and ``--marks`` come with an image.

    Args:
        image: value of ``--image``.
        camera: value of ``--camera``.
        marks: value of ``--marks``.

    Raises:
        MisuseError: there is no image.
    """
    if image is None and (camera is not None or marks is not None):
        raise MisuseError("--camera, --marks: expected with --image, got none. Add --image FILE, or render.")


def require_errors(sensor: str | None, sd: float | None, example: str = "0.3mm") -> None:
    """Check that exactly one of ``--sensor`` and ``--sd`` states the noise of readings.

    Args:
        sensor: value of ``--sensor``.
        sd: value of ``--sd`` [m].
        example: example of a standard deviation, for the message.

    Raises:
        MisuseError: both or neither are given.
    """
    if (sensor is None) == (sd is None):
        got = "neither" if sd is None else "both"
        raise MisuseError(f"--sensor, --sd: expected one of the two, got {got}. Use --sensor NAME, or --sd {example}.")
