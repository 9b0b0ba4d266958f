"""Sections of the report of an answer: fit, directions of the error, figures, and command."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from tanteo.geometry import SE3, SO3, UncertainFrame
from tanteo.geometry.typing import Covariances, FloatArray, IntArray, Transforms
from tanteo.io import BRANDS, pose_as_brand, write_pose
from tanteo.planning.explanation import Direction
from tanteo.posterior import Answer
from tanteo.posterior.answers import prior_rows
from tanteo.posterior.symmetry import upright
from tanteo.render.html.charts import residual_chart
from tanteo.render.html.contacts import Sensed
from tanteo.render.html.origin import Run
from tanteo.render.html.page import Html, Section, element, join, per_hypothesis, table
from tanteo.render.html.scene import Candidate
from tanteo.render.html.words import MM, fixed
from tanteo.words import percent
from tanteo.words.findings import AccuracyNeeded


def figure_section(candidates: Sequence[Candidate], answer: Answer) -> Section:
    """Return the section with pose, covariance and fit of every hypothesis.

    The notations of controllers are shown if a frame may be written, see :func:`_may_be_used`.

    Args:
        candidates: hypotheses, best first.
        answer: the answer.
    """
    lead = "The pose maps points of the part to the world. Every figure has its frame and its unit."
    used = _may_be_used(answer)
    return Section("figures", "All figures", lead, per_hypothesis(candidates, partial(_pose_table, used=used)))


def _may_be_used(answer: Answer) -> bool:
    """Return whether a machine may use the pose: recognized, without a probable mistake, accurate as needed."""
    missed = any(isinstance(one, AccuracyNeeded) and not one.reached for one in answer.findings)
    return answer.status == "recognized" and not missed and not any(one.subject for one in answer.findings)


def _pose_table(candidate: Candidate, *, used: bool) -> Html:
    h = candidate.hypothesis
    more = [
        ("largest corner sd", f"{MM * h.corner_sd:.2g}", "mm", "any direction"),
        ("rms distance of readings", f"{MM * h.rms:.3g}", "mm", "–"),
        ("chi-square", f"{h.chi2:.3g} with {h.dof} degrees of freedom", "–", "–"),
        ("p-value", f"{h.p_value:.3g}", "–", "–"),
    ]
    tables = [pose_figures(h.T_world_part, h.covariance, more)]
    if used:
        S = upright(candidate.part, h.T_world_part)
        A = SE3.adjoint_inverse(S)
        tables.append(_controllers(UncertainFrame(h.T_world_part @ S, A @ h.covariance @ A.T)))
    return join([*tables, element("p", f"CAD file: {h.file}", class_="note")])


def pose_figures(T: Transforms, C: Covariances, more: Sequence[Sequence[str]] = ()) -> Html:
    """Return a pose and its covariance as a table and as matrices.

    Args:
        T: pose ``T_world_part`` ``(4, 4)``.
        C: covariance of the pose, part frame, right perturbation ``(6, 6)`` [m, rad].
        more: further rows of the table: figure, value, unit and frame.
    """
    R = T[:3, :3]
    in_world = np.sqrt(np.diag(R @ C[:3, :3] @ R.T))
    sds, q = np.sqrt(np.diag(C)), SO3.as_quaternion(R)
    rows: list[Sequence[str]] = [
        (f"{axis} of the part's origin", f"{fixed(MM * p, 3)} ± {MM * s:.3g}", "mm", "world")
        for axis, p, s in zip("xyz", T[:3, 3], in_world, strict=True)
    ]
    rows.append(("quaternion w, x, y, z", ", ".join(fixed(v, 6) for v in q), "–", "part to world"))
    angles = pose_as_brand("paper", T)[3:]
    rows.append(
        ("roll, pitch, yaw (fixed x, y, z)", ", ".join(fixed(v, 4) for v in np.degrees(angles)), "deg", "world")
    )
    rows += [
        (f"rotation about {axis}, 1 sd", f"{np.degrees(s):.3g}", "deg", "part")
        for axis, s in zip("xyz", sds[3:], strict=True)
    ]
    numbers = _matrix(["row x", "row y", "row z", "row 4"], T, "{:.9g}")
    pose = table(["", "x", "y", "z", "position"], numbers, class_="plain")
    names = ["x", "y", "z", "rx", "ry", "rz"]
    covariance = table(["", *names], _matrix(names, C, "{:.3e}"), class_="plain")
    return join(
        [
            table(["figure", "value", "unit", "frame"], [*rows, *more]),
            element("details", element("summary", "Pose as a matrix [m]"), pose),
            element("details", element("summary", "Covariance [m, rad], part frame, right perturbation"), covariance),
        ]
    )


def _controllers(frame: UncertainFrame) -> Html:
    """Return a pose in the notation of each controller."""
    written = [write_pose(name, frame) for name in sorted(BRANDS) if name not in ("paper", "ros")]
    rows = [(w.name, w.text, w.units) for w in written]
    poses = table(["controller", "pose of the part in the world", "units"], rows)
    return element("details", element("summary", "Pose in the notation of controllers"), poses)


def _matrix(names: Sequence[str], M: FloatArray, form: str) -> list[list[str]]:
    return [[name, *(form.format(v) for v in row)] for name, row in zip(names, M, strict=True)]


_NAMED = 5
"""Largest number of readings that are named for a direction."""


def rests_section(candidates: Sequence[Candidate], directions: Sequence[Sequence[Direction]]) -> Section:
    """Return the section with the principal directions of the error and the readings that constrain them.

    Args:
        candidates: hypotheses, best first.
        directions: principal directions of each hypothesis, see :func:`directions_of` and
            :func:`tanteo.planning.explanation.explain`.
    """
    lead = (
        "Independent errors of the pose, the largest first; the overlays in the picture show them. Each bar divides "
        "the information about one error among the readings and the prior, for known shared errors."
    )
    bodies = tuple(_directions(c, d) for c, d in zip(candidates, directions, strict=True))
    return Section("rests", "Which reading determines which direction", lead, bodies)


def directions_of(candidate: Candidate, sensed: Sensed) -> tuple[Direction, ...]:
    """Return the principal errors of a pose with the fraction of the information from each reading, to first order.

    Args:
        candidate: hypothesis with the residuals of the readings.
        sensed: readings of the answer.
    """
    contacts, part = candidate.contacts, candidate.part
    form = sensed.tolerance**2 * contacts.is_distance
    weights = contacts.used[contacts.reading] / (contacts.noise + contacts.repeatability + form)
    known = prior_rows(sensed.prior, part, candidate.hypothesis.T_world_part[None])[1][0]
    out = []
    for way in candidate.ways:
        each = np.bincount(contacts.reading, weights * (contacts.rows @ way.xi) ** 2, minlength=len(sensed.measured))
        rough = float(np.sum((known @ way.xi) ** 2))
        total = max(float(each.sum()) + rough, 1e-300)
        shares = ((sensed.measured.ids[i], float(each[i] / total)) for i in np.argsort(-each, kind="stable"))
        out.append(Direction(way.motion, way.rms, tuple(shares), rough / total))
    return tuple(out)


def _directions(candidate: Candidate, directions: Sequence[Direction]) -> Html:
    if not directions:
        return element("p", "No reading hit anything, so no direction is determined.")
    rows = []
    for k, d in enumerate(directions):
        words = d.motion.brief
        show: Html | str = ""
        if k < len(candidate.ways):  # both are the principal errors of one covariance, the largest first
            show = element("button", "Show", type="button", data_way=k, aria_label=f"Show: {words}")
        rows.append((words, f"{MM * d.moves:.3g}", join([_direction_bar(d), element("div", _determined_by(d))]), show))
    headers = ("possible error", "motion of the corners, rms [mm]", "determined by", "overlays")
    return table(headers, rows, class_="directions")


def _direction_bar(d: Direction) -> Html:
    named = [(f"{name}: {percent(p)}", p, f"s{k % 2}") for k, (name, p) in enumerate(d.shares[:_NAMED])]
    parts = [*named, ("prior", d.prior, "none")]
    spans = [element("span", title=title, class_=kind, style=f"width:{100 * p:.2f}%") for title, p, kind in parts]
    return element("div", *spans, class_="stack", aria_hidden="true")


def _determined_by(d: Direction) -> str:
    named = [f"{name} ({percent(p)})" for name, p in d.shares[:_NAMED] if p >= 0.0005]
    rest, others = sum(p for _, p in d.shares[_NAMED:]), len(d.shares) - _NAMED
    if rest >= 0.0005:
        named.append(f"{others} others ({percent(rest)})")
    if d.prior >= 0.0005:
        named.append(f"prior ({percent(d.prior)})")
    return ", ".join(named) or "nothing"


_MOST_ROWS = 300
"""Largest number of readings in a table or chart."""


def residual_section(candidates: Sequence[Candidate], sensed: Sensed) -> Section:
    """Return the section with the distance of every reading from the surface.

    Args:
        candidates: hypotheses, best first.
        sensed: readings of the answer.
    """
    lead = (
        "Each dot is a reading: its distance to the surface of the part, in standard deviations of its noise. 95 % of "
        "good readings are inside the band. A cross is a reading that does not fit and is excluded."
    )
    return Section("fit", "How the readings fit", lead, per_hypothesis(candidates, lambda c: _residuals(c, sensed)))


def _residuals(candidate: Candidate, sensed: Sensed) -> Html:
    contacts, ids = candidate.contacts, sensed.measured.ids
    rows = _rows(candidate)
    sds = contacts.distances / contacts.sds
    words = [_reading_words(candidate, sensed, i) for i in rows]
    chart = residual_chart([ids[i] for i in rows], sds[rows], ~contacts.used[rows], words)
    cells = [
        [
            ids[i],
            "fits" if contacts.used[i] else element("strong", "✕ does not fit", class_="wrong"),
            f"{MM * contacts.distances[i]:+.3g}",
            f"{MM * contacts.sds[i]:.3g}",
            f"{round(sds[i], 1) + 0.0:+.1f}",
            sensed.measured.features[i] or "–",
            contacts.faces[i],
        ]
        for i in rows
    ]
    headers = ["reading", "", "distance [mm]", "1 sd [mm]", "in sds", "label", "hit"]
    details = element("details", element("summary", "All readings as a table"), table(headers, cells, class_="plain"))
    if len(rows) == len(ids):
        return join([chart, details])
    note = f"{len(rows)} of {len(ids)} readings are shown, among them those that do not fit."
    return join([chart, element("p", note, class_="note"), details])


def _reading_words(candidate: Candidate, sensed: Sensed, i: int) -> str:
    contacts = candidate.contacts
    verdict = "fits" if contacts.used[i] else "does not fit"
    return f"reading {sensed.measured.ids[i]}, {contacts.faces[i]}: {MM * contacts.distances[i]:+.3g} mm, {verdict}"


def _rows(candidate: Candidate) -> IntArray:
    n = len(candidate.contacts.used)
    if n <= _MOST_ROWS:
        return np.arange(n)
    wrong = np.flatnonzero(~candidate.contacts.used)[: _MOST_ROWS // 2]
    return np.unique(np.concatenate([np.linspace(0, n - 1, _MOST_ROWS // 2).astype(np.int64), wrong]))


def rerun_section(run: Run, made: str) -> Section:
    """Return the section with the command that repeats the result, and its files.

    Args:
        run: origin of the result.
        made: program, version and seed, for a note.
    """
    parts = [
        element("pre", element("code", run.command, id="command"), tabindex="0"),
        element("button", "Copy", type="button", id="copy", aria_label="Copy the command"),
        element("p", made, class_="note"),
    ]
    if run.files:
        parts.append(table(["file", "SHA-256, first 16 digits"], run.files))
    return Section("rerun", "Run it again", "The same files and options give the same answer.", (join(parts),))
