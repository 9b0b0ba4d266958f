"""The controllers that a program can be written for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from tanteo.errors import InputError, did_you_mean
from tanteo.programs.abb import abb
from tanteo.programs.fanuc import fanuc
from tanteo.programs.gcode import grbl, linuxcnc
from tanteo.programs.job import Job
from tanteo.programs.kuka import kuka
from tanteo.programs.ur import ur

PROGRAMS: Mapping[str, Callable[[Job], str]] = MappingProxyType(
    {"linuxcnc": linuxcnc, "grbl": grbl, "ur": ur, "fanuc": fanuc, "kuka": kuka, "abb": abb}
)
"""Who writes for which controller."""

AXES_3 = ("linuxcnc", "grbl")
"""Controllers of machines whose stylus always points down."""


def write_program(name: str, job: Job) -> str:
    """The probing program of a job.

    Args:
        name: a key of :data:`PROGRAMS`.
        job: the touches.

    Raises:
        InputError: No such controller; or a 3-axis machine is to touch from below.
    """
    if name not in PROGRAMS:
        raise InputError(f"expected one of {', '.join(PROGRAMS)}, got '{name}'.{did_you_mean(name, PROGRAMS)}")
    upward = [f"touch {t.number} on {t.face}" for t in job.touches if t.direction[2] > 1e-6]
    if name in AXES_3 and upward:
        raise InputError(
            f"--program {name}: expected touches from above or from the side, as the stylus points down, got "
            f"{', '.join(upward)} from below. Say --approach 0,0,-1,90deg."
        )
    return PROGRAMS[name](job)
