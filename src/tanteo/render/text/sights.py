"""Objects of an image as lines of text."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tanteo.io.documents import EMPTY
from tanteo.render.text.answers import answer_lines
from tanteo.render.text.layout import PLAIN, Layout, printable

if TYPE_CHECKING:
    from tanteo.vision import Sight, Sighting


def sight_lines(sight: Sight, *, verbose: bool = False, layout: Layout = PLAIN) -> list[str]:
    """Return the objects of an image as lines of text, largest first.

    Args:
        sight: result of the image.
        verbose: whether to add matrix, pairings and times of the stages.
        layout: width and style of the output.
    """
    if not sight.objects:
        return [f"unknown: {EMPTY.message}"]
    lines: list[str] = []
    for k, seen in enumerate(sight.objects, start=1):
        lines += [""] if lines else []
        lines.append(_heading(k, len(sight.objects), seen))
        lines += answer_lines(seen.answer, frame=sight.frame, verbose=verbose, layout=layout)
        if verbose and seen.similar:
            lines.append(f"By the outline alone: {printable(', '.join(seen.similar[:3]))}.")
        if any(seen.rims):
            lines.append(f"Visible rims: {printable(', '.join(dict.fromkeys(filter(None, seen.rims))))}.")
        if seen.question is not None and seen.answer.status != "ambiguous":
            lines.append(f"To confirm it, {printable(seen.question.words)}.")
    return [*lines, *_ellipse_lines(sight)] if verbose else lines


def _ellipse_lines(sight: Sight) -> list[str]:
    """Return the ellipses of the image, and the reasons for rejected arcs."""
    lines = []
    for k, ellipse in enumerate(sight.ellipses.found):
        (x, y), (a, b), sds = ellipse.centre, ellipse.semi_axes, ellipse.semi_axis_sds
        own = next((seen.rims[k] for seen in sight.objects if seen.rims and seen.rims[k]), "no rim of an answer")
        lines.append(
            f"Ellipse at x {x:.1f} y {y:.1f} px, semi-axes {a:.2f} +- {sds[0]:.2f} and {b:.2f} +- {sds[1]:.2f} px, "
            f"{np.degrees(ellipse.arc):.0f} degrees of it: {printable(own)}."
        )
    lines += [f"No ellipse: {printable(words)}" for words in sight.ellipses.refused]
    return ["", *lines] if lines else []


def _heading(k: int, n: int, seen: Sighting) -> str:
    if seen.region is None:
        return f"Object {k} of {n}"
    x0, x1, y0, y1 = seen.region.box
    words = f"Object {k} of {n}, columns {x0} to {x1}, rows {y0} to {y1}"
    if seen.region.cut:
        words += ", partly outside the image"
    if seen.outline is not None:
        o = seen.outline
        words += (
            f"; outline on the table {o['area'] * 1e4:.2f} +- {o.sd('area') * 1e4:.2f} cm2, "
            f"perimeter {o['perimeter'] * 1e3:.1f} +- {o.sd('perimeter') * 1e3:.1f} mm"
        )
    return words


def sighting_words(seen: Sighting | None) -> str:
    """Return the result of an image for one object as one line.

    Args:
        seen: object in the image; None without any.
    """
    if seen is None:
        return "The image shows no part."
    answer, shares = seen.answer, dict[str, float]()
    for h in answer.hypotheses:
        shares[h.part] = shares.get(h.part, 0.0) + h.probability
    likely = [f"{name} {100 * p:.0f} %" for name, p in sorted(shares.items(), key=lambda item: -item[1]) if p > 0.005]
    words = f"The image: {', '.join([*likely, f'unknown object {100 * answer.unknown_probability:.0f} %'])}."
    return words if seen.question is None else f"{words} To decide, {seen.question.words}."
