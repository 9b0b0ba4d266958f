"""Results as lines of text and tables for a terminal or a log, as the command line prints them.

- Answers: ``answer_lines``; images: ``sight_lines``.
- Plans: ``plan_lines`` and ``distinction_lines``; the information of each reading: ``explanation_lines``.
- Inputs: ``part_lines``, ``sensor_lines``, ``robot_lines``, ``rig_lines`` and ``calibration_lines``.
- Sessions with a hand: ``sensed_lines``, ``visit_lines`` and ``executed_lines``; with a machine: ``turn_line`` and
  ``probed_lines``.

A :class:`Layout` has the width of tables and the style of headings; without one, headings are plain::

    for line in answer_lines(tanteo.identify(readings, parts, sd=0.3e-3)):
        print(line)
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
