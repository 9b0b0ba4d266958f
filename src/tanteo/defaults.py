"""Values of options that the user leaves out, for commands and functions alike; imports nothing."""

from __future__ import annotations

SIGNIFICANCE = 0.01
"""Significance level of all tests of an answer, unless the user states another (``--significance``): a true answer is
rejected in this share of all cases. It is a convention, the 1 % level, not a tuned number."""

TOP = 5
"""Number of hypotheses that an answer reports, unless the user states another (``--top``)."""
