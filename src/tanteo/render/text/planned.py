"""Plans as lines of text."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tanteo.planning.following import NextReading
from tanteo.render.text.layout import PLAIN, Layout, printable
from tanteo.words import headline_of, percent

if TYPE_CHECKING:
    from tanteo.geometry.typing import FloatArray, Vectors
    from tanteo.planning import Plan, Probe
    from tanteo.planning.discrimination import Discrimination
    from tanteo.posterior import Answer
    from tanteo.words import Finding


def plan_lines(
    plan: Plan, probe: Probe, before: str, *, anywhere: str = "any side, from below too", layout: Layout = PLAIN
) -> list[str]:
    """Return a plan as lines of text: the prior, and the readings in order.

    Args:
        plan: plan to print.
        probe: sensor model.
        before: description of the prior pose.
        anywhere: description of the approach directions of a probe without a limit.
        layout: width and style of the output.
    """
    worst = plan.feature or "largest corner sd"
    lines = [
        layout.bold(printable(plan.message)),
        f"  sensor      {probe.name}",
        f"  from        {anywhere if probe.approach is None else _within(probe.approach, probe.cone)}",
        f"  part        {printable(plan.part)}, {before}: {worst} {1e3 * plan.before:.3g} mm, 1 sd",
        "",
    ]
    rows = [
        (
            str(n),
            _three(1e3 * r.origin, 1),
            _three(r.direction, 3),
            _three(1e3 * r.point, 1),
            r.face,
            f"{1e3 * r.sd:.3g}",
            f"{r.within:.3f}",
            f"{r.within_if_hit:.3f}",
            f"{r.meets:.0%}",
        )
        for n, r in enumerate(plan.readings, 1)
    ]
    placed = worst if worst.endswith(" sd") else f"{worst} sd"
    headers = ("", "from (mm)", "along", "hits (mm)", "face", f"{placed} (mm)", "P(within)", "if hit", "hits")
    notes = [
        "Frame: world. Each row holds after its reading. 'P(within)' is over all placements. The last column is the",
        "fraction of them at which the reading hits its face. sd and 'if hit' assume that all readings so far do.",
    ]
    return [*lines, *layout.table(headers, rows, left=(4,)), "", *notes] if rows else lines


def _within(approach: FloatArray, cone: float) -> str:
    return f"within {np.degrees(cone):g} deg of the direction ({_three(approach, 3).replace(' ', ', ')})"


def _three(values: Vectors, digits: int) -> str:
    """Return three numbers, never minus zero."""
    return " ".join(f"{v:.{digits}f}" for v in np.round(values, digits) + 0.0)


def distinction_lines(found: Discrimination, *, layout: Layout = PLAIN) -> list[str]:
    """Return the reading that discriminates two parts as lines of text.

    Args:
        found: best reading to discriminate the parts.
        layout: width and style of the output.
    """
    lines = [layout.bold(printable(found.message))]
    if np.isfinite(found.origin).all():
        start, way = (_three(v, d).replace(" ", ", ") for v, d in ((1e3 * found.origin, 1), (found.direction, 3)))
        wide = max(11, *map(len, found.parts))
        lines += [
            f"  from        ({start}) mm along ({way}), in the frame of {printable(found.parts[0])}, to which the "
            "other is aligned",
            *(
                f"  {printable(name):{wide}} {'nothing' if np.isinf(r) else f'{1e3 * r:.2f} mm, sd {1e3 * s:.2f} mm'}"
                for name, r, s in zip(found.parts, found.ranges, found.sds, strict=True)
            ),
            f"  information {found.information / np.log(2):.0%} of a complete decision between them",
        ]
    return lines


_SHOWN = 6
"""Largest number of hypotheses whose expected readings are listed."""


def next_lines(answer: Answer, found: NextReading | Finding | None, *, layout: Layout = PLAIN) -> list[str]:
    """Return the next reading after an answer as lines of text.

    Args:
        answer: the answer.
        found: result of :func:`tanteo.planning.following.next_reading`.
        layout: width and style of the output.
    """
    head = layout.bold(printable(f"{answer.status}: {headline_of(answer.findings)}"))
    if not isinstance(found, NextReading):
        if found is None and answer.status == "recognized":
            return [head, "No further reading is needed for the status; --goal 0.5mm states a required accuracy."]
        return [head, printable(found.message if found is not None else answer.message)]
    one, step = found.action, found.finding
    place, start = (", ".join(f"{1e3 * v:z.2f}" for v in point) for point in (step.point, step.start))
    along = ", ".join(f"{round(v, 4) + 0.0:.4f}" for v in step.direction)
    lines = [
        head,
        printable(f"Next: {step.face} of {step.part}"),
        f"  point       {place} mm (world)",
        f"  start       {start} mm",
        f"  direction   {along}",
        f"  excludes    {percent(-np.expm1(-one.gain))} of the possible parts and poses, as expected",
        "  expected distance from the start to the contact" + (", of the ball's centre:" if one.radius else ":"),
    ]
    for e in step.expected[:_SHOWN]:
        where = f"{1e3 * e.distance:8.2f} +- {1e3 * e.sd:.2f} mm on {e.face}" if e.face else "    nothing hit"
        lines.append(printable(f"    {where}, if it is {e.part} with {percent(e.probability)}"))
    if len(step.expected) > _SHOWN:
        lines.append(f"    {len(step.expected) - _SHOWN} less probable hypotheses are not listed.")
    if any(not e.face for e in step.expected[:_SHOWN]):
        lines.append(
            "  Without a contact, add a row with status none: start, direction and max_mm, the motion's length."
        )
    if not step.clear:
        lines.append("  The part may be in the path, because its pose is very uncertain: approach slowly.")
    return lines
