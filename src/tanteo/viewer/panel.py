"""What is said beside the picture: the belief as bars, counts, what happened, what the colours mean. HTML, escaped."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.report import Html, bar, element, percent
from tanteo.viewer import colors
from tanteo.viewer.drawing import OPEN
from tanteo.viewer.primitives import Colour
from tanteo.viewer.snapshot import Snapshot, by_hand

_BARS = 5
"""Parts that have a bar of their own."""

_LINES = 8
"""Last lines of what happened."""

GRID = 0.05
"""Side of a square of the grid [m]."""

GRID_WORDS = f"A square of the grid is {1e3 * GRID:.0f} mm; of beams that met nothing {1e3 * OPEN:.0f} mm are drawn."

STYLE = f"""<style>
.tanteo {{ font-size: 13.5px; line-height: 1.4; padding: 2px 12px 4px; color: {colors.css(colors.INK)};
  overflow-wrap: anywhere; }}
.tanteo .say {{ font-size: 15px; font-weight: 600; }}
.tanteo .soft {{ color: {colors.css(colors.SOFT)}; }}
.tanteo .row {{ display: grid; grid-template-columns: 14px minmax(0, 1fr) auto; gap: 1px 7px; align-items: center;
  margin: 5px 0; }}
.tanteo .row .bar {{ grid-column: 2 / -1; display: block; height: 8px; border-radius: 4px; background: #e3e7eb;
  overflow: hidden; }}
.tanteo .fill {{ display: block; height: 100%; background: {colors.css(colors.GOOD)}; }}
.tanteo .fill.none {{ background: #8a949e; }}
.tanteo .value {{ font-variant-numeric: tabular-nums; }}
.tanteo .box {{ width: 13px; height: 13px; border-radius: 3px; border: 2px solid transparent; box-sizing: border-box; }}
.tanteo ul {{ list-style: none; margin: 0; padding: 0; }}
.tanteo .key li {{ display: grid; grid-template-columns: 26px 1fr; gap: 8px; align-items: center; margin: 2px 0; }}
.tanteo .mark {{ display: inline-block; width: 22px; height: 0; }}
.tanteo .dot {{ width: 10px; height: 10px; border-radius: 50%; margin-left: 6px; }}
.tanteo .diamond {{ border-radius: 0; transform: rotate(45deg); }}
.tanteo .told li {{ border-top: 1px solid #e3e7eb; padding: 3px 0; }}
.mantine-Button-root {{ height: 30px !important; padding: 0 5px !important;
  border-color: {colors.css(colors.GOOD)} !important; }}
.mantine-Button-label {{ font-size: 13px; color: {colors.css(colors.GOOD)}; }}
.mantine-Input-input, .mantine-Select-option {{ font-size: 13.5px !important; }}
label, .mantine-Notification-description {{ color: {colors.css(colors.SOFT)} !important; }}
</style>"""
"""Of what is said here; and viser's own words, which are small and pale, so that they can be read."""


def _framed(*children: Html | str) -> str:
    return element("div", *children, class_="tanteo").text


def headline(now: Snapshot) -> str:
    """What is believed now, in a sentence."""
    b, n = now.state, len(now.names)
    if not now.steps:
        return f"Nothing was sensed yet: {n} parts may be here." if n > 1 else "Nothing was sensed yet."
    if not len(b.weights):
        return "No part explains the readings."
    best = int(now.order[0])
    words = f"{now.names[best]}: {percent(float(b.of_parts()[best]))}"
    if not now.decided:
        return f"Not decided; the likeliest is {words}"
    sd = now.steps[-1].corner_sd
    return words if np.isnan(sd) else f"{words}, largest corner sd {1e3 * sd:.3g} mm (1 sd)"


def status(now: Snapshot, note: str = "", help_: str = "") -> str:
    """The sentence, how many places were sensed, and what it is waiting for."""
    rows = [element("div", headline(now), class_="say"), element("div", counted(now))]
    rows += [element("div", text, class_="soft") for text in (note, help_) if text]
    return _framed(Html(STYLE), *rows)


def verdict(now: Snapshot, words: Sequence[str]) -> str:
    """How it ended: the first sentence large."""
    rows = [element("div", text, class_="say" if k == 0 else None) for k, text in enumerate([*words, counted(now)])]
    return _framed(Html(STYLE), *rows)


def counted(now: Snapshot) -> str:
    """Places sensed so far, and by whom."""
    policy, mine = now.places
    return f"Places sensed: {policy + mine}" + (f" ({mine} by you, {policy} by the policy)" if mine else "")


def bars(now: Snapshot) -> str:
    """How probable each part is: the likeliest, all others together, and the unknown object."""
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
    """Style of the square that has the colour of what is drawn."""
    if rank == 0:
        return f"background:{colors.css(colors.PART)};border-color:{colors.css(colors.EDGE)}"
    return f"background:{colors.css(colors.RIVALS[rank - 1])}"


def _row(name: str, share: float, swatch: str | None, kind: str = "") -> Html:
    value = element("span", percent(share), class_="value")
    box = element("span", class_="box", style=swatch)
    return element("div", box, element("span", name), value, bar(share, kind), class_="row")


def steps(lines: Sequence[str]) -> str:
    """What happened, the last first."""
    if not lines:
        return _framed(element("span", "Nothing yet.", class_="soft"))
    items = [element("li", line) for line in list(lines)[: -_LINES - 1 : -1]]
    return _framed(element("ul", *items, class_="told"))


def step_line(now: Snapshot) -> str:
    """What the last step told, in a line."""
    step = now.steps[-1]
    who = "you" if by_hand(step.action) else "policy"
    at = "told" if step.action is None else f"{step.action.face} of {step.action.part}"
    if step.part < 0:
        return f"{len(now.steps)}. {who}, {at}: no part explains the readings"
    best = int(np.argmax(step.probabilities))
    return (
        f"{len(now.steps)}. {who}, {at}: {now.names[best]} {percent(float(step.probabilities[best]))}, "
        f"largest corner sd {1e3 * step.corner_sd:.3g} mm"
    )


def legend(*, hand: bool) -> str:
    """What colours and shapes mean."""
    keys = [
        ("mark", colors.EDGE, "the likeliest part"),
        ("mark", colors.RIVALS[0], "other parts, coloured as above"),
        ("mark", colors.OVERLAY, "how the likeliest may be off"),
        ("mark dot", colors.GOOD, "reading that fits, with 2 sd"),
        ("mark dot diamond", colors.BAD, "reading that does not fit"),
        ("mark", colors.BEAM, "beam of a reading"),
        ("mark dashes", colors.FREE, "beam that met nothing"),
        ("mark", colors.INK, "next reading; in the end, the truth"),
    ]
    if hand:
        keys.append(("mark dot", colors.SOFT, "hand, and what it sees now"))
    items = [
        element("li", element("span", class_=kind, style=_ink(kind, colour)), element("span", words))
        for kind, colour, words in keys
    ]
    return _framed(element("ul", *items, class_="key"), element("span", GRID_WORDS, class_="soft"))


def _ink(kind: str, colour: Colour) -> str:
    if "dot" in kind:
        return f"background:{colors.css(colour)}"
    return f"border-top:3px {'dashed' if 'dashes' in kind else 'solid'} {colors.css(colour)}"
