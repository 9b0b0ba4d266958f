"""The dashboard of Universal Robots: whether a robot is ready to be moved, in its own words."""

from __future__ import annotations

import time

from tanteo.machines.link import Link
from tanteo.machines.protocol import LinkLostError, StoppedError

_WANTED = (
    ("robotmode", "RUNNING", "Start it at the pendant"),
    ("safetystatus", "NORMAL", "Clear the stop at the pendant"),
    ("is in remote control", "true", "Switch it to remote control at the pendant"),
)
"""Questions, answers of a robot that is ready, and what a person does about others."""


def ready_version(link: Link, deadline: float) -> str:
    """The version of PolyScope of a robot that is ready.

    Raises:
        StoppedError: it is not; that is changed at the pendant, not from here.
        LinkLostError: nobody answers.
    """
    _line(link, deadline)  # its greeting
    version = _asked(link, "PolyscopeVersion", deadline)
    for question, good, advice in _WANTED:
        said = _asked(link, question, deadline)
        if good.lower() not in said.lower():
            raise StoppedError(f"{link.name}: expected {question}: {good}, got '{said}'. {advice}.")
    return version.split(" ")[-1] if " " in version else version


def _asked(link: Link, question: str, deadline: float) -> str:
    link.write(f"{question}\n".encode("ascii"))
    return _line(link, deadline)


def _line(link: Link, deadline: float) -> str:
    row = b""
    while not row.endswith(b"\n"):
        if time.monotonic() > deadline:
            raise LinkLostError(f"{link.name}: expected an answer of the dashboard, got none. Check it.")
        row += link.read(0.1)
    return row.decode("utf-8", "replace").strip()
