"""What is typed behind options, read: SI units inside, and an error that names the option.

It is read before any file is touched. What of it needs a room that is slow to import loads that when it is asked.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from tanteo import io, posterior
from tanteo.cli.misuse import MisuseError, misuse
from tanteo.cli.printing import complain
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.geometry import UncertainFrame
    from tanteo.geometry.typing import FloatArray
    from tanteo.hand import ForbiddenBox
    from tanteo.io import Brand
    from tanteo.posterior import PosePrior, Table


@dataclass(frozen=True, slots=True)
class Words:
    """Beside an option: its value is read from what is typed, unless nothing is.

    Attributes:
        read: From what is typed to the value; raises InputError.
        typed: What the parser takes.
        default: As it would be typed.
    """

    read: Callable[[Any], Any]
    typed: Any = str | None
    default: str | None = None


def preset(name: str) -> str:
    """The name of a preset of a sensor that there is."""
    from tanteo.sensors import sensor_preset

    sensor_preset(name)
    return name


def robot(name: str) -> str:
    """The name of a preset of a robot that there is."""
    from tanteo.sensors import robot_preset

    robot_preset(name)
    return name


def policy(name: str) -> str:
    """The name of a policy that there is."""
    from tanteo.planning import policy_named

    try:
        policy_named(name)
    except InputError as error:
        raise InputError(str(error).replace("policy:", "--policy:", 1)) from None
    return name


def unit(name: str) -> str:
    """A unit of length."""
    from tanteo.parts import unit_name

    return unit_name(name)


def length(name: str, example: str, text: str) -> float:
    """A positive length [m]."""
    value = io.parse_length(text, name)
    if not value > 0:
        raise InputError(f"{name}: expected a positive length, got '{text}'. Write it as {example}.")
    return value


def spread(name: str, positive: bool, text: str) -> float:
    """A standard deviation that readings or parts can have [m]."""
    from tanteo.geometry.limits import LARGEST, LEAST_SD

    value = io.parse_length(text, name)
    if not math.isfinite(value) or value < 0 or (positive and value == 0):
        expected = "a positive length" if positive else "a length of zero or more"
        raise InputError(f"{name}: expected {expected}, got '{text}'. Write it as 0.3mm.")
    if value > LARGEST or (positive and value < LEAST_SD):
        least = f"from {LEAST_SD:g} " if positive else ""
        raise InputError(f"{name}: expected a length {least}up to {LARGEST:g} m, got '{text}'. Check its unit.")
    return value


def tip(text: str) -> tuple[float, ...]:
    """Standard deviations of a tip along x, y, z of the hand [m]."""
    from tanteo.geometry.limits import LARGEST

    values = io.parse_lengths(text, "--tip-sd")
    if len(values) != 3 or min(values) < 0 or max(values) == 0:
        raise InputError(
            f"--tip-sd: expected three lengths of zero or more (x, y, z of the hand), got '{text}'. "
            "Write it as 1.5,1.5,0.3mm."
        )
    if max(values) > LARGEST:
        raise InputError(f"--tip-sd: expected lengths up to {LARGEST:g} m, got '{text}'. Check their unit.")
    return values


def standoff(text: str) -> float:
    """A stand-off of a hand's front [m]."""
    value = io.parse_length(text, "--standoff")
    if not 1e-3 <= value <= 1:
        raise InputError(f"--standoff: expected a length of 1 mm to 1 m, got '{text}'. Write it as 20mm.")
    return value


def share(name: str, largest: float, word: str, text: str) -> float:
    """A share between 0 and the largest that it may be, which has that name, as ``10%`` or ``0.1``."""
    try:
        value = float(text[:-1]) / 100 if text.endswith("%") else float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < largest:
        raise InputError(f"{name}: expected a share above 0 and below {word}, got '{text}'. Write it as 5%.")
    return value


def fraction(name: str, what: str, example: str, value: float) -> float:
    """A number between 0 and 1."""
    if not 0 < value < 1:
        raise InputError(f"{name}: expected a {what} between 0 and 1, got {value:g}. Use {example}.")
    return value


def at_least(name: str, least: int, advice: str, value: int) -> int:
    """A number that is not less."""
    if value < least:
        raise InputError(f"{name}: expected {least} or more, got {value}. {advice}.")
    return value


def forbidden(texts: list[str]) -> list[ForbiddenBox]:
    """Boxes of ``--forbid``."""
    import numpy as np

    from tanteo.hand import ForbiddenBox

    boxes = []
    for corners in texts:
        values = io.parse_lengths(corners, "--forbid")
        if len(values) != 6:
            raise InputError(
                f"--forbid: expected two corners of three lengths, got '{corners}'. Write it as 150,0,0,180,60,250mm."
            )
        boxes.append(ForbiddenBox(corners, np.array(values[:3]), np.array(values[3:])))
    return boxes


def pose(text: str) -> Any:
    """A pose with its spread, an ``UncertainFrame``."""
    frame = io.parse_pose_prior(text, "--pose-prior")
    _warn_if_unverified("--pose-prior", io.BRANDS.get(text.split(maxsplit=1)[0].rstrip(":")))
    return frame


def _warn_if_unverified(place: str, brand: Brand | None) -> None:
    """Warn of a brand whose convention nobody has read in its documentation."""
    if brand is not None and not brand.verified:
        complain(
            "warning",
            f"{place}: the angle convention of {brand.name} ({' '.join(brand.fields)}) was not checked against its "
            "documentation. Compare one pose with the answer, or give roll, pitch, yaw.",
        )


def sensor_names(incomplete: str) -> list[str]:
    """Presets of sensors that begin so."""
    from tanteo.sensors import sensor_presets

    return [name for name in sensor_presets() if name.startswith(incomplete)]


def robot_names(incomplete: str) -> list[str]:
    """Presets of robots that begin so."""
    from tanteo.sensors import robot_presets

    return [name for name in robot_presets() if name.startswith(incomplete)]


def policy_names(incomplete: str) -> list[str]:
    """Policies that begin so."""
    from tanteo.planning import POLICIES

    return [name for name in POLICIES if name.startswith(incomplete)]


def read_known(
    table: Table | None, box: FloatArray | None, pose_prior: UncertainFrame | None, file: str | None
) -> PosePrior | None:
    """What ``--table``, ``--box``, ``--pose-prior`` and ``--prior`` say together; None if none is given.

    Raises:
        MisuseError: An option says again what the file says.
        InputError: The file cannot be read.
    """
    if all(value is None for value in (table, box, pose_prior, file)):
        return None
    given: dict[str, Any] = {"table": table, "box": box}
    if pose_prior is not None:
        given |= {"T_world_part": pose_prior.T, "covariance": pose_prior.C}
    given = {name: value for name, value in given.items() if value is not None}
    with misuse():
        said = posterior.PosePrior(**given)
    if file is None:
        return said
    read = io.read_prior(file)
    _warn_if_unverified(f"{file}, near", io.prior_brand(file))
    options = {"table": "--table", "box": "--box", "T_world_part": "--pose-prior", "covariance": "--pose-prior"}
    for name in given:
        if getattr(read, name) is not None:
            raise MisuseError(f"{options[name]}: expected it once, got it in {file} too. Keep one.")
    return replace(read, **given)
