"""Implement ``--program`` of ``tanteo plan``: the touches of a plan as a program for a machine or a robot."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from tanteo import io
from tanteo.cli import arguments as args
from tanteo.cli import typed
from tanteo.cli.misuse import MisuseError, misuse
from tanteo.cli.printing import complain, print_text
from tanteo.defaults import TIP_SD
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.geometry.typing import Covariances
    from tanteo.parts import Part
    from tanteo.planning import Plan, Probe

_FEED = 0.1 / 60
"""Default speed of guarded motions [m/s]."""

_DOWN = (0.0, 0.0, -1.0)
"""Direction of the stylus of a 3-axis machine."""


def _program(name: str) -> str:
    from tanteo.machines.programs import program_language

    program_language(name)
    return name


def parse_speed(text: str, option: str = "--feed") -> float:
    """Return a speed [m/s] from a text such as ``100mm/min`` or ``2mm/s``.

    Args:
        text: number, unit of length and unit of time.
        option: name of the option, for messages.

    Raises:
        InputError: the text is not a speed.
    """
    length, _, time = text.replace(" ", "").partition("/")
    if time not in ("min", "s"):
        raise InputError(f"{option}: expected a speed, got '{text}'. Write it as 100mm/min or 2mm/s.")
    return typed.length(option, "100mm/min", length) / (60.0 if time == "min" else 1.0)


def _height(text: str) -> float:
    return io.readings.parse_length(text, "--retract-height")


_option = partial(args.option, rich_help_panel="Probing program")


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramOptions:
    """Options of the probing program of a plan, and of the probe's ball."""

    program: Annotated[
        str | None,
        _option(
            "--program",
            "CONTROLLER",
            "Print the probing program: linuxcnc, grbl, ur, fanuc, kuka, abb or a plug-in.",
        ),
        typed.Words(_program),
    ] = None
    tip_radius: args.TipRadius = None
    feed: Annotated[
        float | None,
        _option("--feed", "SPEED", "Speed of a touch, as 2mm/s; 100mm/min if not given."),
        typed.Words(parse_speed),
    ] = None
    overtravel: Annotated[
        float | None,
        _option(
            "--overtravel",
            "LENGTH",
            "Search distance beyond the expected contact; 3 sd of the contact if not given.",
        ),
        typed.Words(partial(typed.length, "--overtravel", "5mm")),
    ] = None
    retract_height: Annotated[
        float | None,
        _option(
            "--retract-height",
            "Z",
            "Height (world z) of the ball between touches, as 150mm; the lowest safe height if not given.",
        ),
        typed.Words(_height),
    ] = None

    def __post_init__(self) -> None:
        if self.program is not None and self.tip_radius is None:
            raise MisuseError("--tip-radius: expected the ball radius of the probe, got none. Add --tip-radius 1.5mm.")
        for name in ("feed", "overtravel", "retract_height"):
            if getattr(self, name) is not None and self.program is None:
                option = f"--{name.replace('_', '-')}"
                raise MisuseError(f"{option}: expected with --program, got none. Add --program linuxcnc, or another.")

    def of_probe(self, *, beam: bool, turned: bool = True) -> dict[str, Any]:
        """Return the properties of the probe that these options state.

        Args:
            beam: whether the named sensor measures with a beam.
            turned: whether a robot may turn the tool from upright.

        Raises:
            MisuseError: a tip radius is given for a beam.
        """
        if self.tip_radius is None:
            return {}
        if beam:
            raise MisuseError("--tip-radius: expected a touch probe, got a sensor with a beam. Use --sd instead.")
        stated: dict[str, Any] = {"contact": True, "radius": self.tip_radius}
        if self.program is None:
            return stated
        from tanteo.machines.programs import program_language

        down = program_language(self.program).points_down or not turned
        stylus = {"stylus": [-v for v in _DOWN]} if down else {"stylus_along_motion": True}
        return stated | stylus

    def tip_sd(self, stated: tuple[float, ...] | None) -> tuple[tuple[float, ...], bool]:
        """Return the standard deviations of the tip's offset [m], and whether they are those that ``locate`` assumes.

        Args:
            stated: standard deviations that the user states; None without a statement.
        """
        if stated is not None or self.program is None:
            return tuple(stated or (0.0,)), False
        from tanteo.machines.programs import program_language

        assumed = program_language(self.program).logs_hand
        return ((TIP_SD,) if assumed else (0.0,)), assumed

    def written(self, found: Plan, part: Part, probe: Probe, covariance: Covariances) -> str | None:
        """Return the probing program of a plan, empty without touches; None without ``--program``.

        Args:
            found: plan.
            part: part that is touched.
            probe: touch probe.
            covariance: covariance of the expected pose ``(6, 6)``, part frame.
        """
        if self.program is None:
            return None
        if not found.readings:
            complain("warning", "--program: the plan has no touches, so no program is written.")
            return ""
        from tanteo.machines.programs import SURE, job_of, program_language, write_program

        with misuse():
            more = self.overtravel, self.retract_height
            job = job_of(found, part, probe, covariance, self.feed or _FEED, *more)
            print_text(
                f"The program takes about {sum(job.seconds):.0f} s, {max(job.seconds):.0f} s for the slowest of "
                f"{len(job.touches)} touches.",
                sys.stderr,
            )
            worst = max(job.touches, key=lambda touch: touch.miss)
            if worst.miss > SURE and not program_language(self.program).goes_on:
                complain(
                    "warning",
                    f"--program: the program stops at the first touch without contact, and touch {worst.number} may "
                    f"miss at {worst.miss:.0%} of the placements. Give a better prior pose, or use tanteo probe.",
                )
            return write_program(self.program, job)
