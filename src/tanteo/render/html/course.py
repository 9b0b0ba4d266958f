"""Section with the course of a session: probabilities and largest corner sd after each step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.planning import Session, Step, Stop
from tanteo.planning.explanation import Added
from tanteo.render.html.charts import SHARES, STYLES, Curve, bar, curve_chart, lengths_scale
from tanteo.render.html.page import Html, Section, element, join, prose, table
from tanteo.render.html.words import MM, uncertain
from tanteo.words import percent

_IN_TABLE = 2
"""Number of parts in the table; parts that were most probable after some step come first."""

_SEEN = 0.01
"""Smallest probability for which a part has a curve."""

_MOST_NAMES = 3
"""Largest number of readings of a step whose names are printed."""


def course_section(session: Session, added: Sequence[Added]) -> Section:
    """Return the section with the result of every step.

    Args:
        session: session, which may have no readings.
        added: information of each step, see :func:`tanteo.planning.explanation.explain`.
    """
    lead = (
        "Each reading with its reason and its result. Information is in nats: a decision between two equally "
        "probable cases needs 0.7. The curves show the probability of each part, and the largest corner sd "
        "of the most probable one (logarithmic scale)."
    )
    steps = session.steps
    if not steps:
        return Section("course", "How it went", lead, ())
    details = element("details", element("summary", "Result of each step as a table"), _rows(session, added))
    listed = _step_list(session)
    return Section(
        "course", "How it went", lead, (join([listed, _probabilities(session), _corners(session), details]),)
    )


def goal_words(stop: Stop) -> str:
    """Return the goal of a session as a sentence; empty without a goal.

    Args:
        stop: goal of the session.
    """
    goals = [] if stop.probability is None else [f"the part with {100 * stop.probability:.4g} %"]
    if stop.tolerance is not None:
        of_what = stop.feature or "the corners of the part"
        goals.append(f"{of_what} within {MM * stop.tolerance:.3g} mm at {100 * stop.confidence:.3g} %")
    return f"Goal: {' and '.join(goals)}." if goals else ""


_MOST_LISTED = 12
"""Largest number of steps in the list above the charts, which has the last ones."""


def _step_list(session: Session) -> Html:
    """Return the steps as a list: reading, reason and result."""
    names, first = _names(session), max(len(session.steps) - _MOST_LISTED, 0)
    lines = [_line(step, names) for step in session.steps[first:]]
    earlier = element("p", f"The first {first} steps are in the table below.", class_="note") if first else Html("")
    return join([earlier, element("ol", *lines, class_="steps", start=first + 1)])


def _line(step: Step, names: Sequence[str]) -> Html:
    action, best = step.action, int(np.argmax(step.probabilities))
    question = "Not requested" if action is None else action.aim
    after = f"{names[best]} {percent(float(step.probabilities[best]))}"
    sd = f", largest corner sd {uncertain(step.corner_sd)}" if np.isfinite(step.corner_sd) else ""
    reason = "" if action is None else f". {action.reason.message}"
    return element("li", element("strong", question), prose(f"{reason} → {after}{sd}"))


def _probabilities(session: Session) -> Html:
    """Return curves of the most probable parts and of the unknown object."""
    steps, names = session.steps, _names(session)
    start = session.start
    before = np.bincount(start.part, weights=start.weights, minlength=len(start.targets)) * (1 - start.priors.unknown)
    shown = [k for k in _leading(steps, STYLES - 1) if max(before[k], *(s.probabilities[k] for s in steps)) > _SEEN]
    places = ["before", *(str(k) for k in range(1, len(steps) + 1))]
    series = [
        (names[k], np.array([before[k], *(s.probabilities[k] for s in steps)]), style) for style, k in enumerate(shown)
    ]
    none = np.array([start.priors.unknown, *(s.unknown for s in steps)])
    series.append(("unknown object", none, STYLES - 1))
    curves = [
        Curve(name, p, tuple(f"{name}, {_place(at)}: {percent(v)}" for at, v in zip(places, p, strict=True)), style)
        for name, p, style in series
    ]
    final = ", ".join(f"{c.name} {percent(c.values[-1])}" for c in curves)
    return curve_chart(f"Probabilities after {len(steps)} steps: {final}.", curves, SHARES, places)


def _place(at: str) -> str:
    return at if at == "before" else f"after {at}"


def _corners(session: Session) -> Html:
    steps, names = session.steps, _names(session)
    values = MM * np.array([np.nan, *(s.corner_sd for s in steps)])
    if not np.isfinite(values).any():
        return Html("")
    places = ["before", *(str(k) for k in range(1, len(steps) + 1))]
    leaders = ["", *(names[s.part] if s.part >= 0 else "" for s in steps)]
    tooltips = tuple(f"after {p}: {v:.2g} mm, of {who}" for p, v, who in zip(places, values, leaders, strict=True))
    tolerance = session.stop.tolerance if session.stop.feature is None else None
    goal = None if tolerance is None else (MM * tolerance, f"tolerance of the corners, {MM * tolerance:.3g} mm")
    scale = lengths_scale(values if goal is None else np.r_[values, goal[0]])
    label = f"Largest corner sd after {len(steps)} steps, {values[-1]:.2g} mm at the end."
    curve = Curve("largest corner sd of the most probable part", values, tooltips)
    return curve_chart(label, [curve], scale, places, goal)


def _rows(session: Session, added: Sequence[Added]) -> Html:
    steps, names = session.steps, _names(session)
    shown = _leading(steps, _IN_TABLE)
    headers = (
        "", "readings", "requested at", "hit", *(names[k] for k in shown), "unknown object", "largest corner sd",
        "about the part [nats]", "about the pose [nats]", "best reduced motion", "to",
    )  # fmt: skip
    rows: list[tuple[Html | str, ...]] = [
        (
            str(n),
            _listed(step.ids) or "known already",
            "not requested" if step.action is None else step.action.aim,
            _listed(tuple(dict.fromkeys(one.faces))),
            *(_share(step.probabilities[k]) for k in shown),
            _share(step.unknown),
            _number(MM * step.corner_sd, "{:.2g} mm"),
            _number(one.about_part, "{:.2f}"),
            _number(one.about_pose, "{:.2f}"),
            "–" if one.motion is None else one.motion.brief,
            _number(100 * one.narrowed, "{:.0f} %"),
        )
        for n, (step, one) in enumerate(zip(steps, added, strict=True), 1)
    ]
    note = (
        "Hit: faces of the answer's part. About the part: relative entropy of the probabilities after and before the "
        "step. About the pose: decrease of the logarithm of its volume, empty if the most probable part changed. Best "
        "reduced motion: the motion whose standard deviation decreased most, and the remaining fraction."
    )
    return join([table(headers, rows, class_="shares plain"), element("p", note, class_="note")])


def _listed(names: tuple[str, ...]) -> str:
    rest = len(names) - _MOST_NAMES
    return ", ".join(names[:_MOST_NAMES]) + (f" and {rest} more" if rest > 0 else "")


def _number(value: float, form: str) -> str:
    return form.format(value) if np.isfinite(value) else "–"


def _names(session: Session) -> tuple[str, ...]:
    return tuple(target.part.name for target in session.start.targets)


def _leading(steps: Sequence[Step], max_measurements: int) -> list[int]:
    """Return the parts that were most probable after some step, the last first, then the most probable others."""
    led = [int(np.argmax(step.probabilities)) for step in reversed(steps)]
    strongest = np.argsort(-np.stack([step.probabilities for step in steps]).max(axis=0), kind="stable").tolist()
    return list(dict.fromkeys([*led, *strongest]))[:max_measurements]


def _share(p: float) -> Html:
    return join([bar(float(p)), element("span", f" {percent(float(p))}")])
