"""Convert the typed values of options to SI units, with errors that name the option.

The conversion happens before any file is read. Functions import slow packages only when they are called.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
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
    from tanteo.io.readings import Brand
    from tanteo.posterior import PosePrior, Table


@dataclass(frozen=True, slots=True)
class Words:
    """Annotation of an option with the conversion of its typed value.

    Attributes:
        read: function that converts the typed value; raises InputError.
        typed: type for the parser.
        default: default as it would be typed; None for the default of the parameter.
    """

    read: Callable[[Any], Any]
    typed: Any = str | None
    default: str | None = None


def preset(name: str) -> str:
    """Return the name of a sensor preset, after a check that it exists.

    Args:
        name: name as typed.
    """
    from tanteo.sensors.presets import sensor_preset

    sensor_preset(name)
    return name


def robot(name: str) -> str:
    """Return the name of a robot preset, after a check that it exists.

    Args:
        name: name as typed.
    """
    from tanteo.sensors.presets import robot_preset

    robot_preset(name)
    return name


def policy(name: str) -> str:
    """Return the name of a policy, after a check that it exists.

    Args:
        name: name as typed.

    Raises:
        InputError: there is no such policy.
    """
    from tanteo.planning.policies import policy_named

    try:
        policy_named(name)
    except InputError as error:
        raise InputError(str(error).replace("policy:", "--policy:", 1)) from None
    return name


def unit(name: str) -> str:
    """Return the name of a unit of length.

    Args:
        name: name as typed.
    """
    from tanteo.parts.readers import unit_name

    return unit_name(name)


def length(name: str, example: str, text: str) -> float:
    """Return a positive length [m].

    Args:
        name: name of the option.
        example: correct value, for messages.
        text: value as typed.

    Raises:
        InputError: the length is not positive.
    """
    value = io.readings.parse_length(text, name)
    if not value > 0:
        raise InputError(f"{name}: expected a positive length, got '{text}'. Write it as {example}.")
    return value


def spread(name: str, positive: bool, text: str) -> float:
    """Return the standard deviation of readings or parts [m].

    Args:
        name: name of the option.
        positive: whether zero is refused.
        text: value as typed.

    Raises:
        InputError: the length is outside of the accepted range.
    """
    from tanteo.geometry.limits import LARGEST, LEAST_SD

    value = io.readings.parse_length(text, name)
    if not math.isfinite(value) or value < 0 or (positive and value == 0):
        expected = "a positive length" if positive else "a length of zero or more"
        raise InputError(f"{name}: expected {expected}, got '{text}'. Write it as 0.3mm.")
    if value > LARGEST or (positive and value < LEAST_SD):
        least = f"from {LEAST_SD:g} " if positive else ""
        raise InputError(f"{name}: expected a length {least}up to {LARGEST:g} m, got '{text}'. Check its unit.")
    return value


FORM_SDS = {"machined": 5e-5, "printed": 1.5e-4, "cast": 2.5e-4}
"""Standard deviations of a surface from its CAD by the process [m]: a third of half the general tolerance for 63 to
100 mm. Machined: ISO 2768-1 fine, 0.3 mm; cast: ISO 8062-3 grade 8, 1.6 mm; printed: usual filament printers, 1 mm."""


def form_sd(text: str) -> float:
    """Return the standard deviation of a made surface from its CAD [m].

    Args:
        text: length, or the name of a process in :data:`FORM_SDS`.
    """
    return FORM_SDS[text] if text in FORM_SDS else spread("--form-sd", False, text)


def tip_radius(text: str) -> float:
    """Return the radius of a probe's ball [m], or 0.

    Args:
        text: value as typed.

    Raises:
        InputError: the length is negative, or larger than 1 m.
    """
    value = io.readings.parse_length(text, "--tip-radius")
    if not 0 <= value <= 1:
        raise InputError(f"--tip-radius: expected a length of zero to 1 m, got '{text}'. Write it as 1.5mm.")
    return value


def tool_body(text: str) -> FloatArray:
    """Return stylus, radius and length of a tool ``(3,)`` [m].

    Args:
        text: value as typed.

    Raises:
        InputError: the value is not three positive lengths.
    """
    import numpy as np

    lengths = io.readings.parse_lengths(text, "--tool-body")
    if len(lengths) != 3 or not (np.asarray(lengths) > 0).all():
        raise InputError(
            f"--tool-body: expected stylus, radius and length of the tool, got '{text}'. Write them as 50,30,150mm."
        )
    return np.asarray(lengths)


def angle_sd(name: str, text: str) -> float:
    """Return a standard deviation of an angle [rad].

    Args:
        name: name of the option.
        text: value as typed.

    Raises:
        InputError: the angle is not above 0 and up to 30 degrees.
    """
    value = io.readings.parse_angle(text, name)
    if not 0 < value <= math.pi / 6:
        raise InputError(f"{name}: expected an angle above 0 and up to 30 deg, got '{text}'. Write it as 0.1deg.")
    return value


def tilt(text: str) -> float:
    """Return the largest tilt of a tool [rad].

    Args:
        text: value as typed.

    Raises:
        InputError: the angle is not between 0 and 180 degrees.
    """
    value = io.readings.parse_angle(text, "--tool-tilt")
    if not 0 <= value <= math.pi + 1e-9:
        raise InputError(f"--tool-tilt: expected an angle from 0 to 180 deg, got '{text}'. Write it as 30deg.")
    return value


def approach(text: str) -> tuple[Any, float]:
    """Return a direction in the world ``(3,)`` and the largest angle to it [rad].

    Args:
        text: value as typed.

    Raises:
        InputError: the value is not a direction and an angle.
    """
    import numpy as np

    words = text.replace(" ", "").split(",")
    try:
        values = [float(w.removesuffix("deg")) for w in words]
    except ValueError:
        values = []
    if len(values) != 4 or not words[-1].endswith("deg") or not 0 <= values[3] <= 180 or not any(values[:3]):
        raise InputError(
            f"--approach: expected a direction in the world and the largest angle to it, got '{text}'. Write it as "
            "0,0,-1,60deg."
        )
    return np.array(values[:3]), float(np.radians(values[3]))


def tip(text: str) -> tuple[float, ...]:
    """Return the standard deviations of a tip's offset along x, y, z of the hand [m].

    Args:
        text: value as typed.

    Raises:
        InputError: the value is not three lengths in the accepted range.
    """
    from tanteo.geometry.limits import LARGEST

    values = io.readings.parse_lengths(text, "--tip-sd")
    if len(values) != 3 or min(values) < 0:
        raise InputError(
            f"--tip-sd: expected three lengths of zero or more (x, y, z of the hand), got '{text}'. "
            "Write it as 1.5,1.5,0.3mm."
        )
    if max(values) > LARGEST:
        raise InputError(f"--tip-sd: expected lengths up to {LARGEST:g} m, got '{text}'. Check their unit.")
    return values


def pose_sds(name: str, text: str) -> tuple[float, float]:
    """Return the standard deviations of a position [m] and of a rotation [rad] about each axis.

    Args:
        name: name of the option.
        text: value as typed.

    Raises:
        InputError: the value is not a length and an angle, both positive.
    """
    length, _, angle = text.partition(",")
    if not angle:
        raise InputError(f"{name}: expected a length and an angle, got '{text}'. Write it as 1mm,0.2deg.")
    turn = io.readings.parse_angle(angle, name)
    if not 0 < turn <= math.pi:
        raise InputError(f"{name}: expected an angle above 0 and up to 180 deg, got '{angle}'. Write it as 0.2deg.")
    return spread(name, True, length), turn


def standoff(text: str) -> float:
    """Return the stand-off of a hand's front [m].

    Args:
        text: value as typed.

    Raises:
        InputError: the length is outside of 1 mm to 1 m.
    """
    value = io.readings.parse_length(text, "--standoff")
    if not 1e-3 <= value <= 1:
        raise InputError(f"--standoff: expected a length of 1 mm to 1 m, got '{text}'. Write it as 20mm.")
    return value


def share(name: str, largest: float, word: str, text: str) -> float:
    """Return a fraction from a text such as ``10%`` or ``0.1``.

    Args:
        name: name of the option.
        largest: upper bound, excluded.
        word: upper bound, for messages.
        text: value as typed.

    Raises:
        InputError: the fraction is not between 0 and the upper bound.
    """
    try:
        value = float(text[:-1]) / 100 if text.endswith("%") else float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < largest:
        raise InputError(f"{name}: expected a fraction above 0 and below {word}, got '{text}'. Write it as 5%.")
    return value


def fraction(name: str, what: str, example: str, value: float) -> float:
    """Return a number between 0 and 1.

    Args:
        name: name of the option.
        what: name of the number, for messages.
        example: correct value, for messages.
        value: number as typed.

    Raises:
        InputError: the number is outside of this interval.
    """
    if not 0 < value < 1:
        raise InputError(f"{name}: expected a {what} between 0 and 1, got {value:g}. Use {example}.")
    return value


def at_least(name: str, least: int, advice: str, value: int) -> int:
    """Return a number that is not below a bound.

    Args:
        name: name of the option.
        least: smallest accepted number.
        advice: advice, for messages.
        value: number as typed.

    Raises:
        InputError: the number is smaller.
    """
    if value < least:
        raise InputError(f"{name}: expected {least} or more, got {value}. {advice}.")
    return value


def rests(texts: list[str]) -> list[Table]:
    """Return the planes of ``--rests``.

    Args:
        texts: point, normal and standard deviation of each plane, as typed.

    Raises:
        InputError: a text does not state a plane.
    """
    return [io.poses.parse_table(text, "--rests") for text in texts]


def forbidden(texts: list[str]) -> list[ForbiddenBox]:
    """Return the boxes of ``--forbid``.

    Args:
        texts: corners of each box, as typed.

    Raises:
        InputError: a text does not state two corners.
    """
    import numpy as np

    from tanteo.hand import ForbiddenBox

    boxes = []
    for corners in texts:
        values = io.readings.parse_lengths(corners, "--forbid")
        if len(values) != 6:
            raise InputError(
                f"--forbid: expected two corners of three lengths, got '{corners}'. Write it as 150,0,0,180,60,250mm."
            )
        boxes.append(ForbiddenBox(corners, np.array(values[:3]), np.array(values[3:])))
    return boxes


def pose(text: str) -> Any:
    """Return a pose with its covariance, as an ``UncertainFrame``.

    Args:
        text: value as typed.
    """
    frame = io.poses.parse_pose_prior(text, "--pose-prior")
    _warn_if_unverified("--pose-prior", io.BRANDS.get(text.split(maxsplit=1)[0].rstrip(":")))
    return frame


def _warn_if_unverified(place: str, brand: Brand | None) -> None:
    """Warn about a brand whose angle convention was not verified in its documentation."""
    if brand is not None and not brand.verified:
        complain(
            "warning",
            f"{place}: the angle convention of {brand.name} ({' '.join(brand.fields)}) was not verified in its "
            "documentation. Compare one pose with the answer, or give roll, pitch, yaw.",
        )


def sensor_names(incomplete: str) -> list[str]:
    """Return the names of sensor presets that begin with a text.

    Args:
        incomplete: beginning of the name.
    """
    from tanteo.sensors.presets import sensor_presets

    return [name for name in sensor_presets() if name.startswith(incomplete)]


def robot_names(incomplete: str) -> list[str]:
    """Return the names of robot presets that begin with a text.

    Args:
        incomplete: beginning of the name.
    """
    from tanteo.sensors.presets import robot_presets

    return [name for name in robot_presets() if name.startswith(incomplete)]


def policy_names(incomplete: str) -> list[str]:
    """Return the names of policies that begin with a text.

    Args:
        incomplete: beginning of the name.
    """
    from tanteo.planning import POLICIES

    return [name for name in POLICIES if name.startswith(incomplete)]


def read_known(
    table: Table | None,
    box: FloatArray | None,
    pose_prior: UncertainFrame | None,
    file: str | None,
    rests: Sequence[Table] | None = None,
) -> PosePrior | None:
    """Return the prior knowledge of the pose in options such as ``--table`` and ``--box``, and ``--prior``, together.

    Args:
        table: value of ``--table``; None if not given.
        box: value of ``--box``; None if not given.
        pose_prior: value of ``--pose-prior``; None if not given.
        file: value of ``--prior``; None if not given.
        rests: values of ``--rests``; None if not given.

    Returns:
        Prior knowledge; None if no option is given.

    Raises:
        MisuseError: an option repeats what the file states.
        InputError: the file cannot be read.
    """
    if all(value is None for value in (table, box, pose_prior, file, rests)):
        return None
    given: dict[str, Any] = {"table": table, "box": box, "rests": None if rests is None else tuple(rests)}
    if pose_prior is not None:
        given |= {"T_world_part": pose_prior.T, "covariance": pose_prior.C}
    given = {name: value for name, value in given.items() if value is not None}
    with misuse():
        stated = posterior.PosePrior(**given)
    if file is None:
        return stated
    read = io.read_prior(file)
    _warn_if_unverified(f"{file}, near", io.poses.prior_brand(file))
    options = {"table": "--table", "rests": "--rests", "box": "--box"}
    options |= {"T_world_part": "--pose-prior", "covariance": "--pose-prior"}
    for name in given:
        there = getattr(read, name)
        if there is not None and not (isinstance(there, tuple) and not there):  # no planes
            raise MisuseError(f"{options[name]}: expected it once, got it in {file} too. Keep one.")
    return replace(read, **given)
