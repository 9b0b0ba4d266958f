"""An answer, a session or a plan as one HTML file that opens from disk, offline.

It has words, a picture in 3-D, charts, figures, and how to run it again. A page is made by ``report_page``,
``session_page``, ``plan_page`` or ``distinction_page``, and put to a file by ``write_report(path, page)``. Whoever has
more to tell about an answer hands in further :class:`Section` values.
"""

from tanteo.report.charts import bar
from tanteo.report.combined import combined
from tanteo.report.contacts import Contacts, Sensed, find_contacts, gather
from tanteo.report.course import course_section, goal_words
from tanteo.report.discrimination import distinction_page
from tanteo.report.page import Html, Section, element, photo_section
from tanteo.report.part_drawn import Drawn, draw_part
from tanteo.report.planned import plan_page
from tanteo.report.sections import directions_of, rests_section
from tanteo.report.shapes import Shapes, draw_shapes, shapes_of
from tanteo.report.uncertainty import Budget, Source, make_budget
from tanteo.report.ways import Way, find_ways
from tanteo.report.words import headline, length
from tanteo.report.write import Run, report_page, session_page, write_report
from tanteo.words import percent

__all__ = [
    "Budget", "Contacts", "Drawn", "Html", "Run", "Section", "Sensed", "Shapes", "Source", "Way", "bar",
    "combined", "course_section", "directions_of", "distinction_page", "draw_part", "draw_shapes", "element",
    "find_contacts", "find_ways", "gather", "goal_words", "headline", "length", "make_budget", "percent",
    "photo_section", "plan_page", "report_page", "rests_section", "session_page", "shapes_of", "write_report",
]  # fmt: skip
