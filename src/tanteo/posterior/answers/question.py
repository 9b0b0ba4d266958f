"""Checks of the arguments of an inference, and its elapsed time."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from tanteo.errors import InputError, check_kind
from tanteo.geometry.limits import check_count, check_significance
from tanteo.parts import as_parts
from tanteo.posterior.answers.priors import Priors
from tanteo.posterior.answers.results import Answer


def check_question(parts: Any, significance: float, top: int, seed: int, priors: Priors | None) -> Sequence[Any]:
    """Check the arguments of an inference, and return the parts as a sequence.

    Raises:
        InputError: no part, ``significance`` outside (0, 1), ``top`` below 1, a negative seed, or priors of another
            type.
    """
    found = as_parts("parts", parts)
    if not len(found):
        raise InputError("parts: expected at least one part, got none.")
    check_significance(significance)
    check_count("top", top, 1)
    check_count("seed", seed, 0)
    if priors is not None:
        check_kind("priors", priors, Priors, "Pass the prior of the pose as Priors(pose=...), from tanteo.posterior.")
    return found


def with_elapsed(answer: Answer, **seconds: float) -> Answer:
    """Return the answer with the seconds of further stages (loading, measuring), which the total then includes."""
    elapsed = {**seconds, **answer.elapsed}
    elapsed["total"] = answer.elapsed.get("total", 0.0) + sum(seconds.values())
    return replace(answer, elapsed=elapsed)


class Clock:
    """Stopwatch of the stages of an inference."""

    def __init__(self) -> None:
        self._start = self._last = time.perf_counter()
        self._laps: dict[str, float] = {}

    def lap(self, name: str) -> None:
        """End the current stage and store its duration under a name."""
        now = time.perf_counter()
        self._laps[name], self._last = now - self._last, now

    def laps(self) -> dict[str, float]:
        """Return the seconds of each stage by name, and their total."""
        return {**self._laps, "total": time.perf_counter() - self._start}
