"""Options of a machine that moves a probe: where it is, what it may do, what its probe is."""

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
from tanteo.cli.printing import complain, say
from tanteo.cli.probing import parse_speed
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.geometry.typing import FloatArray
    from tanteo.hand import ForbiddenBox
    from tanteo.machines import Address, MachineLimits
    from tanteo.planning import Probe
else:  # the parser resolves annotations, and has to load nothing for that
    Address = FloatArray = ForbiddenBox = Any

_FAKE_RADIUS, _FAKE_SD = 1e-3, 2e-5
"""Ball and noise of a fake's probe, where nobody says [m]."""
_DOWN, _UP = (0.0, 0.0, -1.0), (0.0, 0.0, 1.0)


def _address(text: str) -> Address:
    from tanteo.machines import parse_machine

    return parse_machine(text)


def _box(text: str) -> FloatArray:
    return io.parse_box(text, "--workspace")


def _radius(text: str) -> float:
    return io.parse_length(text, "--tip-radius")


_machine = partial(args.option, rich_help_panel="Machine")


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineOptions:
    """Options of a machine, and of the probe on it."""

    machine: Annotated[
        Address,
        _machine(
            "--machine",
            "ADDRESS",
            "What moves the probe: grbl:/dev/ttyUSB0, grbl://HOST, linuxcnc://HOST, ur://HOST, replay:LOG, fake:grbl.",
        ),
        typed.Words(_address, str),
    ]
    workspace: Annotated[
        FloatArray | None,
        _machine(
            "--workspace", "LOW,HIGH", "Box that the tip never leaves, as 0,0,-50,300,200,120mm; not needed for a fake."
        ),
        typed.Words(_box),
    ] = None
    forbid: Annotated[
        list[Any] | None,
        _machine(
            "--forbid", "CORNERS", "Box that nothing enters: two corners, as 150,0,0,180,60,250mm; may be repeated."
        ),
        typed.Words(typed.forbidden, list[str] | None),
    ] = None
    tip_radius: Annotated[
        float | None,
        _machine("--tip-radius", "LENGTH", "Radius of the probe's ball, as 1.5mm; 0mm for a sharp tip."),
        typed.Words(_radius),
    ] = None
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
        _machine("--max-reach", "LENGTH", "Longest way of a touch, as 100mm."),
        typed.Words(partial(typed.length, "--max-reach", "100mm"), str, "100mm"),
    ]
    standoff: Annotated[
        float | None,
        _machine("--standoff", "LENGTH", "Distance from which a touch starts, as 20mm: 50mm if not given."),
        args.STANDOFF,
    ] = None
    clearance: Annotated[
        float | None,
        _machine("--clearance", "LENGTH", "Free room around the probe, a radius: 10mm if not given."),
        typed.Words(partial(typed.length, "--clearance", "10mm")),
    ] = None
    dry_run: Annotated[bool, _machine("--dry-run", None, "Check and show all motions, send none.")] = False
    confirm: Annotated[bool, _machine("--confirm", None, "Ask before every motion.")] = False

    def __post_init__(self) -> None:
        if self.tip_radius is None and not self.machine.fake:
            raise MisuseError(
                "--tip-radius: expected the ball of the machine's probe, got none. Say --tip-radius 1.5mm."
            )
        if self.workspace is None and self.moves:
            raise MisuseError(
                "--workspace: expected where the machine's tip may be, got none. Say --workspace 0,0,-50,300,200,120mm."
            )

    @property
    def moves(self) -> bool:
        """Whether it is a machine that moves: no fake, no log."""
        return not self.machine.fake and self.machine.kind != "replay"

    @property
    def radius(self) -> float:
        """Of the ball [m]."""
        if self.tip_radius is not None:
            return self.tip_radius
        return _FAKE_RADIUS if self.machine.fake else 0.0

    def spread(self, sensor: str | None, sd: float | None) -> str | float:
        """Of one reading: a preset, or one standard deviation [m]."""
        if sensor is None and sd is None and self.machine.fake:
            return _FAKE_SD
        require_errors(sensor, sd, "0.02mm")
        return sensor if sensor is not None else cast("float", sd)

    def probe(self, spread: str | float, robot: str | None, *, turns: bool) -> Probe:
        """What senses, as choosing needs it."""
        from tanteo.planning import probe_of

        held: dict[str, Any] = {"stylus_behind": True} if turns else {"stylus": _UP}
        where: dict[str, Any] = {
            "contact": True, "radius": self.radius, "approach": _DOWN, "cone": 0.5 * 3.141592653589793,
            "standoff": self.standoff, "clearance": self.clearance, "workspace": self._room(), **held,
        }  # fmt: skip
        return probe_of(spread, robot, **{name: value for name, value in where.items() if value is not None})

    def limits(self) -> MachineLimits:
        """What it may do."""
        from tanteo.machines import MachineLimits

        return MachineLimits(self._room(), self.radius, self.travel, self.feed, self.max_reach)

    def _room(self) -> Any:
        from tanteo.hand import Workspace

        forbidden = tuple(self.forbid or ())
        if self.workspace is None:
            return Workspace.everywhere(forbidden)
        low, high = self.workspace
        return Workspace(low, high, forbidden)

    def asked(self) -> Callable[[str], bool] | None:
        """What asks before every motion."""
        return ask if self.confirm else None

    def said(self) -> None:
        """What is taken as something, on standard error."""
        if self.machine.fake:
            say(f"A fake: nothing moves. Its ball has a radius of {1e3 * self.radius:g} mm.", sys.stderr)
        if self.machine.kind == "replay":
            say(f"A log: nothing moves. Its ball is taken to have a radius of {1e3 * self.radius:g} mm.", sys.stderr)
        if self.dry_run:
            say(
                "Dry run: motions are checked and shown, none is sent; touches are taken to be as expected.", sys.stderr
            )


def ask(question: str) -> bool:
    """A yes or a no on the terminal; the end of the input is a no."""
    try:
        return typer.confirm(f"{question}?", err=True)
    except (typer.Abort, EOFError):
        complain("warning", "no answer: taken as no.")
        return False


def check_record(record: str | None, *, resume: bool, dry: bool) -> None:
    """Whether readings are kept, and nothing is written over.

    Raises:
        MisuseError: no record of a machine that moves, or one that is there.
    """
    from pathlib import Path

    if dry:
        return
    if record is None:
        raise MisuseError("--record: expected where the readings are kept, got none. Say --record run.json.")
    there = Path(record).exists()
    if there and not resume:
        raise MisuseError(
            f"--record: expected a new file, got '{record}', which is there. Say --resume to go on with it."
        )
    if resume and not there:
        raise InputError(f"--resume: expected the record of a session, got none at '{record}'. Leave --resume out.")
