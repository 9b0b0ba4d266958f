"""Results in words and tables for a terminal or a log: each function gives the lines that the command line prints.

``answer_lines`` for an answer, ``sight_lines`` for an image, ``plan_lines`` and ``distinction_lines`` for plans,
``explanation_lines`` for what each reading told, ``part_lines``, ``sensor_lines``, ``robot_lines``, ``rig_lines`` and
``calibration_lines`` for what is read or estimated beforehand, ``sensed_lines``, ``visit_lines`` and
``executed_lines`` for what a hand did, ``turn_line`` and ``probed_lines`` for what a machine did. A :class:`Layout`
says how wide the tables may be and whether headings are bold; without one, they are plain::

    for line in answer_lines(tanteo.identify(readings, parts, sd=0.3e-3)):
        print(line)
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.text.answers import answer_lines, prior_words
    from tanteo.text.calibrations import calibration_lines
    from tanteo.text.catalogues import catalogue_lines
    from tanteo.text.cell import cell_lines
    from tanteo.text.examinations import examination_lines
    from tanteo.text.explanations import explanation_lines
    from tanteo.text.layout import PLAIN, Layout, printable
    from tanteo.text.models import part_lines
    from tanteo.text.planned import distinction_lines, plan_lines
    from tanteo.text.presets import preset_lines, rig_lines, robot_lines, sensor_lines
    from tanteo.text.probing import probed_lines, turn_line
    from tanteo.text.sensing import executed_facts, executed_lines, known_words, sensed_lines, visit_lines
    from tanteo.text.sights import sight_lines, sighting_words

__all__ = [
    "PLAIN",
    "Layout",
    "answer_lines",
    "calibration_lines",
    "catalogue_lines",
    "cell_lines",
    "distinction_lines",
    "examination_lines",
    "executed_facts",
    "executed_lines",
    "explanation_lines",
    "known_words",
    "part_lines",
    "plan_lines",
    "preset_lines",
    "printable",
    "prior_words",
    "probed_lines",
    "rig_lines",
    "robot_lines",
    "sensed_lines",
    "sensor_lines",
    "sight_lines",
    "sighting_words",
    "turn_line",
    "visit_lines",
]

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {
        "answers": "answer_lines prior_words",
        "calibrations": "calibration_lines",
        "catalogues": "catalogue_lines",
        "cell": "cell_lines",
        "examinations": "examination_lines",
        "explanations": "explanation_lines",
        "layout": "Layout PLAIN printable",
        "models": "part_lines",
        "planned": "distinction_lines plan_lines",
        "presets": "preset_lines rig_lines robot_lines sensor_lines",
        "probing": "probed_lines turn_line",
        "sensing": "executed_facts executed_lines known_words sensed_lines visit_lines",
        "sights": "sight_lines sighting_words",
    },
)
