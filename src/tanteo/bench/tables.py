"""Write scores as a table, as a file for comparison, and as a picture."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tanteo.bench.scoring import Score
from tanteo.errors import InputError
from tanteo.parts import read_whole
from tanteo.render.pictures import COLORS, make_figure, save_figure
from tanteo.replaced import replaced

_KIND, _TIMES = "tanteo bench 1", ("median_ms", "slow_ms")

COLUMNS = (
    "set", "method", "right", "among", "sure, wrong", "several", "true", "claimed", "region", "NEES/dof", "ms", "95 %",
    "failed",
)  # fmt: skip
DECISIONS = "set", "method", "decided", "right", "readings"


def score_table(scores: Sequence[Score]) -> list[tuple[str, ...]]:
    """Return a table of texts with :data:`COLUMNS` as header; ``-`` for missing values."""
    return [COLUMNS, *(_row(one) for one in scores)]


def decision_table(scores: Sequence[Score]) -> list[tuple[str, ...]]:
    """Return a table of texts with :data:`DECISIONS` as header, for the scores with decisions."""
    decided = [one for one in scores if one.decided is not None]
    rows = [
        (one.bench_set, one.method, _percent(one.decided), _percent(one.decided_right), _count(one)) for one in decided
    ]
    return [DECISIONS, *rows]


def _count(one: Score) -> str:
    return "-" if one.readings is None else f"{one.readings:.0f}"


def _row(one: Score) -> tuple[str, ...]:
    nees = "-" if one.nees is None or one.median_nees is None else f"{one.nees:.2f} ({one.median_nees:.2f})"
    return (
        one.bench_set, one.method, _percent(one.right), _percent(one.among), _percent(one.sure_and_wrong),
        _percent(one.several), _percent(one.declared), _percent(one.claimed), _percent(one.in_region), nees,
        _time(one.median_ms), _time(one.slow_ms), f"{one.failures} of {one.scenes}" if one.failures else "-",
    )  # fmt: skip


def _time(milliseconds: float) -> str:
    """Return a rounded time; ``-`` without answers."""
    return "-" if milliseconds != milliseconds else f"{milliseconds:.0f}"


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.0f} %"


def write_scores(scores: Sequence[Score], path: str | Path) -> None:
    """Write scores to a JSON file, which is replaced if it exists.

    Args:
        scores: scores of all methods and sets.
        path: JSON file.

    Raises:
        OSError: the file cannot be written.
    """
    from tanteo import __version__

    rows = [{k: None if v != v else v for k, v in asdict(one).items()} for one in scores]
    content = json.dumps({"kind": _KIND, "tanteo": __version__, "scores": rows}, indent=1)
    with replaced(path) as to:
        to.write_text(content + "\n", encoding="utf-8")


def read_scores(path: str | Path) -> list[Score]:
    """Read scores from a JSON file.

    Args:
        path: file of :func:`write_scores`.

    Raises:
        InputError: the file has no scores of this format.
    """
    try:
        content = json.loads(read_whole(path, "scores"))
        if content["kind"] != _KIND:
            raise ValueError
        return [_score(row) for row in content["scores"]]
    except (ValueError, TypeError, KeyError, UnicodeDecodeError):
        raise InputError(f"{path}: expected scores that tanteo bench --out wrote, got something else.") from None


def _score(row: dict[str, Any]) -> Score:
    values: dict[str, Any] = {k: float("nan") if v is None and k in _TIMES else v for k, v in row.items()}
    return Score(**values)


def bench_picture(scores: Sequence[Score], path: str | Path) -> None:
    """Draw how often each method is right against the time it takes, a panel for each set.

    The width of a ring is the fraction of 95 % regions that contain the true pose.

    Args:
        scores: scores of all methods and sets.
        path: PNG, SVG or PDF file; replaced if it exists.

    Raises:
        MissingExtraError: Matplotlib is not installed.
        InputError: the suffix of the file is unsupported.
        OSError: the file cannot be written.
    """
    sets, methods = (list(dict.fromkeys(getattr(one, name) for one in scores)) for name in ("bench_set", "method"))
    columns = min(len(sets), 3)
    rows = -(-len(sets) // columns)
    figure = make_figure(3.4 * columns + 1.2, 2.9 * rows)
    panels = figure.subplots(rows, columns, squeeze=False, sharey=True, sharex=True)
    for k, panel in enumerate(panels.flat):
        if k >= len(sets):
            panel.axis("off")
            continue
        for one in (one for one in scores if one.bench_set == sets[k] and one.median_ms == one.median_ms):
            hue = COLORS[methods.index(one.method) % len(COLORS)]
            panel.plot(one.median_ms, 100 * one.right, "o", ms=7, color=hue, zorder=3, clip_on=False)
            if one.in_region is not None:
                ring = {"ms": 8 + 18 * one.in_region, "mfc": "none", "mec": hue, "alpha": 0.6, "clip_on": False}
                panel.plot(one.median_ms, 100 * one.right, "o", **ring)
        panel.set(xscale="log", ylim=(-8, 112), title=sets[k])
        panel.margins(x=0.1)
        panel.minorticks_off()
        panel.xaxis.set_major_formatter("{x:g}")
        panel.grid(True, which="major", alpha=0.3)
        if k % columns == 0:
            panel.set_ylabel("right [%]")
        if k + columns >= len(sets):
            panel.set_xlabel("time of a scene, median [ms]")
            panel.tick_params(labelbottom=True)
    from matplotlib.lines import Line2D

    marks = [
        Line2D([], [], ls="", marker="o", color=COLORS[k % len(COLORS)], label=name) for k, name in enumerate(methods)
    ]
    words = "ring: the wider, the more\noften the 95 % region\nholds the truth (here always)"
    wide = Line2D([], [], ls="", marker="o", ms=26, mfc="none", mec="#5c6873", label=words)
    figure.legend(handles=[*marks, wide], labelspacing=1.2, loc="outside right upper", frameon=False)
    save_figure(figure, path)
