"""Write probing programs of 3-axis machines with ``G38.2``, for LinuxCNC and GRBL.

LinuxCNC (G-code reference, "G38.n Straight Probe" and "Probe Logging"): a search without contact is an error and ends
the program, and so does a probe that trips in any other motion. ``PROBEOPEN`` logs the contacts. GRBL 1.1
("Interface"): ``G38.2`` answers ``[PRB:x,y,z:1]`` in machine coordinates and raises ``ALARM:5`` without contact.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator

from tanteo.geometry.typing import Vectors
from tanteo.machines.programs.job import Job, Touch

LOG = "tanteo_touches.txt"
"""Name of the log file that LinuxCNC writes."""

_WIDTH = 76
"""Line length of comments [characters]; GRBL senders accept 80 per line."""


def linuxcnc(job: Job) -> str:
    """Return the LinuxCNC program of a job; its log is in the work coordinate system that it runs in (G54).

    Args:
        job: touches of the program.
    """
    head = [
        f"log: one line a touch in {LOG}, X Y Z of the ball's centre in G54 coordinates, millimetres",
        "a search without contact, or a probe that trips elsewhere, ends the program",
    ]
    return _program(job, head, before=[f"(PROBEOPEN {LOG})"], after=["(PROBECLOSE)"])


def grbl(job: Job) -> str:
    """Return the GRBL program of a job; the console output of the sender is its log.

    Args:
        job: touches of the program.
    """
    head = [
        "log: the sender's console, one [PRB:x,y,z:1] a touch, in machine coordinates, millimetres:",
        "they are the plan's if G54 is zero (G10 L2 P1 X0 Y0 Z0 before)",
        "a search without contact ends in ALARM:5; nothing stops a motion between touches",
    ]
    return _program(job, head, before=[], after=[])


def _program(job: Job, head: list[str], *, before: list[str], after: list[str]) -> str:
    lines = [f"({row})" for text in [*header(job), *head] for row in textwrap.wrap(_comment(text), _WIDTH)]
    lines += ["G21 G90 G94 G17 G40", "G54", *before, f"G0 Z{_mm(job.safe_height)}"]
    for touch in job.touches:
        lines += _touch(job, touch)
    return "\n".join([*lines, *after, "M2", ""])


def header(job: Job) -> list[str]:
    """Return the lines of the header that the operator must read before the program runs.

    Args:
        job: touches of the program.
    """
    return [
        f"tanteo plan: {len(job.touches)} touches of {job.part}",
        job.message,
        "frame: world of the plan = G54; unit: millimetres",
        f"positions: centre of the ball, radius {1e3 * job.radius:g} mm: the tool length of the probe (G43) ends there",
        "tool: the stylus points down (-Z) and is at most half as thick as the ball",
        f"safe height Z {1e3 * job.safe_height:.2f}: nothing else may stand as high between the touches",
        "check every motion, and run it without the part and slowly first",
    ]


def _touch(job: Job, touch: Touch) -> Iterator[str]:
    x, y, z = (_mm(v) for v in touch.start)
    yield f"(touch {touch.number}: {_comment(touch.face)[:20]}, contact {_xyz(touch.contact)})"
    yield f"G0 X{x} Y{y}"
    yield f"G0 Z{z}"
    yield f"G38.2 {_xyz(touch.stop)} F{60e3 * job.feed:.4g}"
    yield f"G0 {_xyz(touch.start)}"
    yield f"G0 Z{_mm(job.safe_height)}"


def _mm(metres: float) -> str:
    return f"{1e3 * metres + 0.0:.4f}"


def _xyz(point: Vectors) -> str:
    return " ".join(f"{axis}{_mm(v)}" for axis, v in zip("XYZ", point, strict=True))


def _comment(text: str) -> str:
    """Return the text without characters that would end a comment or begin another."""
    return re.sub(r"[^\x20-\x7e]", "?", text.replace("(", "[").replace(")", "]"))
