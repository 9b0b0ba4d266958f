"""Panels of the live page as escaped HTML: status, probabilities as bars, steps, and legend."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import resources

import numpy as np

from tanteo.planning import Step
from tanteo.render.html.charts import bar
from tanteo.render.html.page import Html, element
from tanteo.render.live import colors
from tanteo.render.live.drawing import OPEN
from tanteo.render.live.primitives import Colour
from tanteo.render.live.snapshot import RIVAL_LAYERS, Result, Snapshot, by_hand
from tanteo.words import headline_of, percent
from tanteo.words.findings import Finding, Leader, NoPartLeft, NothingSensedYet, PlacesSensed, PlannerResult, StepResult

_BARS = 5
"""Number of parts with a bar of their own."""

_EVEN = 1.01
"""Numerical: largest ratio of the probability of a part to the mean of all at which the parts are equally probable."""

_LINES = 8
"""Number of listed steps, the last ones."""

GRID = 0.05
"""Side length of a grid square [m]."""

GRID_WORDS = f"A grid square is {1e3 * GRID:.0f} mm. Beams that hit nothing are drawn {1e3 * OPEN:.0f} mm long."

STYLE = element(
    "style", Html(resources.files("tanteo.render.live").joinpath("page.css").read_text(encoding="utf-8"))
).text
"""Style of these texts, and of viser's own ones, with more contrast."""


def _framed(*children: Html | str) -> str:
    return element("div", *children, class_="tanteo").text


def headline(now: Snapshot) -> str:
    """Return the most probable part and its probability as one sentence.

    Args:
        now: session at one moment.
    """
    found = leader(now)
    return headline_of((found,)) or found.message


def leader(now: Snapshot) -> Finding:
    """Return the most probable part as a finding.

    Args:
        now: session at one moment.
    """
    best = int(now.order[0])
    shares = now.state.of_parts()
    probability = float(shares[best])
    if not now.steps:
        even = probability <= _EVEN * shares.mean()
        return NothingSensedYet(len(now.names), now.names[best], None if even else probability)
    if not len(now.state.weights):
        return NoPartLeft()
    return Leader(now.names[best], probability, now.decided, float(now.steps[-1].corner_sd))


def status(now: Snapshot, note: str = "", help_: str = "", rival: str = "") -> str:
    """Return the status panel.

    Args:
        now: session at one moment.
        note: remark on the last reading.
        help_: instruction for the user.
        rival: state of the policy in a contest.
    """
    rows = [element("div", headline(now), class_="say"), element("div", counted(now))]
    rows += [element("div", rival)] if rival else []
    rows += [element("div", text, class_="soft") for text in (note, help_) if text]
    return _framed(*rows)


def verdict(now: Snapshot, words: Sequence[str], table: str = "") -> str:
    """Return the status panel at the end of a session.

    Args:
        now: session at its end.
        words: sentences of the result; the first one is printed large.
        table: comparison with the policy, as HTML.
    """
    rows = [element("div", text, class_="say" if k == 0 else None) for k, text in enumerate([*words, counted(now)])]
    return _framed(*rows, Html(table))


def standing(steps: Sequence[Step], places: int, *, through: bool) -> str:
    """Return the certainty of the policy in a contest as a sentence, without its answer.

    Args:
        steps: steps of the policy so far.
        places: number of steps of the user so far.
        through: whether the policy has finished.
    """
    if not steps:
        return PlannerResult(0).message
    last = steps[-1]
    probability = float(last.probabilities.max(initial=0.0))
    finished = through and len(steps) < places
    return PlannerResult(len(steps), probability, float(last.corner_sd), finished).message


def compared(mine: Result, planned: Result, places: tuple[int, int], *, truth: bool) -> str:
    """Return an HTML table that compares the runs of user and policy on the same scene with the same errors.

    Args:
        mine: result of the user's run.
        planned: result of the policy.
        places: numbers of places in the user's run that the policy and the user chose.
        truth: whether the real pose is known.
    """
    name = "you" if not places[0] else f"you {places[1]}, policy {places[0]}"
    rows: list[tuple[str, str, str]] = [
        ("places", f"{mine.places}", f"{planned.places}"),
        *((words, _shown(read(mine)), _shown(read(planned))) for words, read in _COMPARED),
    ]
    if not truth:
        rows.pop()
    head = element("tr", element("td"), element("th", name, scope="col"), element("th", "planner", scope="col"))
    body = [element("tr", element("th", a, scope="row"), element("td", b), element("td", c)) for a, b, c in rows]
    return element("table", head, *body, class_="compared").text


_COMPARED: tuple[tuple[str, Callable[[Result], str | float]], ...] = (
    ("answer", lambda r: r.part or "none"),
    ("probability", lambda r: percent(r.probability)),
    ("corner sd", lambda r: r.corner_sd),
    ("distance from the real part", lambda r: r.off),
)


def _shown(value: str | float) -> str:
    if isinstance(value, str):
        return value
    return "unknown" if np.isnan(value) else f"{1e3 * value:.3g} mm"


def counted(now: Snapshot) -> str:
    """Return the numbers of readings that the policy and the user chose, as a sentence.

    Args:
        now: session at one moment.
    """
    return PlacesSensed(*now.places).message


def bars(now: Snapshot) -> str:
    """Return the panel with a bar for each of the most probable parts, the others together, and the unknown object.

    Args:
        now: session at one moment.
    """
    p, order = now.state.of_parts(), now.order
    drawn = set(now.state.part[now.drawn_modes()].tolist())
    rows = [
        _row(now.names[k], float(p[k]), _swatch(rank) if int(k) in drawn else None)
        for rank, k in enumerate(order[:_BARS])
    ]
    rest = order[_BARS:]
    if len(rest):
        rows.append(_row(f"{len(rest)} others", float(p[rest].sum()), None, "none"))
    rows.append(_row("unknown object", now.state.unknown, None, "none"))
    return _framed(*rows)


def _swatch(rank: int) -> str:
    """Return the style of the square with the colour of a drawn part."""
    if rank == 0:
        return f"background:{colors.css(colors.PART)};border-color:{colors.css(colors.EDGE)}"
    return f"background:{colors.css(colors.RIVALS[rank - 1])}"


def _row(name: str, share: float, swatch: str | None, kind: str = "") -> Html:
    value = element("span", percent(share), class_="value")
    box = element("span", class_="box", style=swatch)
    return element("div", box, element("span", name), value, bar(share, kind), class_="row")


def steps(lines: Sequence[str]) -> str:
    """Return the panel with the last eight steps, newest first, as HTML.

    Args:
        lines: text of each step, in order.
    """
    if not lines:
        return _framed(element("span", "No step yet.", class_="soft"))
    items = [element("li", line) for line in list(lines)[: -_LINES - 1 : -1]]
    return _framed(element("ul", *items, class_="steps"))


def step_line(now: Snapshot) -> str:
    """Return the result of the last step in one line.

    Args:
        now: session at one moment.
    """
    step = now.steps[-1]
    target = "" if step.action is None else step.action.aim
    best = int(np.argmax(step.probabilities))
    name = now.names[best] if step.part >= 0 else ""
    probability, sd = float(step.probabilities[best]), float(step.corner_sd)
    return StepResult(len(now.steps), by_hand(step.action), target, name, probability, sd).message


MARKS: dict[str, tuple[str, Colour]] = {
    **{layer: ("box", colour) for layer, colour in zip(RIVAL_LAYERS, colors.RIVALS, strict=True)},
    "overlays": ("line", colors.OVERLAY),
    "readings": ("dot", colors.GOOD),
    "wrong": ("dot diamond", colors.BAD),
    "beams": ("line", colors.BEAM),
    "free": ("line dashes", colors.FREE),
    "features": ("line", colors.FEATURE),
    "next": ("line", colors.INK),
    "hand": ("box", colors.SOFT),
    "planner": ("dot square", colors.PLANNER),
}
"""Mark and colour of each layer in the legend."""

ALWAYS: tuple[tuple[str, Colour, str], ...] = (
    ("box", colors.PART, "Most probable part"),
    ("box", colors.TABLE, "Table"),
    ("box", colors.FURNITURE, "Known furniture"),
    ("line thick", colors.INK, "Real part, shown at the end"),
)
"""Entries of the legend that are always visible: mark, colour and text."""


def legend(*, scene: bool) -> str:
    """Return the fixed entries of the legend and the scale.

    Args:
        scene: whether there is a scene; a record has no table and no real part.
    """
    shown = ALWAYS if scene else ALWAYS[:1]
    rows = [element("li", _sign(kind, colour), element("span", words)) for kind, colour, words in shown]
    return _framed(element("ul", *rows, class_="key"), element("span", GRID_WORDS, class_="soft"))


def sign(layer: str) -> str:
    """Return the mark of a layer in the legend as HTML.

    Args:
        layer: name of the layer.
    """
    return element("span", _sign(*MARKS[layer]), class_="tanteo-sign").text


def _sign(kind: str, colour: Colour) -> Html:
    return element("span", class_=f"sign {kind}", style=f"--c:{colors.css(colour)}")
