"""Calls that are wrong: errors of the library as errors of the option that said it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from tanteo.errors import ReadingsError, TanteoError

_MESSAGES = {
    "sd": "--sd", "tolerance": "--tolerance", "tip_sd": "--tip-sd", "sensor": "--sensor", "robot": "--robot",
    "as_published": "--as-published", "priors, outlier_rate": "--outlier-rate", "priors, unknown": "--unknown-prior",
    "bias_sd": "--bias-sd", "mass": "--mass", "size": "--size", "scheduler": "--scheduler",
    "priors, noise_factor": "--noise-factor", "table, sd": "--table", "prior, box": "--box",
    "prior, T_world_part": "--pose-prior", "prior, covariance": "--pose-prior", "feature": "--feature",
}  # fmt: skip
"""Names in messages of what an option says, and the option."""


class MisuseError(TanteoError):
    """The command was called wrongly: exit code 2."""


@contextmanager
def misuse(*, always: bool = True) -> Iterator[None]:
    """Errors inside are the caller's options.

    Args:
        always: Unless they are the readings'; else only those whose message begins with an option.
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


def require_image(image: str | None, camera: str | None, marks: str | None) -> None:
    """A camera is of no use without an image: raises MisuseError."""
    if image is None and (camera is not None or marks is not None):
        raise MisuseError("--camera, --marks: expected with --image, got none. Add --image FILE, or render.")


def require_errors(sensor: str | None, sd: float | None, example: str = "0.3mm") -> None:
    """Readings have errors, said once: raises MisuseError."""
    if (sensor is None) == (sd is None):
        got = "neither" if sd is None else "both"
        raise MisuseError(f"--sensor, --sd: expected one of the two, got {got}. Say --sensor NAME, or --sd {example}.")
