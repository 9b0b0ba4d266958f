"""Origin of a report: command, program and files."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Run:
    """Origin of a result, so that the user can repeat it.

    Attributes:
        command: command line that repeats the result.
        made_by: program and version.
        facts: further facts beside the picture, as name and value.
        files: files of the command, as name and checksum.
    """

    command: str
    made_by: str = "tanteo"
    facts: tuple[tuple[str, str], ...] = ()
    files: tuple[tuple[str, str], ...] = ()
