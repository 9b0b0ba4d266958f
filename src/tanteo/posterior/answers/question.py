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
    """Return the parts as a sequence, and refuse invalid arguments.

    Raises:
        InputError: no part, ``significance`` outside (0, 1), no ``top``, no seed, no priors.
    """
    found = as_parts("parts", parts)
    if not len(found):
        raise InputError("parts: expected at least one part, got none.")
    check_significance(significance)
    check_count("top", top, 1)
    check_count("seed", seed, 0)
    if priors is not None:
        check_kind("priors", priors, Priors, "What is known of the pose is Priors(pose=...), from tanteo.posterior.")
    return found


def with_elapsed(answer: Answer, **seconds: float) -> Answer:
    """Return the answer with further stages in ``elapsed`` (loading, measuring), which the total includes."""
    elapsed = {**seconds, **answer.elapsed}
    elapsed["total"] = answer.elapsed.get("total", 0.0) + sum(seconds.values())
    return replace(answer, elapsed=elapsed)


class Clock:
    """Elapsed seconds by stage."""

    def __init__(self) -> None:
        self._start = self._last = time.perf_counter()
        self._laps: dict[str, float] = {}

    def lap(self, name: str) -> None:
        """Close a stage."""
        now = time.perf_counter()
        self._laps[name], self._last = now - self._last, now

    def laps(self) -> dict[str, float]:
        """Return the seconds of every stage, and their total."""
        return {**self._laps, "total": time.perf_counter() - self._start}
