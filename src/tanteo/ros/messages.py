"""Messages of the node other than poses of parts: the next reading, and diagnostics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tanteo import io
from tanteo.geometry import SE3, SO3
from tanteo.planning import Action, Done
from tanteo.posterior import Answer

SCHEMA = "tanteo.next/1"


def next_document(asked: Action | Done, frame: str) -> dict[str, Any]:
    """Return the next reading as a document ``tanteo.next/1`` (``docs/ros.md``) in SI units.

    Args:
        asked: next action, or the reason why there is none.
        frame: name of the frame of the coordinates.

    Example:
        >>> next_document(Done(False, ()), "base")["status"]
        'nothing'
    """
    if isinstance(asked, Done):
        return {"schema": SCHEMA, "status": "reached" if asked.reached else "nothing", "why": asked.message}
    return {
        "schema": SCHEMA, "status": "ask", "frame": frame, "origin_m": list(map(float, asked.origin)),
        "direction": list(map(float, asked.direction)), "max_range_m": float(asked.max_range),
        "expected_m": float(asked.expected), "radius_m": float(asked.radius), "part": asked.part, "face": asked.face,
        "gain_nats": None if np.isnan(asked.gain) else float(asked.gain), "why": asked.reason.message,
    }  # fmt: skip


def next_pose(asked: Action | Done, stamp: int, frame: str) -> dict[str, Any]:
    """Return the next reading as ``geometry_msgs/PoseStamped``, x along the beam as in ``sensor_msgs/Range``.

    Args:
        asked: next action.
        stamp: time stamp [ns].
        frame: name of the frame of the coordinates.
    """
    assert isinstance(asked, Action)
    T = SE3.from_parts(SO3.frame_from_axis(asked.direction, 0), asked.origin)
    return {"header": io.documents.ros_header(stamp, frame), "pose": io.documents.pose(T)}


def state_message(
    answer: Answer | None, taken: int, left_out: Mapping[str, int], delays: Sequence[float], stamp: int
) -> dict[str, Any]:
    """Return the state of the node as ``diagnostic_msgs/DiagnosticArray``.

    Args:
        answer: latest answer; None before the first.
        taken: number of used readings.
        left_out: number of dropped readings by reason.
        delays: recent delays from the stamp of a reading to its answer [s].
        stamp: time stamp [ns].
    """
    values: dict[str, object] = {"readings": taken}
    values |= {f"left out, {why}": count for why, count in left_out.items()}
    if delays:
        values["stamp to answer, median [ms]"] = f"{1e3 * float(np.median(delays)):.1f}"
    if answer is None:
        return io.documents.diagnostics_message(
            io.documents.WARN, "No reading has come that can be used.", values, stamp
        )
    values |= {f"probability {h.part}, {k + 1}": f"{h.probability:.4f}" for k, h in enumerate(answer.hypotheses)}
    values["probability unknown object"] = f"{answer.unknown_probability:.4f}"
    if answer.best is not None:
        values["largest corner sd [mm]"] = f"{1e3 * answer.best.corner_sd:.3f}"
    level = io.documents.OK if answer.status == "recognized" else io.documents.WARN
    return io.documents.diagnostics_message(level, f"{answer.status}: {answer.message}", values, stamp)
