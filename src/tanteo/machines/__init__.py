"""Machines that move a probe for a session: drivers behind one wrapper that keeps their limits, and fakes to try them on.

``open_machine`` takes an address, :class:`SafeMachine` the driver that it gives, ``probe_part`` both and a session::

    with opened("fake:grbl", scene) as machine:
        done = probe_part(session, SafeMachine(machine, MachineLimits()), "run.json")
"""

from typing import TYPE_CHECKING

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.machines.direct import DirectMachine
    from tanteo.machines.faults import Faults
    from tanteo.machines.grbl import GrblMachine
    from tanteo.machines.grbl_fake import GrblFake
    from tanteo.machines.journal import Journal, reading_of
    from tanteo.machines.link import Link, SerialLink, TcpLink
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
    from tanteo.machines.run import Probed, Turn, probe_part
    from tanteo.machines.safe import MachineLimits, SafeMachine
    from tanteo.machines.world import World

_NAMES = {
    "direct": "DirectMachine",
    "faults": "Faults",
    "grbl": "GrblMachine",
    "grbl_fake": "GrblFake",
    "journal": "Journal reading_of",
    "link": "Link SerialLink TcpLink",
    "protocol": "ContactError Facts LateError LinkLostError Machine MachineError MachineStatus RefusedError Sensed "
    "StoppedError",
    "run": "Probed Turn probe_part",
    "safe": "MachineLimits SafeMachine",
    "world": "World",
}
__all__ = [  # noqa: F822
    "ContactError", "DirectMachine", "Facts", "Faults", "GrblFake", "GrblMachine", "Journal", "LateError", "Link",
    "LinkLostError", "Machine", "MachineError", "MachineLimits", "MachineStatus", "Probed", "RefusedError",
    "SafeMachine", "Sensed", "SerialLink", "StoppedError", "TcpLink", "Turn", "World", "probe_part", "reading_of",
]  # fmt: skip
__getattr__, __dir__ = lazy(__name__, _NAMES)
