"""Addresses of machines as typed, and the driver behind each."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from tanteo import machines
from tanteo.errors import InputError, did_you_mean
from tanteo.machines.direct import DirectMachine
from tanteo.machines.fake import Fake
from tanteo.machines.faults import Faults
from tanteo.machines.link import Link, SerialLink, TcpLink
from tanteo.machines.protocol import LinkLostError, Machine
from tanteo.machines.world import World
from tanteo.typing import Vectors

_EXAMPLES = "grbl://192.168.0.7:23, grbl:/dev/ttyUSB0, linuxcnc://192.168.0.7 or fake:grbl"


@dataclass(frozen=True, slots=True)
class Address:
    """Where a machine is.

    Attributes:
        kind: a key of :data:`KINDS`.
        host: of a network address; empty for another.
        ports: of it; empty for the usual ones.
        path: a serial port, or a file.
        fake: a fake of this kind is started on loopback.
    """

    kind: str
    host: str = ""
    ports: tuple[int, ...] = ()
    path: str = ""
    fake: bool = False


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of machine.

    Attributes:
        ports: the usual ones of TCP.
        turns: its tool looks along each reading; else it points down.
        serial: it may be on a serial port.
        open: the driver at an address.
        fake: the class of its fake, a name of this room.
    """

    ports: tuple[int, ...]
    turns: bool
    serial: bool
    open: Callable[[Address], Machine]
    fake: str


def parse_machine(text: str) -> Address:
    """``grbl://host:port``, ``grbl:/dev/ttyUSB0``, ``replay:FILE``, ``fake:grbl``.

    Raises:
        InputError: no such kind of machine, or no address of it.

    Example:
        >>> from tanteo.machines import parse_machine
        >>> parse_machine("grbl://127.0.0.1:23").ports
        (23,)
    """
    kind, _, rest = text.partition(":")
    kind = kind.lower()
    if kind == "fake":
        return Address(_known(rest.lower(), [*KINDS, "direct"], text), fake=True)
    if kind == "replay" and rest:
        return Address(kind, path=rest)
    _known(kind, KINDS, text)
    if rest.startswith("//"):
        found = re.fullmatch(r"(\[[0-9A-Fa-f:]+\]|[^:/\s]+)(?::(\d{1,5}(?:,\d{1,5})*))?/?", rest[2:])
        ports = tuple(int(p) for p in found[2].split(",")) if found and found[2] else ()
        if found and all(0 < p < 65536 for p in ports) and len(ports) in (0, len(KINDS[kind].ports)):
            return Address(kind, host=found[1].strip("[]"), ports=ports)
    elif rest and KINDS[kind].serial:
        return Address(kind, path=rest)
    raise InputError(f"--machine: expected an address as {_EXAMPLES}, got '{text}'. Correct it.")


def _known(kind: str, kinds: Collection[str], text: str) -> str:
    if kind not in kinds:
        names = ", ".join([*kinds, "replay"])
        raise InputError(
            f"--machine: expected one of {names}, as {_EXAMPLES}, got '{text}'.{did_you_mean(kind, kinds)}"
        )
    return kind


def turns_of(address: Address) -> bool:
    """Whether the tool of the machine there looks along each reading; else it points down."""
    return address.kind in KINDS and KINDS[address.kind].turns


@contextmanager
def opened(
    address: Address, world: World | None = None, start: Vectors | None = None, hurry: float = float("inf"),
    faults: Faults | None = None,
) -> Iterator[Machine]:  # fmt: skip
    """The machine at an address, let go at the end; a fake is started, and ended, too.

    Args:
        address: of it.
        world: of a fake.
        start: where the tip of a fake is ``(3,)`` [m].
        hurry: how much faster than stated a fake moves; infinite: at once.
        faults: of a fake.

    Raises:
        LinkLostError: nobody answers.
        StoppedError: it is in alarm.
    """
    if not address.fake:
        machine = _replay(address) if address.kind == "replay" else KINDS[address.kind].open(address)
        try:
            yield machine
        finally:
            machine.close()
        return
    if world is None or start is None:
        raise InputError("fake: expected a world and a place to start from, got none. Pass both.")
    if address.kind == "direct":
        yield DirectMachine(world, start, hurry=hurry)
        return
    fake: Fake = getattr(machines, KINDS[address.kind].fake)(world, start, hurry=hurry, faults=faults)
    try:
        with opened(Address(address.kind, host="127.0.0.1", ports=fake.ports)) as machine:
            yield machine
    finally:
        fake.close()


def _replay(address: Address) -> Machine:
    from tanteo.machines.replay import ReplayMachine

    return ReplayMachine.of_file(address.path)


def _grbl(address: Address) -> Machine:
    from tanteo.machines.grbl import GrblMachine

    link: Link
    if address.path:
        port, _, baud = address.path.partition("@")
        link = SerialLink(port, int(baud) if baud.isdigit() else 115200)
    else:
        link = TcpLink(address.host, *(address.ports or KINDS["grbl"].ports))
    return GrblMachine(link)


def _ur(address: Address) -> Machine:
    from tanteo.machines.ur import PORTS, UrMachine

    links = list[Link]()
    try:
        for port in address.ports or PORTS:
            links.append(TcpLink(address.host, port))
    except LinkLostError:
        for link in links:
            link.close()
        raise
    dashboard, script, data = links
    return UrMachine(dashboard, script, data)


def _linuxcnc(address: Address) -> Machine:
    from tanteo.machines.linuxcnc import LinuxCncMachine

    return LinuxCncMachine(TcpLink(address.host, *(address.ports or KINDS["linuxcnc"].ports)))


KINDS: dict[str, Kind] = {
    "grbl": Kind((23,), turns=False, serial=True, open=_grbl, fake="GrblFake"),
    "linuxcnc": Kind((5007,), turns=False, serial=False, open=_linuxcnc, fake="LinuxCncFake"),
    "ur": Kind((29999, 30002, 30004), turns=True, serial=False, open=_ur, fake="UrFake"),
}
"""Kinds of machines."""
