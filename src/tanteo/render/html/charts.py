"""SVG charts; x is in percent of the width and y in pixels, so that text keeps its size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import BoolArray, FloatArray
from tanteo.render.html.page import Html, element, join

_HEIGHT, _TOP, _BOTTOM = 210, 26, 12
_LEFT, _RIGHT = 7.0, 99.5
_MOST_SDS = 5.0


def bar(share: float, kind: str = "") -> Html:
    """Return a horizontal bar that is filled to a fraction.

    Args:
        share: fraction, from 0 to 1.
        kind: class of the style sheet for the filled part.
    """
    fill = element("span", class_=f"fill {kind}".strip(), style=f"width:{100 * min(max(share, 0.0), 1.0):.2f}%")
    return element("span", fill, class_="bar", aria_hidden="true")


def residual_chart(names: Sequence[str], sds: FloatArray, wrong: BoolArray, words: Sequence[str]) -> Html:
    """Return a chart of distances from the surface with one mark for each reading, clipped at the border.

    Args:
        names: names of the readings.
        sds: distances [standard deviations].
        wrong: flags of the readings that do not fit.
        words: tooltip of each reading.
    """
    marks = [_band(), *(_scale_line(s) for s in (-4, -2, 0, 2, 4))]
    x = _LEFT + 3 + (np.arange(len(names)) + 0.5) * (_RIGHT - _LEFT - 4) / max(len(names), 1)
    for name, at, value, is_wrong, tooltip in zip(names, x, sds, wrong, words, strict=True):
        marks.append(_mark(name, float(at), float(value), bool(is_wrong), tooltip))
    label = f"Distances of {len(names)} readings in standard deviations; {int(wrong.sum())} do not fit."
    return element("svg", *marks, class_="chart", width="100%", height=_HEIGHT, role="img", aria_label=label)


def _y(value: float) -> float:
    inside = min(max(value, -_MOST_SDS), _MOST_SDS)
    return _TOP + (1 - (inside + _MOST_SDS) / (2 * _MOST_SDS)) * (_HEIGHT - _TOP - _BOTTOM)


def _band() -> Html:
    """Return the band that contains 95 % of the readings if their noise is as stated."""
    high, tall = f"{_y(2):.1f}", f"{_y(-2) - _y(2):.1f}"
    return element("rect", class_="band", x=f"{_LEFT}%", width=f"{_RIGHT - _LEFT}%", y=high, height=tall)


def _scale_line(value: int) -> Html:
    y = f"{_y(value):.1f}"
    line = element("line", class_="grid", x1=f"{_LEFT}%", x2=f"{_RIGHT}%", y1=y, y2=y)
    sign = {True: "−", False: "+"}[value < 0] if value else ""
    words = element("text", f"{sign}{abs(value)}", x=f"{_LEFT - 1.5}%", y=f"{_y(value) + 4:.1f}", class_="end")
    return element("g", line, words)


def _mark(name: str, x: float, value: float, wrong: bool, tooltip: str) -> Html:
    y, at = _y(value), f"{x:.2f}%"
    title = element("title", tooltip)
    if not wrong:
        return element("circle", title, cx=at, cy=f"{y:.1f}", r=4.5, class_="dot")
    word = element("text", name, x=at, y=f"{y - 10:.1f}" if y > _TOP + 10 else f"{y - 9:.1f}", class_="middle wrong")
    return element("g", title, element("text", "✕", x=at, y=f"{y + 6:.1f}", class_="middle cross"), word)


_CURVE_HEIGHT, _CURVE_TOP, _CURVE_BOTTOM = 220, 20, 30
_FIRST, _LAST = 13.0, 98.0
_MOST_TICKS = 10

STYLES = 4
"""Number of line styles: each has its own colour, mark and dashes (``page.css``)."""

_MARKS = ("M-4 0a4 4 0 1 0 8 0a4 4 0 1 0 -8 0z", "M-4-4h8v8h-8z", "M0-5.5L5 4h-10z", "M0-5.5L5.5 0 0 5.5-5.5 0z")


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """Curve of a chart.

    Attributes:
        name: name in the legend.
        values: values from left to right ``(n,)``; NaN for a missing one.
        tooltip: tooltip of each value ``(n,)``.
        style: number of the line style, below :data:`STYLES`.
    """

    name: str
    values: FloatArray
    tooltip: tuple[str, ...]
    style: int = 0


@dataclass(frozen=True, slots=True)
class Scale:
    """Vertical axis of a chart.

    Attributes:
        low: smallest value.
        high: largest value.
        ticks: ticks as value and label.
        log: whether the axis is logarithmic.
    """

    low: float
    high: float
    ticks: tuple[tuple[float, str], ...]
    log: bool = False

    def y(self, value: float) -> float:
        """Return the distance of a value from the top of the chart [px], clipped at the ends of the axis.

        Args:
            value: value on the axis.
        """
        low, high, v = np.log([self.low, self.high, max(value, 1e-300)]) if self.log else (self.low, self.high, value)
        share = float(np.clip((v - low) / (high - low), 0.0, 1.0))
        return _CURVE_TOP + (1 - share) * (_CURVE_HEIGHT - _CURVE_TOP - _CURVE_BOTTOM)


SHARES = Scale(0.0, 1.0, tuple((k / 4, f"{25 * k} %") for k in range(5)))
"""Axis of probabilities."""


def lengths_scale(values: FloatArray) -> Scale:
    """Return a logarithmic axis of lengths [mm] that contains all values.

    Args:
        values: lengths [mm]; values that are not positive and finite are ignored.
    """
    seen = values[np.isfinite(values) & (values > 0)]
    low, high = (float(seen.min()), float(seen.max())) if len(seen) else (0.1, 10.0)
    low, high = low / 1.4, max(high * 1.4, low * 4)
    each = [m * 10.0**e for e in range(-6, 7) for m in (1, 2, 5)]
    inside = [v for v in each if low <= v <= high]
    if len(inside) > 6:
        inside = [10.0**e for e in range(-6, 7) if low <= 10.0**e <= high]
    return Scale(low, high, tuple((v, f"{v:g} mm") for v in inside), log=True)


def curve_chart(
    label: str, curves: Sequence[Curve], scale: Scale, places: Sequence[str], goal: tuple[float, str] | None = None
) -> Html:
    """Return a chart of curves with a legend.

    Args:
        label: description for screen readers.
        curves: curves with different styles.
        scale: vertical axis.
        places: labels of the horizontal axis, from left to right; some are omitted if there are many.
        goal: value of a horizontal line, and its name; None for no line.
    """
    n = len(places)
    x = np.linspace(_FIRST, _LAST, n) if n > 1 else np.full(n, 0.5 * (_FIRST + _LAST))
    drawn = [_across(scale.y(v), words) for v, words in scale.ticks]
    every = -(-n // _MOST_TICKS)
    drawn += [
        element("text", words, x=f"{x[k]:.2f}%", y=_CURVE_HEIGHT - 10, class_="middle")
        for k, words in enumerate(places)
        if k % every == 0
    ]
    if goal is not None:
        y = f"{scale.y(goal[0]):.1f}"
        drawn.append(element("line", class_="goal", x1="0%", x2="100%", y1=y, y2=y))
    for curve in curves:
        drawn += _line(curve, scale, x)
    chart = element("svg", *drawn, class_="chart", width="100%", height=_CURVE_HEIGHT, role="img", aria_label=label)
    return join([chart, _legend(curves, goal)])


def _across(y: float, words: str) -> Html:
    line = element("line", class_="grid", x1="0%", x2="100%", y1=f"{y:.1f}", y2=f"{y:.1f}")
    return join([line, element("text", words, x=0, y=f"{y - 4:.1f}")])


def _line(curve: Curve, scale: Scale, x: FloatArray) -> list[Html]:
    """Return the segments of a curve, then its marks."""
    at = [(f"{a:.2f}%", f"{scale.y(v):.1f}") for a, v in zip(x, curve.values, strict=True)]
    there = np.isfinite(curve.values)
    segments = [
        element("line", class_=f"curve c{curve.style}", x1=at[i][0], y1=at[i][1], x2=at[i + 1][0], y2=at[i + 1][1])
        for i in range(len(at) - 1)
        if there[i] and there[i + 1]
    ]
    marks = [
        element("svg", _curve_mark(curve.style, curve.tooltip[i]), x=at[i][0], y=at[i][1], overflow="visible")
        for i in range(len(at))
        if there[i]
    ]
    return segments + marks


def _curve_mark(style: int, tooltip: str = "") -> Html:
    return element(
        "path", *([element("title", tooltip)] if tooltip else []), d=_MARKS[style], class_=f"mark-of c{style}"
    )


def _legend(curves: Sequence[Curve], goal: tuple[float, str] | None) -> Html:
    entries = []
    for curve in curves:
        line = element("line", x1=0, x2=34, y1=7, y2=7, class_=f"curve c{curve.style}")
        inner = element("svg", _curve_mark(curve.style), x=17, y=7, overflow="visible")
        entries.append((element("svg", line, inner, width=34, height=14, aria_hidden="true"), curve.name))
    if goal is not None:
        line = element("line", x1=0, x2=34, y1=7, y2=7, class_="goal")
        entries.append((element("svg", line, width=34, height=14, aria_hidden="true"), goal[1]))
    return element("div", *(element("span", sign, words) for sign, words in entries), class_="legend")
