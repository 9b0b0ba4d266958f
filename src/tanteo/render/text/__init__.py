"""Results in words and tables for a terminal or a log: each function gives the lines that the command line prints.

``answer_lines`` for an answer, ``sight_lines`` for an image, ``plan_lines`` and ``distinction_lines`` for plans,
``explanation_lines`` for what each reading told, ``part_lines``, ``sensor_lines``, ``robot_lines``, ``rig_lines`` and
``calibration_lines`` for what is read or estimated beforehand, ``sensed_lines``, ``visit_lines`` and
``executed_lines`` for what a hand did, ``turn_line`` and ``probed_lines`` for what a machine did. A :class:`Layout`
says how wide the tables may be and whether headings are bold; without one, they are plain::

    for line in answer_lines(tanteo.identify(readings, parts, sd=0.3e-3)):
        print(line)
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
