"""All figures of a pose, with frame and unit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.lie import SO3
from tanteo.report.html import Html, element, join, table
from tanteo.report.scene import Candidate
from tanteo.report.section import Section, per_hypothesis
from tanteo.report.words import MM, fixed
from tanteo.typing import Covariances, FloatArray, Transforms


def figure_section(candidates: Sequence[Candidate]) -> Section:
    """Pose, covariance and fit of every hypothesis."""
    lead = "The pose maps points of the part to the world. Every figure names its frame and its unit."
    return Section("figures", "All figures", lead, per_hypothesis(candidates, _figures))


def _figures(candidate: Candidate) -> Html:
    h = candidate.hypothesis
    more = [
        ("largest corner sd of the box, 1 sd", f"{MM * h.corner_sd:.3g}", "mm", "any direction"),
        ("rms distance of readings", f"{MM * h.rms:.3g}", "mm", "–"),
        ("chi-square", f"{h.chi2:.3g} with {h.dof} degrees of freedom", "–", "–"),
        ("p-value", f"{h.p_value:.3g}", "–", "–"),
    ]
    return join([pose_figures(h.T_world_part, h.covariance, more), element("p", f"CAD file: {h.file}", class_="note")])


def pose_figures(T: Transforms, C: Covariances, more: Sequence[Sequence[str]] = ()) -> Html:
    """A pose and its covariance, as a table and as matrices.

    Args:
        T: The pose, part to world ``(4, 4)``.
        C: Its covariance ``(6, 6)``, part frame, right perturbation [m, rad].
        more: Further rows: figure, value, unit, frame.
    """
    R = T[:3, :3]
    in_world = np.sqrt(np.diag(R @ C[:3, :3] @ R.T))
    sds, q = np.sqrt(np.diag(C)), SO3.as_quaternion(R)
    rows: list[Sequence[str]] = [
        (f"{axis} of the part's origin", f"{fixed(MM * p, 3)} ± {MM * s:.3g}", "mm", "world")
        for axis, p, s in zip("xyz", T[:3, 3], in_world, strict=True)
    ]
    rows.append(("quaternion w, x, y, z", ", ".join(fixed(v, 6) for v in q), "–", "part to world"))
    rows += [
        (f"turn about {axis}, 1 sd", f"{np.degrees(s):.3g}", "deg", "part")
        for axis, s in zip("xyz", sds[3:], strict=True)
    ]
    numbers = _matrix(["row x", "row y", "row z", "row 4"], T, "{:.9g}")
    pose = table(["", "x", "y", "z", "position"], numbers, class_="plain")
    names = ["x", "y", "z", "rx", "ry", "rz"]
    covariance = table(["", *names], _matrix(names, C, "{:.3e}"), class_="plain")
    return join(
        [
            table(["figure", "value", "unit", "frame"], [*rows, *more]),
            element("details", element("summary", "Pose as a matrix [m]"), pose),
            element("details", element("summary", "Covariance [m, rad], part frame, right perturbation"), covariance),
        ]
    )


def _matrix(names: Sequence[str], M: FloatArray, form: str) -> list[list[str]]:
    return [[name, *(form.format(v) for v in row)] for name, row in zip(names, M, strict=True)]
