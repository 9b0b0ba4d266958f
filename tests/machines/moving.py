"""A process that touches with a machine of loopback, for the tests of signals.

``python moving.py KIND PORT...``; KIND is ``grbl``, ``linuxcnc`` or ``ur``, or ``serial`` with the name of a port.
"""

from __future__ import annotations

import sys

import numpy as np

from tanteo.machines import (
    GrblMachine,
    Interrupted,
    LinuxCncMachine,
    MachineLimits,
    SafeMachine,
    UrMachine,
    stop_on_signals,
)
from tanteo.machines.link import SerialLink, TcpLink

KINDS = {"grbl": GrblMachine, "linuxcnc": LinuxCncMachine, "ur": UrMachine}


def main() -> None:
    kind, *ports = sys.argv[1:]
    if kind == "serial":
        machine = GrblMachine(SerialLink(ports[0]))
    else:
        machine = KINDS[kind](*(TcpLink("127.0.0.1", int(port)) for port in ports))
    safe = SafeMachine(machine, MachineLimits(touch=2e-3))
    try:
        with stop_on_signals(safe):
            safe.sense(np.array([0.0, 0.0, -1.0]), 0.06)
    except Interrupted as stop:
        print(f"{stop}; {safe.stopped}; away {safe.away.tolist()}")
        sys.exit(128 + stop.number)


if __name__ == "__main__":
    main()
