"""The result document ``tanteo.recognition/1``: strict JSON, one document (``docs/formats.md``)."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tanteo import __version__
from tanteo.lie import SO3
from tanteo.typing import FloatArray

if TYPE_CHECKING:
    from tanteo.answers import Answer, Hypothesis
    from tanteo.execution import Executed, Visit

SCHEMA = "tanteo.recognition/1"


def recognition_document(answer: Answer, frame: str = "world") -> dict[str, Any]:
    """The result as plain dictionaries, lists, strings and numbers.

    JSON has no infinity: a number that is not finite (a direction that nothing observes) becomes ``null``.

    Args:
        answer: the answer.
        frame: name of the frame that its poses are in.
    """
    found = [{"kind": one.kind, "message": one.message} for one in answer.findings]
    return {
        "schema": SCHEMA,
        "version": __version__,
        "seed": int(answer.seed),
        "status": answer.status,
        "message": answer.message,
        "hypotheses": [_hypothesis(h, frame) for h in answer.hypotheses],
        "unknown_probability": _number(answer.unknown_probability),
        "elapsed_s": {stage: _number(seconds) for stage, seconds in answer.elapsed.items()},
        **({"findings": found} if found else {}),
    }


def recognition_json(answer: Answer, warnings: Sequence[str] = ()) -> str:
    """The result as one JSON document, indented, ending in a newline.

    Args:
        answer: the answer.
        warnings: what else a person was told on the way: files that could not be read, units that look wrong.
    """
    return document_json(recognition_document(answer), warnings)


def document_json(document: dict[str, Any], warnings: Sequence[str] = ()) -> str:
    """A document, with warnings if there are any, as strict JSON, indented, ending in a newline."""
    more = {"warnings": list(warnings)} if warnings else {}
    return json.dumps(document | more, indent=2, allow_nan=False) + "\n"


def executed_json(
    answer: Answer, done: Executed, *, readings: int, clearance: float, warnings: Sequence[str] = ()
) -> str:
    """The result of a run of the hand as one JSON document: the answer, and beside it ``sensing``, what it took.

    Args:
        answer: the answer.
        done: the run.
        readings: that were told.
        clearance: least true distance of the hand from everything [m].
        warnings: as for :func:`recognition_json`.
    """
    sensing = {
        "reached": done.end.reached,
        "why": done.end.why,
        "readings": readings,
        "seconds": _number(done.seconds),
        "travel_m": _number(done.travel),
        "least_clearance_m": _number(clearance),
        "visits": [_visit(visit) for visit in done.visits],
    }
    return document_json(recognition_document(answer) | {"sensing": sensing}, warnings)


def _visit(visit: Visit) -> dict[str, Any]:
    action, step = visit.action, visit.step
    return {
        "number": action.number,
        "origin_m": numbers(action.origin),
        "direction": numbers(action.direction),
        "aimed_at": {"part": action.part, "face": action.face},
        "readings": [] if step is None else list(step.ids),
        "leader": visit.leader,
        "probability": None if step is None else _number(float(step.probabilities.max())),
        "corner_sd_m": None if step is None else _number(step.corner_sd),
        "note": visit.note,
        "seconds": _number(visit.seconds),
        "travel_m": _number(visit.travel),
    }


def _hypothesis(h: Hypothesis, frame: str) -> dict[str, Any]:
    T = np.asarray(h.T_world_part)
    return {
        "part": h.part,
        "file": h.file,
        "probability": _number(h.probability),
        "pose": {
            "frame": frame,
            "position_m": numbers(T[:3, 3]),
            "quaternion_wxyz": numbers(SO3.as_quaternion(T[:3, :3])),
            "matrix": numbers(T),
        },
        "covariance": covariance_document(h.covariance),
        "corner_sd_m": _number(h.corner_sd),
        "unobserved": list(h.unobserved),
        "symmetry": {
            "order": int(h.symmetry_order),
            "poses": [{"matrix": numbers(pose)} for pose in np.asarray(h.symmetry_poses).reshape(-1, 4, 4)],
            "axis": None if h.symmetry_axis is None else _axis(h.symmetry_axis, frame),
        },
        "fit": {
            "chi2": _number(h.chi2),
            "dof": int(h.dof),
            "p_value": _number(h.p_value),
            "rms_m": _number(h.rms),
        },
        "outliers": list(h.outliers),
        "pairings": [{"reading": reading, "feature": feature} for reading, feature in h.pairings],
        "outlier_distances_m": numbers(np.array(h.outlier_distances)),
        "covariance_relative": None if h.covariance_relative is None else covariance_document(h.covariance_relative),
    }


def covariance_document(matrix: FloatArray) -> dict[str, Any]:
    """A pose's covariance with its conventions beside it."""
    return {
        "order": "x y z rx ry rz",
        "frame": "part",
        "perturbation": "right",
        "units": "m rad",
        "matrix": numbers(matrix),
    }


def _axis(axis: FloatArray, frame: str) -> dict[str, Any]:
    return {"frame": frame, "point_m": numbers(axis[0]), "direction": numbers(axis[1])}


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def numbers(array: FloatArray) -> Any:
    """Nested lists; what is not finite becomes ``None``."""
    array = np.asarray(array, dtype=np.float64)
    if array.ndim == 0:
        return _number(float(array))
    return [numbers(row) for row in array]
