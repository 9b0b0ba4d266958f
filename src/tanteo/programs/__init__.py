"""Probing programs: the touches of a plan in the language of a machine or a robot, and what they write as readings.

``job_of`` turns a plan into starts, contacts and ends of guarded motions, ``write_program`` into text; ``PROGRAMS``
names the controllers.
"""

from tanteo.programs.job import Job, Touch, first_way, job_of, leaves, tool_axes, transfer
from tanteo.programs.table import PROGRAMS, ProgramLanguage, program_language, write_program

__all__ = [
    "PROGRAMS", "Job", "ProgramLanguage", "Touch", "first_way", "job_of", "leaves", "program_language", "tool_axes",
    "transfer", "write_program",
]  # fmt: skip
