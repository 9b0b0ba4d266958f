"""Identify a part from seven sets of readings, with all four statuses of an answer.

``identify`` always answers with a status. ``recognized``: one part, one pose. ``ambiguous``: several remain possible,
and the message states what to sense next. ``unknown``: none of the parts. ``insufficient``: the readings leave a motion
of the part undetermined. Probabilities are over all parts, all poses and the unknown object, and sum to one.

    python examples/01_which_part.py
"""

from pathlib import Path

import tanteo

HERE = Path(__file__).parent
parts = tanteo.read_parts(HERE / "parts").parts  # STEP files state their unit; for STL pass unit="mm"

for name in ("bracket_left", "bracket_right", "step_15mm", "step_not_felt", "square_post", "unknown_part", "too_few"):
    readings = tanteo.read_readings(HERE / "readings" / f"{name}.csv")
    answer = tanteo.identify(readings, parts)
    print(f"{name}: {answer.status}. {answer.message}")
    if answer.status != "recognized":
        for hypothesis in answer.hypotheses[:2]:
            print(f"    {hypothesis.probability:6.1%}  {hypothesis.part}")
        print(f"    {answer.unknown_probability:6.1%}  unknown object")
