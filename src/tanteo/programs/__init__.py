"""Write probing programs: a plan's touches in the language of a controller, which logs them as readings.

:func:`job_of` turns a plan into starts, contacts and ends of guarded motions, :func:`write_program` turns them into
text. :data:`PROGRAMS` lists the supported controllers.
"""

from tanteo.programs.job import Job, Touch, first_way, job_of, leaves, tool_axes, transfer
from tanteo.programs.table import PROGRAMS, ProgramLanguage, program_language, write_program

__all__ = [
    "PROGRAMS", "Job", "ProgramLanguage", "Touch", "first_way", "job_of", "leaves", "program_language", "tool_axes",
    "transfer", "write_program",
]  # fmt: skip
