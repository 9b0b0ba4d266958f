"""A recognition as one HTML file that opens from disk, offline: words, a picture in 3-D, figures, how to run it again.

``write_report(path, answer, sensed, parts, command=...)``; ``sensed`` comes from :func:`gather`. Whoever has more to
tell than one answer (a session, a plan) hands in further :class:`Section` values.
"""

from tanteo.report.budget import Budget, Source, make_budget
from tanteo.report.contacts import Contacts, find_contacts
from tanteo.report.course import course_section
from tanteo.report.ghosts import Way, find_ways
from tanteo.report.html import Html, element
from tanteo.report.section import Section
from tanteo.report.sensed import Sensed, gather
from tanteo.report.write import report_page, write_report

__all__ = [
    "Budget",
    "Contacts",
    "Html",
    "Section",
    "Sensed",
    "Source",
    "Way",
    "course_section",
    "element",
    "find_contacts",
    "find_ways",
    "gather",
    "make_budget",
    "report_page",
    "write_report",
]
