"""Short texts of a report: verdict, facts and figures."""

from __future__ import annotations

import numpy as np

from tanteo.parts import Part
from tanteo.posterior import Answer, Hypothesis
from tanteo.posterior.answers import corner_sd
from tanteo.render.html.contacts import Sensed
from tanteo.words import from_surface, headline_of, p_equals

MM = 1e3

SIGNS = {"recognized": "✓", "ambiguous": "?", "unknown": "✕", "insufficient": "…"}
"""Sign of each status, so that colour is not the only cue."""

_MOST_NAMES = 6


def headline(answer: Answer) -> str:
    """Return the verdict of an answer as a sentence: the part, and how well it is located.

    Args:
        answer: answer to report.
    """
    return headline_of(answer.findings)


def facts(hypothesis: Hypothesis, part: Part, sensed: Sensed, significance: float) -> list[tuple[str, str]]:
    """Return the main figures of a hypothesis, as name and value.

    Args:
        hypothesis: hypothesis to report.
        part: part of the hypothesis.
        sensed: readings of the answer.
        significance: significance level of the answer's tests.
    """
    n, wrong = len(sensed.measured), hypothesis.outliers
    used = len({reading for reading, _ in hypothesis.pairings} & set(sensed.measured.ids))
    x, y, z = (fixed(v * MM, 2) for v in hypothesis.T_world_part[:3, 3])
    rows = [
        ("Position in the world", f"x {x}, y {y}, z {z} mm"),
        ("Largest corner sd", uncertain(hypothesis.corner_sd)),
        ("Readings that fit", _fitting(used, n, len(sensed.measured.free))),
    ]
    if hypothesis.covariance_relative is not None and not hypothesis.unobserved:
        same = corner_sd(part, hypothesis.covariance_relative)
        rows.insert(2, ("Largest corner sd if the shared errors were known", uncertain(same)))
    if wrong:
        rows.append(("Readings that do not fit", _wrong(hypothesis)))
    if hypothesis.unobserved:
        rows.append(("Not observed", "; ".join(hypothesis.unobserved)))
    if hypothesis.symmetry_order > 1:
        rows.append(("Symmetry", f"{hypothesis.symmetry_order} equivalent poses, shown as one"))
    elif hypothesis.symmetry_axis is not None:
        rows.append(("Symmetry", "rotations about its axis are equivalent"))
    return [*rows, ("Do the readings agree?", _agreement(hypothesis, significance))]


def _fitting(used: int, hits: int, free: int) -> str:
    """Return the number of fitting readings, with the number of beams that hit nothing."""
    nothing = f"; {'one' if free == 1 else free} hit nothing" if free else ""
    return f"{used} of {hits + free}{nothing}"


def _wrong(hypothesis: Hypothesis) -> str:
    off = hypothesis.outlier_distances or (float("nan"),) * len(hypothesis.outliers)
    names = [
        name + (f" ({from_surface(d, 3)})" if np.isfinite(d) else "")
        for name, d in zip(hypothesis.outliers, off, strict=True)
    ]
    rest = len(names) - _MOST_NAMES
    return ", ".join(names[:_MOST_NAMES]) + (f" and {rest} more" if rest > 0 else "")


def _agreement(hypothesis: Hypothesis, significance: float) -> str:
    if hypothesis.dof == 0:
        return "too few readings to check"
    verdict = "no, they contradict each other" if hypothesis.p_value < significance else "yes, within their noise"
    return f"{verdict} ({p_equals(hypothesis.p_value)})"


def uncertain(metres: float) -> str:
    """Return a standard deviation in millimetres with two digits.

    Args:
        metres: standard deviation [m].
    """
    return f"{float(f'{MM * metres:.2g}'):g} mm"


def length(metres: float) -> str:
    """Return a length in millimetres with three digits.

    Args:
        metres: length [m].
    """
    return f"{float(f'{MM * metres:.3g}'):g} mm"


def fixed(value: float, digits: int) -> str:
    """Return a number with fixed decimals, never minus zero.

    Args:
        value: number.
        digits: number of decimals.
    """
    return f"{round(value, digits) + 0.0:.{digits}f}"
