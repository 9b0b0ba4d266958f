"""How the belief went: probabilities and the largest corner sd after each answer, as curves and as a table."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.planning import Added, Session, Step, Stop
from tanteo.render.html.charts import SHARES, STYLES, Curve, bar, curve_chart, lengths_scale
from tanteo.render.html.page import Html, Section, element, join, table
from tanteo.render.html.words import MM, uncertain
from tanteo.words import percent

_IN_TABLE = 2
"""Parts in each row of the table: those that ever led come first."""

_SEEN = 0.01
"""A part that never was more probable has no curve."""

_MOST_NAMES = 3
"""Readings of a step that are named."""


def course_section(session: Session, added: Sequence[Added]) -> Section:
    """What every answer told.

    Args:
        session: That was told something.
        added: What each step told, as :func:`tanteo.planning.explanation.explain` has it.
    """
    lead = (
        "What was asked, why, and what was known after it; 0.7 nats are the information of one yes or no. The curves "
        "go over the answers: the probability of each part, and the largest corner sd of the likeliest one "
        "(logarithmic scale)."
    )
    steps = session.steps
    if not steps:
        return Section("course", "How it went", lead, ())
    told = element("details", element("summary", "What each answer told, as a table"), _rows(session, added))
    asked = _asked(session)
    return Section("course", "How it went", lead, (join([asked, _probabilities(session), _corners(session), told]),))


def goal_words(stop: Stop) -> str:
    """What was to be reached: part and place; nothing where no goal was set."""
    goals = [] if stop.probability is None else [f"the part with {100 * stop.probability:.4g} %"]
    if stop.tolerance is not None:
        of_what = stop.feature or "the corners of the part"
        goals.append(f"{of_what} within {MM * stop.tolerance:.3g} mm at {100 * stop.confidence:.3g} %")
    return f"Goal: {' and '.join(goals)}." if goals else ""


_MOST_ASKED = 12
"""Questions that are told one by one above the charts; of more, the last."""


def _asked(session: Session) -> Html:
    """Line by line: what was asked and why, and what was known after it."""
    names, first = _names(session), max(len(session.steps) - _MOST_ASKED, 0)
    lines = [_line(step, names) for step in session.steps[first:]]
    earlier = element("p", f"The first {first} are in the table below.", class_="note") if first else Html("")
    return join([earlier, element("ol", *lines, class_="asked", start=first + 1)])


def _line(step: Step, names: Sequence[str]) -> Html:
    action, best = step.action, int(np.argmax(step.probabilities))
    question = "Not asked for" if action is None else f"{action.face} of {action.part}"
    after = f"{names[best]} {percent(float(step.probabilities[best]))}"
    sd = f", largest corner sd {uncertain(step.corner_sd)}" if np.isfinite(step.corner_sd) else ""
    reason = "" if action is None else f". {action.reason.message}"
    return element("li", element("strong", question), f"{reason} → {after}{sd}")


def _probabilities(session: Session) -> Html:
    """The parts that led the strongest others, and the unknown object."""
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
    return curve_chart(f"Probabilities after {len(steps)} answers: {final}.", curves, SHARES, places)


def _place(at: str) -> str:
    return at if at == "before" else f"after {at}"


def _corners(session: Session) -> Html:
    steps, names = session.steps, _names(session)
    values = MM * np.array([np.nan, *(s.corner_sd for s in steps)])
    if not np.isfinite(values).any():
        return Html("")
    places = ["before", *(str(k) for k in range(1, len(steps) + 1))]
    leaders = ["", *(names[s.part] if s.part >= 0 else "" for s in steps)]
    said = tuple(f"after {p}: {v:.2g} mm, of {who}" for p, v, who in zip(places, values, leaders, strict=True))
    tolerance = session.stop.tolerance if session.stop.feature is None else None
    goal = None if tolerance is None else (MM * tolerance, f"tolerance of the corners, {MM * tolerance:.3g} mm")
    scale = lengths_scale(values if goal is None else np.r_[values, goal[0]])
    label = f"Largest corner sd after {len(steps)} answers, {values[-1]:.2g} mm at last."
    curve = Curve("largest corner sd of the likeliest part", values, said)
    return curve_chart(label, [curve], scale, places, goal)


def _rows(session: Session, added: Sequence[Added]) -> Html:
    steps, names = session.steps, _names(session)
    shown = _leading(steps, _IN_TABLE)
    headers = (
        "", "readings", "asked at", "met", *(names[k] for k in shown), "unknown object", "largest corner sd",
        "about the part [nats]", "about the pose [nats]", "best narrowed", "to",
    )  # fmt: skip
    rows: list[tuple[Html | str, ...]] = [
        (
            str(n),
            _listed(step.ids) or "told before",
            "not asked for" if step.action is None else f"{step.action.face} of {step.action.part}",
            _listed(tuple(dict.fromkeys(one.met))),
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
        "Met: faces of the part of the answer. About the part: relative entropy of the probabilities after it to those "
        "before. About the pose: how much the logarithm of its volume shrank; none where the likeliest part changed. "
        "Best narrowed: the motion of the part whose standard deviation shrank most, and to what of it was before."
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
    """Parts that led after some answer, the last first; and the strongest others."""
    led = [int(np.argmax(step.probabilities)) for step in reversed(steps)]
    strongest = np.argsort(-np.stack([step.probabilities for step in steps]).max(axis=0), kind="stable").tolist()
    return list(dict.fromkeys([*led, *strongest]))[:max_measurements]


def _share(p: float) -> Html:
    return join([bar(float(p)), element("span", f" {percent(float(p))}")])
