"""Answers as lines of text: the best hypothesis, the alternatives, doubts, and the message."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tanteo.geometry import SO3
from tanteo.geometry.limits import NOTABLE
from tanteo.io import pose_as_brand
from tanteo.render.text.layout import PLAIN, Layout, printable
from tanteo.words import from_surface, percent

if TYPE_CHECKING:
    from tanteo.geometry.typing import FloatArray
    from tanteo.posterior import Answer, Hypothesis, PosePrior, Table

_MOST_NAMES = 12
_MOST_PARTS = 3


def answer_lines(
    answer: Answer,
    known: PosePrior | None = None,
    *,
    frame: str | None = None,
    verbose: bool = False,
    layout: Layout = PLAIN,
) -> list[str]:
    """Return an answer as lines of text.

    Args:
        answer: answer to print.
        known: prior of the pose; None without one.
        frame: name of the frame of poses; None for that of the answer.
        verbose: whether to add the pose as a matrix, the pairings, and the times of the stages.
        layout: width and style of the output.
    """
    first = "1. " if answer.equal else ""
    lines = [layout.bold(printable(first + _headline(answer, frame or answer.frame)))]
    lines += [f"  known       {printable(prior_words(known))}"] if known is not None else []
    best = answer.hypotheses[0] if answer.hypotheses else None
    if best is not None:
        lines += _details(best, verbose=verbose)
    for k, other in enumerate(answer.equal, start=2):
        lines += ["", layout.bold(printable(f"{k}. {_headline(other, frame or answer.frame)}"))]
        lines += _details(other.hypotheses[0], verbose=verbose)
    if len(answer.hypotheses) > 1:
        lines += ["", "It could also be:", *_others(answer.hypotheses[1:], layout)]
    if answer.status == "unknown" and best is not None and best.probability > answer.unknown_probability:
        lines += [
            "",
            "The goodness-of-fit test rejects every part. The probabilities assume that one part is right.",
        ]
    elif best is not None or answer.status == "unknown":
        lines += ["", *_parts(answer), f"Unknown object: {percent(answer.unknown_probability)}."]
        if answer.missed_probability > NOTABLE:
            lines.append(f"Poses that the search missed: {percent(answer.missed_probability)}.")
    if best is not None and best.outliers:
        lines.append(f"Readings that do not fit: {_outliers(best)}.")
    if best is not None and best.unobserved:
        lines.append(f"Not observed: {printable('; '.join(best.unobserved))}.")
    if verbose:
        lines.append("Time: " + ", ".join(f"{stage} {s:.3f} s" for stage, s in answer.elapsed.items()) + ".")
    return [*lines, "", printable(answer.message)]


def _headline(answer: Answer, frame: str) -> str:
    if not answer.hypotheses:
        reason = "too little was sensed" if answer.status == "insufficient" else "no part fits these readings"
        return f"{answer.status}: {reason}"
    best = answer.hypotheses[0]
    where = (
        f"{best.part} at {_position(best.T_world_part)} mm, {_turn(best.T_world_part)} deg in the {frame}; "
        f"probability {percent(best.probability)}, largest corner sd {_millimetres(best.corner_sd)}"
    )
    return {
        "recognized": where,
        "ambiguous": f"ambiguous, best guess {where}",
        "insufficient": f"insufficient, best guess {where}",
        "unknown": f"unknown, nearest {where}",
    }[answer.status]


def _parts(answer: Answer) -> list[str]:
    """Return the probability of the best part over all of its poses, if it is more than that of the best pose."""
    return [f"{printable(name)} in any pose: {percent(P)}." for name, P in answer.several_poses[:_MOST_PARTS]]


def _details(best: Hypothesis, *, verbose: bool) -> list[str]:
    q = SO3.as_quaternion(best.T_world_part[:3, :3])
    sds = np.sqrt(np.diag(best.covariance))
    lines = [
        f"  file        {printable(best.file)}",
        f"  quaternion  w {q[0]:z.6f}  x {q[1]:z.6f}  y {q[2]:z.6f}  z {q[3]:z.6f}",
        f"  sd          x {sds[0] * 1e3:.3g}  y {sds[1] * 1e3:.3g}  z {sds[2] * 1e3:.3g} mm, "
        f"rx {np.degrees(sds[3]):.3g}  ry {np.degrees(sds[4]):.3g}  rz {np.degrees(sds[5]):.3g} deg, part frame",
        f"  fit         rms {_millimetres(best.rms)}, chi2 {best.chi2:.3g} with {best.dof} dof, p {best.p_value:.3g}",
    ]
    if best.covariance_relative is not None:
        same = np.sqrt(np.diag(best.covariance_relative))[:3] * 1e3
        lines.append("  unshared    " + "x {:.3g} y {:.3g} z {:.3g} mm, if shared errors were known".format(*same))
    if best.symmetry_order > 1:
        lines.append(f"  symmetry    {best.symmetry_order} equivalent poses, reported as one")
    if best.spherical:
        lines.append("  symmetry    all rotations about its centre are equivalent")
    if best.symmetry_axis is not None:
        (x, y, z), d = best.symmetry_axis[0] * 1e3, best.symmetry_axis[1]
        lines.append(
            f"  symmetry    rotations about its axis through ({x:.2f}, {y:.2f}, {z:.2f}) mm along "
            f"({d[0]:.3f}, {d[1]:.3f}, {d[2]:.3f}) are equivalent"
        )
    if verbose:
        lines.append("  T_world_part (metres):")
        lines += ["    " + "  ".join(f"{value: .9f}" for value in row) for row in best.T_world_part]
        lines += [f"  {printable(reading)} on {printable(feature)}" for reading, feature in best.pairings]
    return lines


def _others(hypotheses: tuple[Hypothesis, ...], layout: Layout) -> list[str]:
    headers = ["part", "probability", "x mm", "y mm", "z mm", "roll", "pitch", "yaw deg", "corner sd mm"]
    rows = []
    for h in hypotheses:
        x = pose_as_brand("paper", h.T_world_part)
        numbers = [f"{v * 1e3:z.2f}" for v in x[:3]] + [f"{np.degrees(v):z.2f}" for v in x[3:]]
        rows.append([h.part, percent(h.probability), *numbers, f"{h.corner_sd * 1e3:.3g}"])
    return layout.table(headers, rows, indent=2)


def _position(T: np.ndarray) -> str:
    return "x {:z.2f} y {:z.2f} z {:z.2f}".format(*T[:3, 3] * 1e3)


def _turn(T: np.ndarray) -> str:
    return "roll {:z.2f} pitch {:z.2f} yaw {:z.2f}".format(*np.degrees(pose_as_brand("paper", T)[3:]))


def _millimetres(metres: float) -> str:
    return f"{metres * 1e3:.3g} mm"


def _outliers(best: Hypothesis) -> str:
    """Return the names of the outliers, with their distances from the surface if known."""
    off = best.outlier_distances or (float("nan"),) * len(best.outliers)
    shown = [
        printable(name) + (f" ({from_surface(d, 3)})" if np.isfinite(d) else "")
        for name, d in zip(best.outliers, off, strict=True)
    ]
    rest = len(shown) - _MOST_NAMES
    return ", ".join(shown[:_MOST_NAMES]) + (f" and {rest} more" if rest > 0 else "")


def prior_words(prior: PosePrior) -> str:
    """Return the prior of a pose as text for the user: table, box, and pose with standard deviations.

    Args:
        prior: prior of the pose.
    """
    words = (_table_words(prior), *map(_rest_words, prior.rests), _box_words(prior), _near_words(prior))
    return "; ".join(text for text in words if text)


def _table_words(prior: PosePrior) -> str:
    if prior.table is None:
        return ""
    flat = f"z {1e3 * prior.table.point[2]:.6g} mm" if prior.table.normal[2] == 1 else _plane_words(prior.table)
    return f"rests on a table at {flat} (sd {1e3 * prior.table.sd:.3g} mm)"


def _rest_words(plane: Table) -> str:
    return f"touches a plane at {_plane_words(plane)} (sd {1e3 * plane.sd:.3g} mm)"


def _plane_words(plane: Table) -> str:
    x, y, z = 1e3 * plane.point
    return f"({x:.6g}, {y:.6g}, {z:.6g}) mm, normal ({_numbers(plane.normal, 4)}),"


def _box_words(prior: PosePrior) -> str:
    if prior.box is None:
        return ""
    low, high = 1e3 * prior.box
    return f"in the box from ({_numbers(low)}) to ({_numbers(high)}) mm"


def _near_words(prior: PosePrior) -> str:
    if prior.T_world_part is None or prior.covariance is None:
        return ""
    place = pose_as_brand("paper", prior.T_world_part)
    sds = [np.sqrt(np.linalg.eigvalsh(block)[-1]) for block in (prior.covariance[:3, :3], prior.covariance[3:, 3:])]
    return (
        f"near ({_numbers(1e3 * place[:3])}) mm, roll pitch yaw ({_numbers(np.degrees(place[3:]))}) deg "
        f"(sd up to {1e3 * sds[0]:.3g} mm, {np.degrees(sds[1]):.3g} deg)"
    )


def _numbers(values: FloatArray, digits: int = 6) -> str:
    return ", ".join(f"{v + 0.0:.{digits}g}" for v in values)
