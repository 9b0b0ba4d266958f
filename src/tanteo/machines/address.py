"""Addresses of machines as typed, and the driver behind each."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

from tanteo import machines
from tanteo.errors import InputError, PluginError, did_you_mean
from tanteo.geometry.typing import Vectors
from tanteo.machines.direct import DirectMachine
from tanteo.machines.fake import Fake
from tanteo.machines.faults import Faults
from tanteo.machines.link import Link, SerialLink, TcpLink
from tanteo.machines.protocol import LinkLostError, Machine
from tanteo.machines.world import World
from tanteo.plugins import Registry, guarded

_WITHOUT_KIND = ("replay", "direct")
"""Kinds of addresses that are no controller: a log, and the simulated tip itself."""

_EXAMPLES = "grbl://192.168.0.7:23, grbl:/dev/ttyUSB0, linuxcnc://192.168.0.7 or fake:grbl"


@dataclass(frozen=True, slots=True)
class Address:
    """Where a machine is.

    Attributes:
        kind: name of a kind of :data:`MACHINES`, or ``replay`` or ``direct``.
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


class FakeMaker(Protocol):
    """Function or class that starts a fake of a controller on loopback."""

    def __call__(self, world: World, start: Vectors, *, hurry: float, faults: Faults | None) -> Fake:
        """Start a fake.

        Args:
            world: what the probe meets.
            start: place of the tip at the start ``(3,)`` [m].
            hurry: factor by which the fake moves faster than asked; infinite to move at once.
            faults: faults of the controller and its connection.
        """
        ...


@dataclass(frozen=True, slots=True)
class MachineKind:
    """A kind of machine that can be typed as an address.

    Attributes:
        ports: default ports of TCP; as many as the driver connects to.
        turns: whether the tool can look along any direction; otherwise it points down.
        serial: whether the machine may be on a serial port.
        open: function that connects to an address and returns the driver.
        fake: function that starts a fake of the controller, for ``fake:NAME``; None if there is none.
    """

    ports: tuple[int, ...]
    turns: bool
    serial: bool
    open: Callable[[Address], Machine]
    fake: FakeMaker | None = None


def parse_machine(text: str) -> Address:
    """``grbl://host:port``, ``grbl:/dev/ttyUSB0``, ``replay:FILE``, ``fake:grbl``.

    Raises:
        InputError: no such kind of machine, or no address of it.

    Example:
        >>> from tanteo.machines.address import parse_machine
        >>> parse_machine("grbl://127.0.0.1:23").ports
        (23,)
    """
    kind, _, rest = text.partition(":")
    kind = kind.lower()
    if kind == "fake":
        name = rest.lower()
        if name != "direct" and machine_kind(name, text).fake is None:
            raise InputError(f"--machine: expected a kind with a fake, got '{text}'. Name the machine itself.")
        return Address(name, fake=True)
    if kind == "replay" and rest:
        return Address(kind, path=rest)
    known = machine_kind(kind, text)
    if rest.startswith("//"):
        found = re.fullmatch(r"(\[[0-9A-Fa-f:]+\]|[^:/\s]+)(?::(\d{1,5}(?:,\d{1,5})*))?/?", rest[2:])
        ports = tuple(int(p) for p in found[2].split(",")) if found and found[2] else ()
        if found and all(0 < p < 65536 for p in ports) and len(ports) in (0, len(known.ports)):
            return Address(kind, host=found[1].strip("[]"), ports=ports)
    elif rest and known.serial:
        return Address(kind, path=rest)
    raise InputError(f"--machine: expected an address as {_EXAMPLES}, got '{text}'. Correct it.")


def machine_kind(name: str, text: str = "") -> MachineKind:
    """Return the kind of machine of a name.

    Args:
        name: name of the kind, as in an address.
        text: whole address, for the message.

    Raises:
        InputError: There is none of that name; the message lists all.
        PluginError: The plug-in of that name cannot be used.
    """
    found = MACHINES.find(name)
    if found is None:
        kinds = MACHINES.names()
        listed = ", ".join([*kinds, "replay"])
        raise InputError(
            f"--machine: expected one of {listed}, as {_EXAMPLES}, got '{text or name}'.{did_you_mean(name, kinds)}"
        )
    return found


def turns_of(address: Address) -> bool:
    """Return whether the tool of the machine at an address can look along any direction; otherwise it points down."""
    return address.kind not in _WITHOUT_KIND and machine_kind(address.kind).turns


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
        PluginError: the driver of a plug-in cannot be opened, or is no driver.
    """
    if not address.fake:
        machine = _replay(address) if address.kind == "replay" else _opened(address)
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
    start_fake, origin = machine_kind(address.kind).fake, MACHINES.origin(address.kind)
    assert start_fake is not None, "an address of a fake is checked when it is read"
    with guarded(origin, "a fake to be started"):
        fake = start_fake(world, start, hurry=hurry, faults=faults)
    try:
        with opened(Address(address.kind, host="127.0.0.1", ports=fake.ports)) as machine:
            yield machine
    finally:
        fake.close()


def _opened(address: Address) -> Machine:
    """Open a driver, and check that one of a plug-in has the methods of the protocol."""
    origin = MACHINES.origin(address.kind)
    with guarded(origin, "a machine to be opened"):
        machine = machine_kind(address.kind).open(address)
    if origin and not isinstance(machine, Machine):
        raise PluginError(
            f"{origin}: expected a Machine with all its methods, got {type(machine).__name__}. Repair it."
        )
    return machine


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
        link = TcpLink(address.host, *(address.ports or MACHINES.builtin["grbl"].ports))
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

    return LinuxCncMachine(TcpLink(address.host, *(address.ports or MACHINES.builtin["linuxcnc"].ports)))


def _grbl_fake(world: World, start: Vectors, *, hurry: float, faults: Faults | None) -> Fake:
    return machines.GrblFake(world, start, hurry=hurry, faults=faults)


def _linuxcnc_fake(world: World, start: Vectors, *, hurry: float, faults: Faults | None) -> Fake:
    return machines.LinuxCncFake(world, start, hurry=hurry, faults=faults)


def _ur_fake(world: World, start: Vectors, *, hurry: float, faults: Faults | None) -> Fake:
    return machines.UrFake(world, start, hurry=hurry, faults=faults)


MACHINES: Registry[MachineKind] = Registry(
    "tanteo.machines",
    MachineKind,
    {
        "grbl": MachineKind((23,), turns=False, serial=True, open=_grbl, fake=_grbl_fake),
        "linuxcnc": MachineKind((5007,), turns=False, serial=False, open=_linuxcnc, fake=_linuxcnc_fake),
        "ur": MachineKind((29999, 30002, 30004), turns=True, serial=False, open=_ur, fake=_ur_fake),
    },
    reserved=("fake", *_WITHOUT_KIND),
)
"""Kinds of machines by the first word of their addresses."""
