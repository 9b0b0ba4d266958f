"""Which reading fixed which direction of the pose."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.active import Direction
from tanteo.answers import prior_rows
from tanteo.report.html import Html, element, join, table
from tanteo.report.scene import Candidate
from tanteo.report.section import Section
from tanteo.report.sensed import Sensed
from tanteo.report.words import MM, brief, percent

_NAMED = 5
"""Readings of a direction that are named."""


def rests_section(candidates: Sequence[Candidate], directions: Sequence[Sequence[Direction]]) -> Section:
    """The independent directions of the error, and what is known of each from where.

    Args:
        candidates: The hypotheses.
        directions: Of each of them; see :func:`directions_of` and :func:`tanteo.active.explanation.explain`.
    """
    lead = (
        "The pose may be off in these independent ways, the worst first: the overlays in the picture show them. Each "
        "bar is all that is known about one, divided among the readings and what was known beforehand; errors that the "
        "readings share are taken as known in it."
    )
    bodies = tuple(_rows(c, d) for c, d in zip(candidates, directions, strict=True))
    return Section("rests", "Which reading fixed which direction", lead, bodies)


def directions_of(candidate: Candidate, sensed: Sensed) -> tuple[Direction, ...]:
    """The ways in which a pose may be off, with the share of each reading in what is known of them, to first order.

    Args:
        candidate: A hypothesis with the readings on it.
        sensed: The readings.
    """
    contacts, part = candidate.contacts, candidate.part
    form = 0.0 if contacts.labelled else sensed.tolerance**2 * np.any(contacts.form != 0, axis=1)
    weights = contacts.used[contacts.reading] / (contacts.noise + contacts.repeatability + form)
    known = prior_rows(sensed.prior, part, candidate.hypothesis.T_world_part[None])[1][0]
    out = []
    for way in candidate.ways:
        each = np.bincount(contacts.reading, weights * (contacts.rows @ way.xi) ** 2, minlength=len(sensed.measured))
        rough = float(np.sum((known @ way.xi) ** 2))
        total = max(float(each.sum()) + rough, 1e-300)
        shares = ((sensed.measured.ids[i], float(each[i] / total)) for i in np.argsort(-each, kind="stable"))
        out.append(Direction(way.words, way.rms, tuple(shares), rough / total))
    return tuple(out)


def _rows(candidate: Candidate, directions: Sequence[Direction]) -> Html:
    if not directions:
        return element("p", "Nothing was met, so nothing is fixed.")
    overlays = [way.words for way in candidate.ways]
    rows = []
    for d in directions:
        words = brief(d.motion)
        show: Html | str = ""
        if words in overlays:
            show = element("button", "Show", type="button", data_way=overlays.index(words), aria_label=f"Show: {words}")
        rows.append((words, f"{MM * d.moves:.3g}", join([_bar(d), element("div", _said(d))]), show))
    headers = ("may be off by", "corners move, rms [mm]", "known from", "overlays")
    return table(headers, rows, class_="directions")


def _bar(d: Direction) -> Html:
    named = [(f"{name}: {percent(p)}", p, f"s{k % 2}") for k, (name, p) in enumerate(d.shares[:_NAMED])]
    parts = [*named, ("beforehand", d.prior, "none")]
    spans = [element("span", title=said, class_=kind, style=f"width:{100 * p:.2f}%") for said, p, kind in parts]
    return element("div", *spans, class_="stack", aria_hidden="true")


def _said(d: Direction) -> str:
    named = [f"{name} ({percent(p)})" for name, p in d.shares[:_NAMED] if p >= 0.0005]
    rest, others = sum(p for _, p in d.shares[_NAMED:]), len(d.shares) - _NAMED
    if rest >= 0.0005:
        named.append(f"{others} others ({percent(rest)})")
    if d.prior >= 0.0005:
        named.append(f"known beforehand ({percent(d.prior)})")
    return ", ".join(named) or "nothing"
