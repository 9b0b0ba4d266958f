"""Report of a plan: the part with the planned readings as numbered arrows, and the result of each reading."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import Vectors
from tanteo.parts import Part, named_feature
from tanteo.planning import Plan, PlannedReading, Probe
from tanteo.posterior import box_corners
from tanteo.render.html.answered import Layer, picture, times
from tanteo.render.html.charts import SHARES, Curve, curve_chart, lengths_scale
from tanteo.render.html.origin import Run
from tanteo.render.html.page import Front, Html, Section, element, fact_list, join, make_page, table
from tanteo.render.html.scene import overlay_numbers, packed, part_document, pose_numbers, view_document
from tanteo.render.html.sections import pose_figures, rerun_section
from tanteo.render.html.ways import Way, find_ways
from tanteo.render.html.words import MM, fixed, length, uncertain
from tanteo.words import percent

_ARROW = 0.3
"""Largest length of an arrow, as a fraction of the part's size, which may be shorter than the stand-off."""


def plan_page(plan: Plan, part: Part, probe: Probe, tolerance: float, confidence: float, run: Run) -> str:
    """Return the report of a plan as the text of one HTML file.

    Args:
        plan: plan to report.
        part: part of the plan.
        probe: sensor model.
        tolerance: tolerance of the corners of the part's box, or of the feature [m].
        confidence: required probability of the tolerance.
        run: origin of the plan.
    """
    ways, enlarged = find_ways(part, plan.T_world_part, plan.readings[-1].covariance) if plan.readings else ((), 1)
    sections = [_steps(plan, tolerance, confidence), _figures(plan)] if plan.readings else []
    sections.append(rerun_section(run, f"{run.made_by}."))
    front = _front(plan, probe, tolerance, confidence, run, ways, enlarged)
    return make_page(front, _scene(plan, part, ways), sections)


def _front(
    plan: Plan, probe: Probe, tolerance: float, confidence: float, run: Run, ways: Sequence[Way], enlarged: int
) -> Front:
    n = len(plan.readings)
    what = plan.part if plan.feature is None else f"{plan.feature} of {plan.part}"
    title = f"No plan for {what} achieves the tolerance."
    if plan.reached:
        count = f"{n} readings place" if n > 1 else "1 reading places" if n else "No reading is needed to place"
        title = f"{count} {what}."
    layers = [Layer("readings", "planned readings"), Layer("names", "numbers")] if n else []
    if plan.feature is not None:
        layers.append(Layer("sticks", plan.feature))
    legend = [("stick", f"{plan.feature}, to which the tolerance applies")] if plan.feature is not None else []
    legend += [("arrow", "planned reading with its number; the tip is the expected point on the part")] if n else []
    overlay = f"overlays: off by 1, 2 and 3 sd after the last{times(enlarged)}"
    facts = fact_list([*_facts(plan, probe, tolerance, confidence), *run.facts])
    side = join([element("h2", "Result"), element("dl", facts, class_="first")])
    shown = picture(
        layers, [ways] if ways else [], legend, [[("overlay", overlay)]] if ways else [], overlays_shown=False
    )
    chip, status = ("✓ planned", "recognized") if plan.reached else ("✕ not reached", "unknown")
    return Front(title, chip, status, plan.message, shown, side)


def _facts(plan: Plan, probe: Probe, tolerance: float, confidence: float) -> list[tuple[str, str]]:
    """Return goal and result of the plan as facts."""
    facts = [
        ("Goal", f"{_all(plan)} within {length(tolerance)}, with {percent(confidence)}"),
        (f"{_worst(plan).capitalize()} before, 1 sd", uncertain(plan.before)),
    ]
    if plan.readings:
        n, last = len(plan.readings), plan.readings[-1]
        facts += [
            (f"{_worst(plan).capitalize()} after {n} reading{'s' * (n > 1)}, 1 sd", uncertain(last.sd)),
            (f"{_all(plan).capitalize()} within the tolerance then, over all placements", percent(last.within)),
            (
                f"The same if every reading hits its face, as at {percent(plan.all_meet)} of the placements",
                percent(last.within_if_hit),
            ),
        ]
    x, y, z = (fixed(v * MM, 2) for v in plan.T_world_part[:3, 3])
    return [
        *facts,
        ("Sensor", probe.name),
        ("Starts before the surface", length(probe.standoff)),
        ("Part expected at, in the world", f"x {x}, y {y}, z {z} mm"),
    ]


def _steps(plan: Plan, tolerance: float, confidence: float) -> Section:
    """Return the section with the result of each reading."""
    lead = (
        f"Expected standard deviation of {_of_what(plan)}, and probability that {_all(plan)} "
        f"{'is' if plan.feature else 'are'} within the tolerance, before the first reading and after each. The first "
        "readings have little effect until enough directions are determined. The standard deviation holds for "
        "placements of the part at which all readings so far hit their faces."
    )
    headers = (
        "", "face", f"{_worst(plan)}, 1 sd [mm]", "P(within)", "if all hit", "this one hits",
        "from x, y, z [mm]", "along", "hits it at x, y, z [mm]",
    )  # fmt: skip
    rows = [_row(n, r) for n, r in enumerate(plan.readings, 1)]
    explanation = (
        "Frame: world. Each row is after its reading. P(within) is the probability over all placements of the part. "
        "'This one hits' is the fraction of the placements at which the reading hits its face."
    )
    note = element("p", explanation, class_="note")
    body = join([*_curves(plan, tolerance, confidence), table(headers, rows, class_="plain"), note])
    return Section("steps", "Result of each reading", lead, (body,))


def _curves(plan: Plan, tolerance: float, confidence: float) -> list[Html]:
    """Return charts of standard deviation and probability after each reading."""
    places = ["before", *(str(k) for k in range(1, len(plan.readings) + 1))]
    sds = MM * np.array([plan.before, *(r.sd for r in plan.readings)])
    within = np.array([np.nan, *(r.within for r in plan.readings)])
    words = ["before", *(f"after {k}" for k in places[1:])]
    sd = Curve(f"{_worst(plan)}, 1 sd", sds, tuple(f"{w}: {v:.2g} mm" for w, v in zip(words, sds, strict=True)))
    if_hit = np.array([np.nan, *(r.within_if_hit for r in plan.readings)])
    chances = [
        Curve(name, v, tuple(f"{w}: {percent(p)}" for w, p in zip(words, v, strict=True)), style)
        for style, (name, v) in enumerate((("over all placements", within), ("if all hit their faces", if_hit)))
    ]
    return [
        curve_chart(
            f"Standard deviation of {_of_what(plan)} over {len(plan.readings)} readings, {sds[-1]:.2g} mm at the end.",
            [sd], lengths_scale(np.r_[sds, MM * tolerance]), places,
            (MM * tolerance, f"tolerance, {length(tolerance)}"),
        ),
        curve_chart(
            f"Probability to be within the tolerance, {percent(within[-1])} at the end.",
            chances, SHARES, places, (confidence, f"required, {percent(confidence)}"),
        ),
    ]  # fmt: skip


def _of_what(plan: Plan) -> str:
    """Return the name of what the tolerance concerns, for a sentence."""
    return plan.feature or "the most uncertain corner of the part's box"


def _worst(plan: Plan) -> str:
    """Return the name of the standard deviation that the tolerance concerns."""
    return plan.feature or "largest corner sd"


def _all(plan: Plan) -> str:
    return plan.feature or "all corners"


def _row(n: int, r: PlannedReading) -> tuple[str, ...]:
    return (
        str(n), r.face, f"{MM * r.sd:.2g}", percent(r.within), percent(r.within_if_hit), percent(r.meets),
        _three(MM * r.origin, 1), _three(r.direction, 3), _three(MM * r.point, 1),
    )  # fmt: skip


def _three(values: Vectors, digits: int) -> str:
    return ", ".join(fixed(v, digits) for v in values)


def _figures(plan: Plan) -> Section:
    lead = "The expected pose maps points of the part to the world; the covariance holds after the last reading."
    return Section("figures", "All figures", lead, (pose_figures(plan.T_world_part, plan.readings[-1].covariance),))


def _scene(plan: Plan, part: Part, ways: Sequence[Way]) -> dict[str, Any]:
    T = plan.T_world_part
    corners = box_corners(part) @ T[:3, :3].T + T[:3, 3]
    arrows = _arrows(plan)
    points = np.array([r.point for r, _ in arrows]).reshape(-1, 3)
    way = points - np.array([r.origin for r, _ in arrows]).reshape(-1, 3)
    long = np.linalg.norm(way, axis=1, keepdims=True)
    starts = points - way / np.maximum(long, 1e-12) * np.minimum(long, _ARROW * part.diagonal)
    seen = np.concatenate([corners, starts])
    centre = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    size = 2 * float(np.linalg.norm(seen - centre, axis=1).max())
    feature = None if plan.feature is None else named_feature(part, plan.feature)
    lines = np.zeros((0, 2, 3)) if feature is None else SE3.apply(T, feature.outline) - centre
    return {
        **view_document(centre, size),
        "seen": packed(seen - centre),
        "arrows": True,
        "parts": [part_document(part, 1)],
        "readings": {
            "names": [", ".join(map(str, numbers)) for _, numbers in arrows],
            "words": [_description(plan, numbers) for _, numbers in arrows],
            "points": packed(points - centre),
            "radii": packed(np.zeros(len(points))),
            "starts": packed(starts - centre),
        },
        "free": "",
        "hypotheses": [
            {
                "part": 0, "pose": pose_numbers(T, centre), "wrong": [0] * len(points), "sticks": packed(lines),
                "overlays": overlay_numbers(ways, centre),
            }
        ],
    }  # fmt: skip


def _arrows(plan: Plan) -> list[tuple[PlannedReading, list[int]]]:
    """Return the distinct readings with their numbers; repeated readings have one arrow."""
    out: dict[bytes, tuple[PlannedReading, list[int]]] = {}
    for n, r in enumerate(plan.readings, 1):
        out.setdefault(np.round(np.r_[r.origin, r.direction], 9).tobytes(), (r, []))[1].append(n)
    return list(out.values())


def _description(plan: Plan, numbers: Sequence[int]) -> str:
    r = plan.readings[numbers[0] - 1]
    name = f"reading {numbers[0]}" if len(numbers) == 1 else f"readings {', '.join(map(str, numbers))}"
    return f"{name}: {r.face}; {_worst(plan)} {uncertain(r.sd)} after {numbers[0]}"
