"""A process that touches with a machine of loopback, for the tests of signals: ``python moving.py KIND PORT...``."""

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
from tanteo.machines.link import TcpLink

KINDS = {"grbl": GrblMachine, "linuxcnc": LinuxCncMachine, "ur": UrMachine}


def main() -> None:
    links = [TcpLink("127.0.0.1", int(port)) for port in sys.argv[2:]]
    safe = SafeMachine(KINDS[sys.argv[1]](*links), MachineLimits(touch=2e-3))
    try:
        with stop_on_signals(safe):
            safe.sense(np.array([0.0, 0.0, -1.0]), 0.06)
    except Interrupted as stop:
        print(f"{stop}; {safe.stopped}; away {safe.away.tolist()}")
        sys.exit(128 + stop.number)


if __name__ == "__main__":
    main()
