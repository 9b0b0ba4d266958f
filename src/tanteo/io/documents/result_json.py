"""Write results as strict JSON: ``tanteo.recognition/1``, its extensions, explanations (``docs/formats_json.md``)."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from tanteo import __version__
from tanteo.geometry import SO3
from tanteo.geometry.typing import FloatArray
from tanteo.posterior import Answer
from tanteo.words import Finding
from tanteo.words.findings import NothingSeen

if TYPE_CHECKING:
    from tanteo.planning.execution import Executed, Visit
    from tanteo.planning.explanation import Explanation
    from tanteo.posterior import Hypothesis
    from tanteo.vision import Sight, Sighting
    from tanteo.vision.answers import Question
    from tanteo.vision.ellipse_fit import Ellipse

EMPTY = Answer("unknown", (NothingSeen(),), (), 1.0)
"""Answer for an image in which no object is found."""


def strict(value: Any) -> Any:
    """Return a value as dictionaries, lists, strings and numbers, with ``None`` for numbers that are not finite.

    Args:
        value: nested mappings, sequences, arrays and scalars.
    """
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {key: strict(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [strict(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def document_json(document: dict[str, Any], warnings: Sequence[str] = (), indent: int = 2) -> str:
    """Return a document as strict JSON text that ends in a newline.

    Args:
        document: nested dictionaries, lists, arrays and scalars.
        warnings: warnings to add under the key ``warnings``; the key is omitted if there are none.
        indent: number of spaces per level.
    """
    more = {"warnings": list(warnings)} if warnings else {}
    return json.dumps(strict(document | more), indent=indent, allow_nan=False) + "\n"


def recognition_document(answer: Answer, frame: str | None = None) -> dict[str, Any]:
    """Return an answer as plain dictionaries, lists, strings and numbers; numbers that are not finite become ``None``.

    Args:
        answer: the answer.
        frame: name of the frame of its poses; None for that of the answer.
    """
    frame = frame or answer.frame
    document = {
        "schema": "tanteo.recognition/1", "version": __version__, "seed": int(answer.seed), "status": answer.status,
        "message": answer.message, "hypotheses": [_hypothesis(h, frame) for h in answer.hypotheses],
        "parts": [{"part": name, "probability": float(P)} for name, P in answer.parts],
        "unknown_probability": float(answer.unknown_probability),
        "missed_probability": float(answer.missed_probability), "elapsed_s": answer.elapsed,
    }  # fmt: skip
    if answer.equal:
        document["equal_parts"] = [
            {"unknown_probability": float(one.unknown_probability), **_hypothesis(one.hypotheses[0], frame)}
            for one in (answer, *answer.equal)
        ]
    if answer.findings:
        document["findings"] = [finding_document(one) for one in answer.findings]
    return dict(strict(document))


def finding_document(finding: Finding) -> dict[str, Any]:
    """Return a finding as a dictionary of kind, role, message, and its values in SI units.

    Args:
        finding: the finding.
    """
    return {"kind": finding.kind, "role": finding.role, "message": finding.message, "values": asdict(finding)}


def recognition_json(answer: Answer, warnings: Sequence[str] = ()) -> str:
    """Return an answer as JSON text that ends in a newline.

    Args:
        answer: the answer.
        warnings: other messages to the user, such as unreadable files or suspicious units.
    """
    return document_json(recognition_document(answer), warnings)


def _hypothesis(h: Hypothesis, frame: str) -> dict[str, Any]:
    T = np.asarray(h.T_world_part)
    axis = h.symmetry_axis
    relative = h.covariance_relative
    axis_document = None if axis is None else {"frame": frame, "point_m": axis[0], "direction": axis[1]}
    q = SO3.as_quaternion(T[:3, :3])
    return {
        "part": h.part, "file": h.file, "probability": float(h.probability),
        "pose": {"frame": frame, "position_m": T[:3, 3], "quaternion_wxyz": q, "matrix": T},
        "covariance": covariance_document(h.covariance),
        "corner_sd_m": float(h.corner_sd), "unobserved": h.unobserved,
        "symmetry": {
            "order": int(h.symmetry_order),
            "poses": [{"matrix": pose} for pose in np.asarray(h.symmetry_poses).reshape(-1, 4, 4)],
            "axis": axis_document, "spherical": bool(h.spherical),
        },
        "fit": {"chi2": float(h.chi2), "dof": int(h.dof), "p_value": float(h.p_value), "rms_m": float(h.rms)},
        "noise_scale": [float(value) for value in h.noise_scale],
        "outliers": h.outliers,
        "pairings": [{"reading": reading, "feature": feature} for reading, feature in h.pairings],
        "outlier_distances_m": np.array(h.outlier_distances, dtype=np.float64),
        "covariance_relative": None if relative is None else covariance_document(relative),
    }  # fmt: skip


def covariance_document(matrix: FloatArray) -> dict[str, Any]:
    """Return a pose covariance as a dictionary that also states its conventions.

    Args:
        matrix: covariance ``(6, 6)``, order x y z rx ry rz, part frame, right perturbation [m, rad].
    """
    conventions = {"order": "x y z rx ry rz", "frame": "part", "perturbation": "right", "units": "m rad"}
    return {**conventions, "matrix": np.asarray(matrix)}


def executed_json(
    answer: Answer,
    done: Executed,
    *,
    readings: int,
    clearance: float,
    arm: Mapping[str, Any] | None = None,
    warnings: Sequence[str] = (),
) -> str:
    """Return the result of an execution by the robot as JSON text: the answer, and under ``sensing`` its cost.

    Args:
        answer: the answer.
        done: record of the execution.
        readings: number of readings used.
        clearance: smallest true distance between hand and obstacles [m].
        arm: facts about the arm that carried the hand; None without one.
        warnings: other messages to the user, see :func:`recognition_json`.
    """
    sensing = {
        "reached": done.end.reached, "why": done.end.message, "readings": readings, "seconds": done.seconds,
        "travel_m": done.travel, "least_clearance_m": clearance, "visits": [_visit(visit) for visit in done.visits],
    }  # fmt: skip
    sensing |= {} if arm is None else {"arm": dict(arm)}
    return document_json(recognition_document(answer) | {"sensing": sensing}, warnings)


def _visit(visit: Visit) -> dict[str, Any]:
    action = visit.action
    step = visit.step
    return {
        "number": action.number, "origin_m": action.origin, "direction": action.direction,
        "aimed_at": {"part": action.part, "face": action.face},
        "readings": [] if step is None else step.ids, "leader": visit.leader,
        "probability": None if step is None else step.probabilities.max(),
        "corner_sd_m": None if step is None else step.corner_sd,
        "note": visit.note, "seconds": visit.seconds, "travel_m": visit.travel,
    }  # fmt: skip


def sight_json(sight: Sight, warnings: Sequence[str] = ()) -> str:
    """Return the document ``tanteo.recognition/1`` of the largest object in an image, with ``objects`` for all.

    Args:
        sight: objects recognized in an image.
        warnings: other messages to the user, see :func:`recognition_json`.
    """
    first = sight.objects[0].answer if sight.objects else EMPTY
    objects = {"objects": [_object(seen, sight.frame) for seen in sight.objects]}
    arcs = {"ellipses": [_ellipse(e) for e in sight.ellipses.found], "refused_arcs": list(sight.ellipses.refused)}
    return document_json(recognition_document(first, sight.frame) | objects | arcs, warnings)


def _ellipse(ellipse: Ellipse) -> dict[str, Any]:
    """Return an ellipse in undistorted pixels; its covariance is that of ``cx, cy, Pxx, Pyy, Pxy``."""
    return {
        "centre_px": ellipse.centre, "shape_px": ellipse.shape, "covariance_px2": ellipse.covariance,
        "semi_axes_px": ellipse.semi_axes, "arc_rad": ellipse.arc, "points": ellipse.count, "dark_inside": ellipse.dark,
    }  # fmt: skip


def _object(seen: Sighting, frame: str) -> dict[str, Any]:
    from tanteo.vision import DESCRIPTOR_NAMES

    answer = recognition_document(seen.answer, frame)
    kept = {key: answer[key] for key in ("status", "message", "hypotheses", "parts", "unknown_probability")}
    region = None
    outline = seen.outline
    if seen.region is not None:
        x0, x1, y0, y1 = seen.region.box
        drawn = outline and {name: {"value": outline[name], "sd": outline.sd(name)} for name in DESCRIPTOR_NAMES}
        region = {"box_px": [x0, y0, x1, y1], "leaves_the_image": seen.region.cut, "outline": drawn}
    return {
        **kept,
        "region": region,
        "rims": seen.rims,
        "question": None if seen.question is None else _question(seen.question),
    }


def _question(question: Question) -> dict[str, Any]:
    answers = zip(question.answers, question.heights, strict=True)
    parts = [{"part": name, "height_m": float(height)} for name, height in answers]
    return {"point_m": [float(v) for v in question.point], "answers": parts, "words": question.words}


def explanation_document(explanation: Explanation) -> dict[str, Any]:
    """Return the document ``tanteo.explanation/1``: the information of each reading, in metres and nats.

    Args:
        explanation: information of each reading and support of each pose direction.
    """
    added = [
        {
            "readings": a.ids, "faces": a.faces, "part": a.part, "probability": a.probability,
            "about_part_nats": a.about_part, "about_pose_nats": a.about_pose, "motion": str(a.motion or ""),
            "narrowed": a.narrowed, "corner_sd_before_m": a.corner_sd_before, "corner_sd_m": a.corner_sd,
        }
        for a in explanation.added
    ]  # fmt: skip
    directions = [
        {"motion": str(d.motion), "corners_move_m": d.moves, "shares": dict(d.shares), "prior": d.prior}
        for d in explanation.directions
    ]
    head = {"schema": "tanteo.explanation/1", "part": explanation.part}
    return dict(strict({**head, "added": added, "directions": directions}))


_ROUNDING = 1e-6, 1e-9
"""Relative and absolute difference up to which two numbers count as equal except for rounding."""

_ELSEWHERE = ("version", "elapsed_s", "file")
"""Keys whose values may differ between two runs."""


def differences(then: Mapping[str, Any], now: Mapping[str, Any]) -> tuple[tuple[str, ...], bool]:
    """Compare two documents ``tanteo.recognition/1``.

    Args:
        then: recorded document.
        now: recomputed document.

    Returns:
        One line for each value that differs by more than rounding, and whether the documents are identical.
    """
    if "findings" not in then:  # records of earlier versions have no findings
        now = {key: value for key, value in now.items() if key != "findings"}
    pairs = list(_pairs("", then, now))
    return tuple(f"{key}: {a!r} then, {b!r} now" for key, a, b in pairs if not _close(a, b)), not pairs


def _pairs(key: str, a: Any, b: Any) -> Iterator[tuple[str, Any, Any]]:
    """Yield key and both values wherever two documents are not equal."""
    if isinstance(a, Mapping) and isinstance(b, Mapping) and a.keys() == b.keys():
        for name in a:
            if name not in _ELSEWHERE:
                yield from _pairs(f"{key}.{name}" if key else name, a[name], b[name])
    elif isinstance(a, Sequence) and isinstance(b, Sequence) and not isinstance(a, str) and len(a) == len(b):
        for k, (one, other) in enumerate(zip(a, b, strict=True)):
            yield from _pairs(f"{key}[{k}]", one, other)
    elif a != b:
        yield key, a, b


def _close(a: Any, b: Any) -> bool:
    if any(isinstance(x, bool) or not isinstance(x, int | float) for x in (a, b)):
        return False
    relative, absolute = _ROUNDING
    return bool(abs(a - b) <= max(relative * max(abs(a), abs(b)), absolute))
