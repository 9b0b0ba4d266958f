"""Default values of options, for commands and for functions; imports nothing."""

from __future__ import annotations

SIGNIFICANCE = 0.01
"""Significance level of all tests of an answer, unless the user states another (``--significance``): a true answer is
rejected with this probability. It is a convention, the 1 % level, not a tuned number."""

TIP_SD = 3e-4
"""Standard deviation of a tip's offset along each axis of the hand, if the hand's poses are given and the user states
none [m]: a tool centre point taught by four poses on a typical robot is off by some tenths of a millimetre."""

WIDE_TIP_SD = 2e-3
"""The same if the readings contradict it [m]: a bent stylus, or one exchanged without teaching it again."""

TOP = 5
"""Number of hypotheses that an answer reports, unless the user states another (``--top``)."""

DETECTION_TRUST = 0.9
"""Largest probability that a pose of a detector is right: scores of detectors are seldom calibrated."""

DETECTION_SDS = 0.01, 0.0873
"""Standard deviations of a pose of a detector without a covariance, for each axis [m, rad]: 10 mm, 5 degrees."""
