"""Estimate errors that all readings share: a bent stylus, a robot that is out of calibration.

A cobot touches the clamp with a ball on a stylus whose tip is one or two millimetres away from its nominal position.
The touches repeat to 0.1 mm, but their error is the same every time in the hand's frame, so averaging does not help.
If its standard deviation is passed to ``locate``, the error is estimated together with the pose. Otherwise 0.3 mm is
assumed, or 2 mm if the readings contradict that, and the answer states the assumption and the estimate.

    python examples/04_shared_errors.py
"""

from pathlib import Path

import numpy as np

import tanteo

HERE = Path(__file__).parent
TRUTH = np.array([0.520, -0.040, 0.015])
part = tanteo.read_part(HERE / "parts" / "clamp.step")
readings = tanteo.read_readings(HERE / "readings" / "clamp_ball_tip.csv")

for words, tip_sd in (("not stated", None), ("stated as sd 1.5, 1.5, 0.3 mm", [1.5e-3, 1.5e-3, 0.3e-3])):
    answer = tanteo.locate(readings, part, tip_sd=tip_sd)
    best = answer.hypotheses[0]
    error = np.linalg.norm(best.T_world_part[:3, 3] - TRUTH)
    print(f"error of the tip {words}: {answer.status}")
    print(f"    origin is {1e3 * error:.2f} mm off, largest corner sd {1e3 * best.corner_sd:.2f} mm")
    print(f"    {answer.message}")

# the absolute error of the robot moves part and world together: the error is the same for every reading
answer = tanteo.locate(readings, part, tip_sd=[1.5e-3, 1.5e-3, 0.3e-3], robot="generic_6axis_uncalibrated")
print(f"with the robot's own error: largest corner sd {1e3 * answer.hypotheses[0].corner_sd:.2f} mm in the world")
