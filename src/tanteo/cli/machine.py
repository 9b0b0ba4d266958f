"""Define the options of a machine that moves a probe: address, limits and probe."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from tanteo import io
from tanteo.cli import arguments as args
from tanteo.cli import typed
from tanteo.cli.misuse import MisuseError, require_errors
from tanteo.cli.printing import complain, print_text
from tanteo.cli.probing import parse_speed
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.geometry.typing import FloatArray
    from tanteo.hand import ForbiddenBox
    from tanteo.machines import MachineLimits
    from tanteo.machines.address import Address
    from tanteo.planning import Probe
else:  # the parser resolves annotations; these names avoid slow imports
    Address = FloatArray = ForbiddenBox = Any

_FAKE_RADIUS, _FAKE_SD = 1e-3, 2e-5
"""Default radius and noise of a fake's probe [m]."""
_DOWN, _UP = (0.0, 0.0, -1.0), (0.0, 0.0, 1.0)


def _address(text: str) -> Address:
    from tanteo.machines.address import parse_machine

    return parse_machine(text)


def _check(text: str) -> float | str:
    if text in ("hand", "off"):
        return text
    try:
        return io.readings.parse_length(text, "--check-probe")
    except InputError:
        raise InputError(
            f"--check-probe: expected hand, off or the height of a surface, got '{text}'. Write a height as 12.5mm."
        ) from None


_machine = partial(args.option, rich_help_panel="Machine")


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineOptions:
    """Options of a machine and its probe."""

    machine: Annotated[
        Address,
        _machine(
            "--machine",
            "ADDRESS",
            "Machine that moves the probe: grbl:/dev/ttyUSB0, grbl://HOST, linuxcnc://HOST, ur://HOST, replay:LOG, "
            "fake:grbl.",
        ),
        typed.Words(_address, str),
    ]
    workspace: args.WorkspaceBox = None
    forbid: args.Forbid = None
    tip_radius: args.TipRadius = None
    feed: Annotated[
        float,
        _machine("--feed", "SPEED", "Speed of a touch, as 100mm/min or 2mm/s."),
        typed.Words(parse_speed, str, "2mm/s"),
    ]
    travel: Annotated[
        float,
        _machine("--travel", "SPEED", "Speed between touches."),
        typed.Words(partial(parse_speed, option="--travel"), str, "20mm/s"),
    ]
    max_reach: Annotated[
        float,
        _machine("--max-reach", "LENGTH", "Largest length of a touch, as 100mm."),
        typed.Words(partial(typed.length, "--max-reach", "100mm"), str, "100mm"),
    ]
    standoff: args.TouchStandoff = None
    clearance: args.Clearance = None
    tool_body: args.ToolBody = None
    tool_tilt: args.ToolTilt = None
    axis_parallel: args.AxisParallel = False
    check_probe: Annotated[
        float | str | None,
        _machine(
            "--check-probe",
            "WAY",
            "Check of the probe before the first motion: hand (default on a terminal), off, or the height of a surface "
            "straight below the tip, as 12.5mm.",
        ),
        typed.Words(_check),
    ] = None
    dry_run: Annotated[bool, _machine("--dry-run", None, "Check and show all motions without sending them.")] = False
    confirm: Annotated[bool, _machine("--confirm", None, "Request a confirmation before every motion.")] = False

    def __post_init__(self) -> None:
        if self.tip_radius is None and not self.machine.fake:
            raise MisuseError(
                "--tip-radius: expected the ball radius of the machine's probe, got none. Add --tip-radius 1.5mm."
            )
        if self.tool_body is None and self.moves and _turns(self.machine):
            raise MisuseError(
                "--tool-body: expected stylus, radius and length of a tool that turns, got none. Add --tool-body "
                "50,30,150mm."
            )
        if self.workspace is None and self.moves:
            raise MisuseError(
                "--workspace: expected the permitted positions of the tip, got none. Add "
                "--workspace 0,0,-50,300,200,120mm."
            )

    @property
    def moves(self) -> bool:
        """Whether the machine really moves, so it is neither a fake nor a log."""
        return not self.machine.fake and self.machine.kind != "replay"

    @property
    def radius(self) -> float:
        """Radius of the probe's ball [m]."""
        if self.tip_radius is not None:
            return self.tip_radius
        return _FAKE_RADIUS if self.machine.fake else 0.0

    def spread(self, sensor: str | None, sd: float | None) -> str | float:
        """Return the noise of one reading: the name of a preset, or a standard deviation [m].

        Args:
            sensor: name of a preset; None if not given.
            sd: standard deviation [m]; None if not given.

        Raises:
            MisuseError: both or neither are given for a machine that is no fake.
        """
        if sensor is None and sd is None and self.machine.fake:
            return _FAKE_SD
        require_errors(sensor, sd, "0.02mm")
        return sensor if sensor is not None else cast("float", sd)

    def probe(self, spread: str | float, robot: str | None, form_sd: float = 0.0, *, turns: bool) -> Probe:
        """Return the probe for the choice of readings.

        Args:
            spread: name of a preset, or a standard deviation [m].
            robot: name of the robot's preset; None if not given.
            form_sd: standard deviation of the part's surface from its CAD [m].
            turns: whether the tool can point along any direction.
        """
        from tanteo.planning import probe_of

        upright = not turns or self.tool_tilt == 0
        stylus: dict[str, Any] = {"stylus": _UP} if upright else {"stylus_along_motion": True, "tilt": self.tool_tilt}
        where: dict[str, Any] = {
            "contact": True, "radius": self.radius, "approach": _DOWN, "cone": 0.5 * 3.141592653589793,
            "standoff": self.standoff, "clearance": self.clearance, "workspace": self._workspace(), "form_sd": form_sd,
            "axis_parallel": self.axis_parallel, "body": self._body(), **stylus,
        }  # fmt: skip
        return probe_of(spread, robot, **{name: value for name, value in where.items() if value is not None})

    def limits(self) -> MachineLimits:
        """Return the limits of the machine."""
        from tanteo.machines import MachineLimits

        workspace, body = self._workspace(), self._body()
        return MachineLimits(workspace, self.radius, self.travel, self.feed, self.max_reach, body=body)

    def _body(self) -> Any:
        """Return the body of the tool; None without ``--tool-body``."""
        from tanteo.machines import tool_body

        if self.tool_body is None:
            return None
        stylus, radius, length = self.tool_body
        return tool_body(stylus, self.radius, radius, length)

    def check_of_probe(self) -> float | str:
        """Return the check of the probe before the first motion: ``hand``, ``off``, or the height of a surface [m]."""
        if self.check_probe is not None:
            return self.check_probe
        if not self.moves or self.dry_run:
            return "off"
        if sys.stdin is not None and sys.stdin.isatty():
            return "hand"
        complain("warning", "--check-probe: the probe is not checked, because the input is no terminal. Add hand.")
        return "off"

    def _workspace(self) -> Any:
        from tanteo.hand import Workspace

        forbidden = tuple(self.forbid or ())
        if self.workspace is None:
            return Workspace.everywhere(forbidden)
        low, high = self.workspace
        return Workspace(low, high, forbidden)

    def confirmation(self) -> Callable[[str], bool] | None:
        """Return the function that requests confirmation before every motion; None without ``--confirm``."""
        return confirmed if self.confirm else None

    def print_assumptions(self) -> None:
        """Print the assumptions about a fake, a log or a dry run to standard error."""
        if self.machine.fake:
            print_text(f"Fake: nothing moves. Its ball has a radius of {1e3 * self.radius:g} mm.", sys.stderr)
        if self.machine.kind == "replay":
            print_text(f"Log: nothing moves. The assumed radius of its ball is {1e3 * self.radius:g} mm.", sys.stderr)
        if self.dry_run:
            print_text(
                "Dry run: motions are checked and shown but not sent; each touch is assumed to end as expected.",
                sys.stderr,
            )


def _turns(address: Address) -> bool:
    from tanteo.machines.address import turns_of

    return turns_of(address)


def confirmed(question: str) -> bool:
    """Return the answer to a yes-or-no question on the terminal; the end of the input is a no.

    Args:
        question: question without its question mark.
    """
    try:
        return typer.confirm(f"{question}?", err=True)
    except (typer.Abort, EOFError):
        complain("warning", "no answer: assumed to be no.")
        return False


def check_record(record: str | None, *, resume: bool, dry: bool) -> None:
    """Check that a run stores its readings and does not overwrite a file.

    Args:
        record: file of the session record; None if not given.
        resume: whether to continue the session of an existing record.
        dry: whether nothing is sent.

    Raises:
        MisuseError: there is no record, or it exists and ``resume`` is False.
        InputError: there is no record to resume.
    """
    from pathlib import Path

    if dry:
        return
    if record is None:
        raise MisuseError("--record: expected a file for the readings, got none. Add --record run.json.")
    there = Path(record).exists()
    if there and not resume:
        raise MisuseError(f"--record: expected a new file, got '{record}', which exists. Use --resume to continue it.")
    if resume and not there:
        raise InputError(f"--resume: expected the record of a session, got none at '{record}'. Drop --resume.")
