"""Controllers for which a probing program can be written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from tanteo.errors import InputError, PluginError, did_you_mean
from tanteo.machines.programs.abb import abb
from tanteo.machines.programs.fanuc import fanuc
from tanteo.machines.programs.gcode import grbl, linuxcnc
from tanteo.machines.programs.job import Job
from tanteo.machines.programs.kuka import kuka
from tanteo.machines.programs.ur import ur
from tanteo.plugins import Registry, guarded


@dataclass(frozen=True, slots=True)
class ProgramLanguage:
    """Language of a controller.

    Attributes:
        write: function that returns the program of a job as text.
        points_down: whether the stylus always points down, as on a 3-axis machine. Otherwise the program turns it
            along each touch.
        logs_hand: whether the log has the pose of the tool with each touch.
        goes_on: whether the program continues after a touch without contact.
    """

    write: Callable[[Job], str]
    points_down: bool = False
    logs_hand: bool = False
    goes_on: bool = False


PROGRAMS: Registry[ProgramLanguage] = Registry(
    "tanteo.programs",
    ProgramLanguage,
    {
        "linuxcnc": ProgramLanguage(linuxcnc, points_down=True),
        "grbl": ProgramLanguage(grbl, points_down=True),
        "ur": ProgramLanguage(ur, logs_hand=True, goes_on=True),
        "fanuc": ProgramLanguage(fanuc),
        "kuka": ProgramLanguage(kuka),
        "abb": ProgramLanguage(abb, logs_hand=True),
    },
)
"""Languages by the name of the controller."""


def program_language(name: str) -> ProgramLanguage:
    """Return the language of a controller.

    Args:
        name: name of the controller, as in :data:`PROGRAMS`.

    Raises:
        InputError: There is no controller of that name; the message lists all.
        PluginError: The plug-in of that name cannot be used.
    """
    found = PROGRAMS.find(name)
    if found is None:
        known = PROGRAMS.names()
        advice = did_you_mean(name, known) or f" A file is written by '--program {known[0]} > FILE'."
        raise InputError(f"--program: expected one of {', '.join(known)}, got '{name}'.{advice}")
    return found


def write_program(name: str, job: Job) -> str:
    """Write the probing program of a job.

    Args:
        name: name of the controller, as in :data:`PROGRAMS`.
        job: touches of the program.

    Returns:
        The program as text.

    Raises:
        InputError: There is no such controller, or a stylus that points down would have to touch from below.
        PluginError: A plug-in fails or does not return text.
    """
    language = program_language(name)
    upward = [f"touch {t.number} on {t.face}" for t in job.touches if t.direction[2] > 1e-6]
    if language.points_down and upward:
        raise InputError(
            f"--program {name}: expected touches from above or from the side, as the stylus points down, got "
            f"{', '.join(upward)} from below. Use --approach 0,0,-1,90deg."
        )
    origin = PROGRAMS.origin(name)
    with guarded(origin, "a program to be written"):
        text = language.write(job)
    if origin and not isinstance(text, str):
        raise PluginError(f"{origin}: expected a program as text, got {type(text).__name__}. Repair it.")
    return text
