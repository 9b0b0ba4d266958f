"""Worlds and drivers that the tests of machines share."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from tanteo.geometry import SE3
from tanteo.machines import DirectMachine, Faults, GrblFake, GrblMachine, UrFake, UrMachine, World
from tanteo.machines.address import Address, machine_kind, opened, parse_machine
from tanteo.machines.link import SerialLink, TcpLink
from tanteo.machines.protocol import Machine
from tanteo.parts import Surface
from tanteo.planning import Sensing, Session, Stop, probe_of
from tanteo.planning.start import at_pose

DOWN = np.array([0.0, 0.0, -1.0])
NO_FAULTS = Faults()
SD = 2e-5


def box(x: float = 0.06, y: float = 0.04, z: float = 0.02) -> Surface:
    """Return a block from the origin to (x, y, z)."""
    corners = np.array([[i, j, k] for i in (0, x) for j in (0, y) for k in (0, z)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return Surface(corners, np.array(triangles))


def world(sd: float = 0.0) -> World:
    """Return the block at the origin, for a ball of 1 mm."""
    return World(box(), np.eye(4), 1e-3, sd, 5)


START = np.array([0.03, 0.02, 0.1])


def at(x: float, y: float, z: float) -> np.ndarray:
    """Return a pose of a probe that points down [mm]."""
    return SE3.from_parts(np.diag([1.0, -1.0, -1.0]), 1e-3 * np.array([x, y, z]))


@contextmanager
def grbl_on_a_port(there: World, start: np.ndarray, faults: Faults, speedup: float) -> Iterator[Machine]:
    fake = GrblFake(there, start, speedup=speedup, faults=faults, offset=np.array([0.1, -0.2, 0.05]), inches=True)
    machine = GrblMachine(SerialLink(fake.terminal()))
    try:
        yield machine
    finally:
        machine.close()
        fake.close()


@contextmanager
def robot(start=START, **how):
    """Yield a Universal Robot and its fake."""
    fake = UrFake(world(), start, **how)
    try:
        links = [TcpLink("127.0.0.1", port) for port in fake.ports]
        machine = UrMachine(*links)
        try:
            yield machine, fake
        finally:
            machine.close()
    finally:
        fake.close()


DRIVERS = ["fake:direct", "fake:grbl", "fake:linuxcnc", "fake:ur", "grbl on a serial port"]
OWN = "TANTEO_DRIVERS"
"""Environment variable with addresses of fakes, separated by blanks, on which the tests run instead."""


@contextmanager
def driver(
    name: str, there: World, start=START, faults: Faults = NO_FAULTS, speedup: float = np.inf
) -> Iterator[Machine]:
    """Yield a driver connected to its fake."""
    if name == "grbl on a serial port":
        with grbl_on_a_port(there, start, faults, speedup) as machine:
            yield machine
    else:
        with opened(parse_machine(name), there, start, speedup, faults) as machine:
            yield machine


@contextmanager
def cell(name: str, there: World | None = None, start=START, faults: Faults = NO_FAULTS, speedup: float = np.inf):
    """Yield a driver and its fake, which has the tip; the direct one is its own."""
    there = world() if there is None else there
    if name == "fake:direct":
        machine = DirectMachine(there, start, speedup=speedup)
        yield machine, machine
        return
    kind = name.removeprefix("fake:")
    fake = machine_kind(kind).fake(there, start, speedup=speedup, faults=faults)
    try:
        with opened(Address(kind, host="127.0.0.1", ports=fake.ports)) as machine:
            yield machine, fake
    finally:
        fake.close()


def drivers() -> list[str]:
    """Return the drivers of plug-ins that the environment names, or all of this system; pseudo-terminals need POSIX."""
    if named := os.environ.get(OWN, "").split():
        return named
    return [name for name in DRIVERS if "serial" not in name or sys.platform != "win32"]


PLACE = SE3.from_parts(np.eye(3), np.array([0.1, 0.1, 0.0]))
SPREAD = np.diag([2e-3] * 3 + [np.radians(1)] * 3) ** 2


def session(part, tolerance: float = 0.4e-3, most: int = 12) -> Session:
    """Return a session with a part near a place, touched from above and from the sides."""
    probe = probe_of(
        SD, contact=True, radius=1e-3, approach=DOWN, cone=np.pi / 2, stylus=-DOWN, standoff=0.02, clearance=0.005
    )
    stop = Stop(tolerance=tolerance, confidence=0.95, max_measurements=most)
    return Session(at_pose(part, PLACE, SPREAD), probe, Sensing(sd=SD), stop=stop)


def world_of(part, seed: int = 1) -> World:
    """Return the part at its true pose, which differs from the stated one."""
    error = np.linalg.cholesky(SPREAD) @ np.random.default_rng(seed).standard_normal(6)
    return World(Surface(part.vertices, part.triangles), PLACE @ SE3.exp(error), 1e-3, SD, seed)


ABOVE = np.array([0.15, 0.15, 0.25])
