"""Information of each reading of a session as tables."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tanteo.render.text.layout import PLAIN, Layout
from tanteo.words import percent

if TYPE_CHECKING:
    from tanteo.planning.explanation import Added, Direction, Explanation

_NOTABLE = 0.05
"""Smallest fraction of the information about a direction for which a reading is named."""


def explanation_lines(explanation: Explanation, *, layout: Layout = PLAIN) -> list[str]:
    """Return the information of each reading, and the readings that determine the pose, as lines of text.

    Args:
        explanation: explanation of a session.
        layout: width and style of the output.
    """
    if not explanation.added:
        return ["The session has no readings to explain."]
    headers = [
        "reading",
        "hit",
        "part nats",
        "pose nats",
        "corner mm",
        "most probable",
        "P",
        "most reduced motion",
        "to",
    ]
    lines = [layout.bold("Information of each reading:")]
    lines += layout.table(headers, [_step(a) for a in explanation.added], left=(0, 1, 5, 7), indent=2)
    if explanation.directions:
        lines += [
            "",
            layout.bold(f"Readings that determine the pose of {explanation.part}, most uncertain direction first:"),
        ]
        headers = ["direction", "corners mm", "readings", "prior pose"]
        lines += layout.table(headers, [_direction(d) for d in explanation.directions], left=(0, 2), indent=2)
    return lines


def _step(a: Added) -> list[str]:
    hit = ", ".join(dict.fromkeys(a.faces)) or "known already"
    return [
        ", ".join(a.ids) or "-", hit, _number(a.about_part, "{:.2f}"), _number(a.about_pose, "{:.2f}"),
        _number(1e3 * a.corner_sd, "{:.3g}"), a.part or "unknown object", _share(a.probability),
        str(a.motion or "-"), _share(a.narrowed),
    ]  # fmt: skip


def _direction(d: Direction) -> list[str]:
    named = [f"{name} {_share(share)}" for name, share in d.shares if share >= _NOTABLE]
    return [str(d.motion), f"{1e3 * d.moves:.3g}", ", ".join(named) or "-", _share(d.prior)]


def _number(value: float, form: str) -> str:
    return form.format(value) if math.isfinite(value) else "-"


def _share(share: float) -> str:
    return percent(share) if math.isfinite(share) else "-"
