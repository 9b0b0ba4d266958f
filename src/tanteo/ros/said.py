"""What the node says beside poses: the next reading as a document and a pose, its own state as diagnostics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tanteo import io
from tanteo.answers import Answer
from tanteo.lie import SE3, SO3
from tanteo.session import Action, Done

SCHEMA = "tanteo.next/1"


def next_document(asked: Action | Done, frame: str) -> dict[str, Any]:
    """The next reading, ``tanteo.next/1`` (``docs/ros.md``), SI units, in a frame.

    Example:
        >>> next_document(Done(True, "Enough."), "base")["status"]
        'reached'
    """
    if isinstance(asked, Done):
        return {"schema": SCHEMA, "status": "reached" if asked.reached else "nothing", "why": asked.why}
    return {
        "schema": SCHEMA, "status": "ask", "frame": frame, "origin_m": list(map(float, asked.origin)),
        "direction": list(map(float, asked.direction)), "max_range_m": float(asked.max_range),
        "expected_m": float(asked.expected), "radius_m": float(asked.radius), "part": asked.part, "face": asked.face,
        "gain_nats": None if np.isnan(asked.gain) else float(asked.gain), "why": asked.why,
    }  # fmt: skip


def next_pose(asked: Action | Done, stamp: int, frame: str) -> dict[str, Any]:
    """``geometry_msgs/PoseStamped`` of it: x along the beam, as of ``sensor_msgs/Range``."""
    assert isinstance(asked, Action)
    T = SE3.from_parts(SO3.frame_from_axis(asked.direction, 0), asked.origin)
    return {"header": io.ros_header(stamp, frame), "pose": io.pose(T)}


def state_message(
    answer: Answer | None, taken: int, left_out: Mapping[str, int], delays: Sequence[float], stamp: int
) -> dict[str, Any]:
    """``diagnostic_msgs/DiagnosticArray`` of the node.

    Args:
        answer: so far.
        taken: readings that were told.
        left_out: readings that were not, by why.
        delays: from the stamp of a reading to its answer, of the last ones [s].
        stamp: moment [ns].
    """
    values: dict[str, object] = {"readings": taken}
    values |= {f"left out, {why}": count for why, count in left_out.items()}
    if delays:
        values["stamp to answer, median [ms]"] = f"{1e3 * float(np.median(delays)):.1f}"
    if answer is None:
        return io.diagnostics_message(io.WARN, "No reading has come that can be used.", values, stamp)
    values |= {f"probability {h.part}, {k + 1}": f"{h.probability:.4f}" for k, h in enumerate(answer.hypotheses)}
    values["probability unknown object"] = f"{answer.unknown_probability:.4f}"
    if answer.best is not None:
        values["largest corner sd [mm]"] = f"{1e3 * answer.best.corner_sd:.3f}"
    level = io.OK if answer.status == "recognized" else io.WARN
    return io.diagnostics_message(level, f"{answer.status}: {answer.message}", values, stamp)
