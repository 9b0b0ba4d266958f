"""Machines that move a probe for a session: drivers behind one wrapper that keeps their limits, and fakes of them.

``opened`` takes an address, :class:`SafeMachine` the driver that it gives, ``probe_part`` both and a session::

    with opened(parse_machine("fake:grbl"), world, start) as machine:
        done = probe_part(session, SafeMachine(machine, MachineLimits()), "run.json")
"""

from typing import TYPE_CHECKING

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.machines.address import MACHINES, Address, MachineKind, opened, parse_machine, turns_of
    from tanteo.machines.direct import DirectMachine
    from tanteo.machines.fake import Fake
    from tanteo.machines.faults import Faults
    from tanteo.machines.grbl import GrblMachine
    from tanteo.machines.grbl_fake import GrblFake
    from tanteo.machines.journal import Journal, reading_of
    from tanteo.machines.limits import MachineLimits
    from tanteo.machines.link import Link, SerialLink, TcpLink
    from tanteo.machines.linuxcnc import LinuxCncMachine
    from tanteo.machines.linuxcnc_fake import LinuxCncFake
    from tanteo.machines.protocol import (
        ContactError,
        Facts,
        LateError,
        LinkLostError,
        Machine,
        MachineError,
        MachineStatus,
        RefusedError,
        Sensed,
        StoppedError,
    )
    from tanteo.machines.ranging import RangingMachine
    from tanteo.machines.replay import ReplayMachine
    from tanteo.machines.run import Probed, Turn, probe_part
    from tanteo.machines.safe import SafeMachine
    from tanteo.machines.ur import UrMachine
    from tanteo.machines.ur_fake import UrFake
    from tanteo.machines.ways import Ways
    from tanteo.machines.world import World

_NAMES = {
    "address": "MACHINES Address MachineKind opened parse_machine turns_of",
    "direct": "DirectMachine",
    "fake": "Fake",
    "faults": "Faults",
    "grbl": "GrblMachine",
    "grbl_fake": "GrblFake",
    "journal": "Journal reading_of",
    "limits": "MachineLimits",
    "link": "Link SerialLink TcpLink",
    "linuxcnc": "LinuxCncMachine",
    "linuxcnc_fake": "LinuxCncFake",
    "protocol": "ContactError Facts LateError LinkLostError Machine MachineError MachineStatus RefusedError Sensed "
    "StoppedError",
    "ranging": "RangingMachine",
    "replay": "ReplayMachine",
    "run": "Probed Turn probe_part",
    "safe": "SafeMachine",
    "ur": "UrMachine",
    "ur_fake": "UrFake",
    "ways": "Ways",
    "world": "World",
}
__all__ = [
    "MACHINES", "Address", "ContactError", "DirectMachine", "Facts", "Fake", "Faults", "GrblFake", "GrblMachine",
    "Journal", "LateError", "Link", "LinkLostError", "LinuxCncFake", "LinuxCncMachine", "Machine", "MachineError",
    "MachineKind", "MachineLimits", "MachineStatus", "Probed", "RangingMachine", "RefusedError", "ReplayMachine",
    "SafeMachine", "Sensed", "SerialLink", "StoppedError", "TcpLink", "Turn", "UrFake", "UrMachine", "Ways", "World",
    "opened", "parse_machine", "probe_part", "reading_of", "turns_of",
]  # fmt: skip
__getattr__, __dir__ = lazy(__name__, _NAMES)
