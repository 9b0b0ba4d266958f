"""Parse the addresses of machines, and open the driver for an address."""

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
"""Kinds of addresses without a controller: a log, and the simulated tip."""

_EXAMPLES = "grbl://192.168.0.7:23, grbl:/dev/ttyUSB0, linuxcnc://192.168.0.7 or fake:grbl"


@dataclass(frozen=True, slots=True)
class Address:
    """Address of a machine.

    Attributes:
        kind: name of a kind in :data:`MACHINES`, or ``replay`` or ``direct``.
        host: host of a network address; empty for serial ports and files.
        ports: ports of a network address; empty for the default ports.
        path: serial port or file; empty for a network address.
        fake: whether a fake controller of this kind is started on loopback.
    """

    kind: str
    host: str = ""
    ports: tuple[int, ...] = ()
    path: str = ""
    fake: bool = False


class FakeMaker(Protocol):
    """Function or class that starts a fake of a controller on loopback."""

    def __call__(self, world: World, start: Vectors, *, speedup: float, faults: Faults | None) -> Fake:
        """Start a fake.

        Args:
            world: body that the probe touches.
            start: position of the tip at the start ``(3,)`` [m].
            speedup: factor on the commanded speed; infinite for motions that take no time.
            faults: simulated faults of the controller and its connection.
        """
        ...


@dataclass(frozen=True, slots=True)
class MachineKind:
    """A kind of machine that can be typed as an address.

    Attributes:
        ports: default TCP ports, one for each connection of the driver.
        turns: whether the tool can point along any direction; otherwise it points down.
        serial: whether the machine can be connected to a serial port.
        open: function that connects to an address and returns the driver.
        fake: function that starts a fake of the controller, for ``fake:NAME``; None if there is none.
    """

    ports: tuple[int, ...]
    turns: bool
    serial: bool
    open: Callable[[Address], Machine]
    fake: FakeMaker | None = None


def parse_machine(text: str) -> Address:
    """Return the address in a text such as ``grbl://host:port``, ``grbl:/dev/ttyUSB0``, ``replay:FILE``, ``fake:grbl``.

    Args:
        text: address as typed.

    Raises:
        InputError: the kind of machine is unknown, or the rest is not an address for this kind.
        PluginError: the plug-in of this kind cannot be used.

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
    """Return the kind of machine with a name.

    Args:
        name: name of the kind, as in an address.
        text: complete address, for messages.

    Raises:
        InputError: the name is unknown; the message lists all names.
        PluginError: the plug-in with this name cannot be used.
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
    """Return whether the tool of a machine can point along any direction; otherwise it points down.

    Args:
        address: address of the machine.
    """
    return address.kind not in _WITHOUT_KIND and machine_kind(address.kind).turns


@contextmanager
def opened(
    address: Address, world: World | None = None, start: Vectors | None = None, speedup: float = float("inf"),
    faults: Faults | None = None,
) -> Iterator[Machine]:  # fmt: skip
    """Open the machine at an address, and close it at the end of the context; a fake is started and ended as well.

    Args:
        address: address of the machine.
        world: body that the probe of a fake touches; required for a fake.
        start: position of a fake's tip at the start ``(3,)`` [m]; required for a fake.
        speedup: factor on the speed of a fake; infinite for motions that take no time.
        faults: simulated faults of a fake.

    Yields:
        The driver of the machine.

    Raises:
        InputError: world or start of a fake are missing.
        LinkLostError: no controller answers.
        StoppedError: the controller is in an alarm state.
        PluginError: the driver of a plug-in cannot be opened, or does not implement the protocol.
    """
    if not address.fake:
        machine = _replay(address) if address.kind == "replay" else _opened(address)
        try:
            yield machine
        finally:
            machine.close()
        return
    if world is None or start is None:
        raise InputError("fake: expected a world and a start position, got none. Pass both.")
    if address.kind == "direct":
        yield DirectMachine(world, start, speedup=speedup)
        return
    start_fake, origin = machine_kind(address.kind).fake, MACHINES.origin(address.kind)
    assert start_fake is not None, "an address of a fake is checked when it is read"
    with guarded(origin, "a fake to be started"):
        fake = start_fake(world, start, speedup=speedup, faults=faults)
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


def _grbl_fake(world: World, start: Vectors, *, speedup: float, faults: Faults | None) -> Fake:
    return machines.GrblFake(world, start, speedup=speedup, faults=faults)


def _linuxcnc_fake(world: World, start: Vectors, *, speedup: float, faults: Faults | None) -> Fake:
    return machines.LinuxCncFake(world, start, speedup=speedup, faults=faults)


def _ur_fake(world: World, start: Vectors, *, speedup: float, faults: Faults | None) -> Fake:
    return machines.UrFake(world, start, speedup=speedup, faults=faults)


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
"""Kinds of machines, by the first word of their addresses."""
