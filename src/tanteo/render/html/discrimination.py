"""Report of the reading that discriminates two parts: its beam, and the expected range on each part."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tanteo.geometry import SE3
from tanteo.parts import Part
from tanteo.planning import Probe
from tanteo.planning.discrimination import Discrimination
from tanteo.posterior import box_corners
from tanteo.render.html.answered import Layer, picture, switch_row
from tanteo.render.html.origin import Run
from tanteo.render.html.page import Front, Html, Section, element, fact_list, join, make_page, table
from tanteo.render.html.scene import packed, part_document, pose_numbers, view_document
from tanteo.render.html.sections import rerun_section
from tanteo.render.html.words import MM, fixed


def distinction_page(found: Discrimination, parts: Sequence[Part], probe: Probe, run: Run) -> str:
    """Return the report of a reading that discriminates two parts as the text of one HTML file.

    Args:
        found: best reading to discriminate the parts.
        parts: both parts, in the order of ``found``.
        probe: sensor model.
        run: origin of the result.
    """
    first, second = found.parts
    title = f"{'One' if found.discriminates else 'No'} reading discriminates {first} and {second}."
    there = bool(np.isfinite(found.origin).all())
    legend = [("beam", "the reading"), ("dot", "point on either part")] if there else []
    layers = [Layer("readings", "points"), Layer("beams", "the reading"), Layer("names", "names")]
    shown = picture(layers if there else [], [], legend)
    chip, status = ("✓ planned", "recognized") if found.discriminates else ("✕ not discriminated", "unknown")
    front = Front(title, chip, status, found.message, shown, _side(found, probe, run))
    sections = [_reading(found)] if there else []
    sections.append(rerun_section(run, f"{run.made_by}."))
    return make_page(front, _scene(found, parts), sections)


def _side(found: Discrimination, probe: Probe, run: Run) -> Html:
    rows = [
        switch_row(k, name, "" if np.isnan(r) else "nothing" if np.isinf(r) else f"{MM * r:.2f} mm", Html(""))
        for k, (name, r) in enumerate(zip(found.parts, found.ranges, strict=True))
    ]
    facts = [
        ("Information about the part", f"{found.information / np.log(2):.0%} of a complete decision"),
        ("Sensor", probe.name),
        *run.facts,
    ]
    words = "Choose one to show it. The second part is at the pose at which it is most similar to the first."
    note = element("p", words, class_="note")
    heading = element("h2", "Expected range")
    return join([heading, note, element("div", *rows, class_="bars"), element("dl", fact_list(facts))])


def _reading(found: Discrimination) -> Section:
    lead = f"In the frame of {found.parts[0]}, to which the other part is aligned."
    rows = [
        ("from x, y, z", ", ".join(fixed(MM * v, 2) for v in found.origin), "mm"),
        ("along x, y, z", ", ".join(fixed(v, 4) for v in found.direction), "–"),
    ]
    for name, r, sd in zip(found.parts, found.ranges, found.sds, strict=True):
        rows.append((f"reads on {name}", "nothing" if np.isinf(r) else f"{MM * r:.3f} ± {MM * sd:.3g}", "mm"))
    return Section("reading", "The reading", lead, (table(("figure", "value", "unit"), rows),))


def _scene(found: Discrimination, parts: Sequence[Part]) -> dict[str, Any]:
    """Return both parts at their most similar poses, in the frame of the first."""
    Ts = np.stack([np.eye(4), found.T_first_second])
    there = np.isfinite(found.ranges)
    points = found.origin + found.ranges[there, None] * found.direction
    starts = np.repeat(found.origin[None], len(points), axis=0)
    corners = [SE3.apply(T, box_corners(p)) for T, p in zip(Ts, parts, strict=True)]
    seen = np.concatenate([*corners, starts])
    centre = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    names = [name for name, ok in zip(found.parts, there, strict=True) if ok]
    words = [f"{name}: {MM * r:.2f} mm" for name, r in zip(names, found.ranges[there], strict=True)]
    beyond = np.zeros((0, 2, 3))
    if np.isinf(found.ranges).any():  # beyond the part that it misses
        far = found.origin + 2 * np.linalg.norm(found.origin - centre) * found.direction
        beyond = np.stack([found.origin, far])[None] - centre
    return {
        **view_document(centre, 2 * float(np.linalg.norm(seen - centre, axis=1).max())),
        "seen": packed(seen - centre),
        "parts": [part_document(part, 2) for part in parts],
        "readings": {
            "names": words, "words": words, "points": packed(points - centre), "radii": packed(np.zeros(len(points))),
            "starts": packed(starts - centre),
        },
        "free": packed(beyond),
        "hypotheses": [
            {"part": k, "pose": pose_numbers(T, centre), "wrong": [0] * len(points), "sticks": "", "overlays": []}
            for k, T in enumerate(Ts)
        ],
    }  # fmt: skip
