"""Messages of the node about the next reading and its state, as plain dictionaries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tanteo import io
from tanteo.geometry import SE3, SO3
from tanteo.planning import Action, Done
from tanteo.posterior import Answer

SCHEMA = "tanteo.next/1"


def next_document(action: Action | Done, frame: str) -> dict[str, Any]:
    """Return the next reading as a document ``tanteo.next/1`` (``docs/ros.md``) in SI units.

    Args:
        action: next action, or the reason why there is none.
        frame: name of the frame of the coordinates.

    Example:
        >>> next_document(Done(False, ()), "base")["status"]
        'nothing'
    """
    if isinstance(action, Done):
        return {"schema": SCHEMA, "status": "reached" if action.reached else "nothing", "why": action.message}
    return {
        "schema": SCHEMA, "status": "ask", "frame": frame, "origin_m": list(map(float, action.origin)),
        "direction": list(map(float, action.direction)), "max_range_m": float(action.max_range),
        "expected_m": float(action.expected), "radius_m": float(action.radius), "part": action.part,
        "face": action.face,
        "gain_nats": None if np.isnan(action.gain) else float(action.gain), "why": action.reason.message,
    }  # fmt: skip


def next_pose(action: Action | Done, stamp: int, frame: str) -> dict[str, Any]:
    """Return the next reading as ``geometry_msgs/PoseStamped``, x along the beam as in ``sensor_msgs/Range``.

    Args:
        action: next action.
        stamp: time stamp [ns].
        frame: name of the frame of the coordinates.
    """
    assert isinstance(action, Action)
    T = SE3.from_parts(SO3.frame_from_axis(action.direction, 0), action.origin)
    return {"header": io.documents.ros_header(stamp, frame), "pose": io.documents.pose(T)}


def state_message(
    answer: Answer | None, taken: int, dropped: Mapping[str, int], delays: Sequence[float], stamp: int
) -> dict[str, Any]:
    """Return the state of the node as ``diagnostic_msgs/DiagnosticArray``.

    Args:
        answer: latest answer; None before the first.
        taken: number of used readings.
        dropped: number of dropped readings by reason.
        delays: recent delays from the stamp of a reading to its answer [s].
        stamp: time stamp [ns].
    """
    values: dict[str, object] = {"readings": taken}
    values |= {f"dropped, {why}": count for why, count in dropped.items()}
    if delays:
        values["stamp to answer, median [ms]"] = f"{1e3 * float(np.median(delays)):.1f}"
    if answer is None:
        return io.documents.diagnostics_message(io.documents.WARN, "No usable reading has arrived.", values, stamp)
    values |= {f"probability {h.part}, {k + 1}": f"{h.probability:.4f}" for k, h in enumerate(answer.hypotheses)}
    values |= {f"probability {name}, any pose": f"{P:.4f}" for name, P in answer.parts}
    values["probability unknown object"] = f"{answer.unknown_probability:.4f}"
    if answer.best is not None:
        values["largest corner sd [mm]"] = f"{1e3 * answer.best.corner_sd:.3f}"
    level = io.documents.OK if answer.status == "recognized" else io.documents.WARN
    return io.documents.diagnostics_message(level, f"{answer.status}: {answer.message}", values, stamp)


def part_transform(pose: dict[str, Any], frame: str) -> dict[str, Any]:
    """Return the ``tf2_msgs/TFMessage`` of a part whose pose is sent.

    Args:
        pose: fields of the ``PoseWithCovarianceStamped``.
        frame: name of the part's frame.
    """
    own = pose["pose"]["pose"]
    moved = {"translation": own["position"], "rotation": own["orientation"]}
    return {"transforms": [{"header": pose["header"], "child_frame_id": frame, "transform": moved}]}
