"""Charts without a library: SVG in per cents of the width and pixels of height, so that words keep their size."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.report.html import Html, element
from tanteo.typing import BoolArray, FloatArray

_HEIGHT, _TOP, _BOTTOM = 210, 26, 12
_LEFT, _RIGHT = 7.0, 99.5
_MOST_SDS = 5.0


def bar(share: float, kind: str = "") -> Html:
    """A bar of a share of one."""
    fill = element("span", class_=f"fill {kind}".strip(), style=f"width:{100 * min(max(share, 0.0), 1.0):.2f}%")
    return element("span", fill, class_="bar", aria_hidden="true")


def residual_chart(names: Sequence[str], sds: FloatArray, wrong: BoolArray, words: Sequence[str]) -> Html:
    """One mark a reading: its distance to the surface in standard deviations; farther ones stand at the border.

    Args:
        names: Of the readings ``(n,)``.
        sds: Distances in standard deviations ``(n,)``.
        wrong: Readings that do not fit ``(n,)``: a cross instead of a dot.
        words: What to say when a mark is pointed at ``(n,)``.
    """
    marks = [_band(), *(_scale_line(s) for s in (-4, -2, 0, 2, 4))]
    x = _LEFT + 3 + (np.arange(len(names)) + 0.5) * (_RIGHT - _LEFT - 4) / max(len(names), 1)
    for name, at, value, is_wrong, said in zip(names, x, sds, wrong, words, strict=True):
        marks.append(_mark(name, float(at), float(value), bool(is_wrong), said))
    label = f"Distances of {len(names)} readings in standard deviations; {int(wrong.sum())} do not fit."
    return element("svg", *marks, class_="chart", width="100%", height=_HEIGHT, role="img", aria_label=label)


def _y(value: float) -> float:
    inside = min(max(value, -_MOST_SDS), _MOST_SDS)
    return _TOP + (1 - (inside + _MOST_SDS) / (2 * _MOST_SDS)) * (_HEIGHT - _TOP - _BOTTOM)


def _band() -> Html:
    """Where 95 of 100 readings lie that are as noisy as stated."""
    high, tall = f"{_y(2):.1f}", f"{_y(-2) - _y(2):.1f}"
    return element("rect", class_="band", x=f"{_LEFT}%", width=f"{_RIGHT - _LEFT}%", y=high, height=tall)


def _scale_line(value: int) -> Html:
    y = f"{_y(value):.1f}"
    line = element("line", class_="grid", x1=f"{_LEFT}%", x2=f"{_RIGHT}%", y1=y, y2=y)
    sign = {True: "−", False: "+"}[value < 0] if value else ""
    words = element("text", f"{sign}{abs(value)}", x=f"{_LEFT - 1.5}%", y=f"{_y(value) + 4:.1f}", class_="end")
    return element("g", line, words)


def _mark(name: str, x: float, value: float, wrong: bool, said: str) -> Html:
    y, at = _y(value), f"{x:.2f}%"
    title = element("title", said)
    if not wrong:
        return element("circle", title, cx=at, cy=f"{y:.1f}", r=4.5, class_="dot")
    word = element("text", name, x=at, y=f"{y - 10:.1f}" if y > _TOP + 10 else f"{y - 9:.1f}", class_="middle wrong")
    return element("g", title, element("text", "✕", x=at, y=f"{y + 6:.1f}", class_="middle cross"), word)
