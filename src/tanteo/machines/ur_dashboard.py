"""Query the dashboard of Universal Robots: whether a robot is ready to move."""

from __future__ import annotations

import re
import time

from tanteo.machines.link import Link
from tanteo.machines.protocol import LinkLostError, StoppedError, quoted

_WANTED = (
    ("robotmode", "RUNNING", "Start it at the pendant"),
    ("safetystatus", "NORMAL", "Clear the stop at the pendant"),
    ("is in remote control", "true", "Switch it to remote control at the pendant"),
)
"""Queries, the answers of a robot that is ready, and the advice for other answers."""
_LONGEST = 4096
"""Largest length of an answer [bytes]; those of PolyScope are shorter."""


def ready_version(link: Link, deadline: float) -> str:
    """Return the PolyScope version of a robot, after a check that it is ready.

    Args:
        link: connection to the dashboard.
        deadline: deadline, by the monotonic clock [s].

    Raises:
        StoppedError: the robot is not ready; only the operator can change that, at the pendant.
        LinkLostError: no controller answers.
    """
    _line(link, deadline)  # greeting of the dashboard
    version = _queried(link, "PolyscopeVersion", deadline)
    for question, good, advice in _WANTED:
        answer = _queried(link, question, deadline)
        if not re.fullmatch(rf"(\w+: )?{good}", answer, re.IGNORECASE):
            raise StoppedError(f"{link.name}: expected {question}: {good}, got {quoted(answer)}. {advice}.")
    found = re.search(r"\d+(\.\d+)+", version)
    if found is None:
        raise StoppedError(f"{link.name}: expected a version of PolyScope, got {quoted(version)}. Check the address.")
    return found[0]


def _queried(link: Link, question: str, deadline: float) -> str:
    link.write(f"{question}\n".encode("ascii"))
    return _line(link, deadline)


def _line(link: Link, deadline: float) -> str:
    row = b""
    while not row.endswith(b"\n"):
        if not time.monotonic() <= deadline:
            raise LinkLostError(f"{link.name}: expected an answer of the dashboard, got none. Check it.")
        if len(row) > _LONGEST:
            got = quoted(row.decode("utf-8", "replace"))
            raise LinkLostError(f"{link.name}: expected an answer of the dashboard, got {got}. Check the address.")
        row += link.read(0.1)
    return row.decode("utf-8", "replace").strip()
