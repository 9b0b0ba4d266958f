"""Build ROS messages of answers as plain dictionaries by field name; the sender converts them to message types.

A missing field has its default. Covariances are in the order and frame of ROS (``docs/conventions.md``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from tanteo.geometry import UncertainFrame, as_ros_covariance
from tanteo.geometry.typing import Covariances, FloatArray, Transforms, Vectors
from tanteo.io.poses.poses import pose_as_brand
from tanteo.parts import Part

POSE_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
MARKERS, DIAGNOSTICS = "visualization_msgs/msg/MarkerArray", "diagnostic_msgs/msg/DiagnosticArray"
"""Types of the messages sent."""
OK, WARN, ERROR, STALE = range(4)
"""Levels of ``diagnostic_msgs/DiagnosticStatus``."""
_SPHERES, _LINES, _TEXT, _DELETE_ALL = 7, 5, 9, 3
"""Types and actions of ``visualization_msgs/Marker``."""
_COLORS = ((0.0, 0.45, 0.7), (0.9, 0.6, 0.0), (0.0, 0.6, 0.5), (0.8, 0.4, 0.7), (0.35, 0.7, 0.9))
_MANY = 2000
"""Number of edges above which the bounding box of a part is drawn instead."""
_BOX = ((0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3), (4, 6), (5, 7), (0, 4), (1, 5), (2, 6), (3, 7))
"""Pairs of box corners connected by an edge, with x varying slowest."""


class Placed(NamedTuple):
    """Part at a pose, with the probability of this hypothesis."""

    part: Part
    T: Transforms
    probability: float


def ros_header(stamp: int, frame: str) -> dict[str, Any]:
    """Return a ``std_msgs/Header``.

    Args:
        stamp: time stamp [ns].
        frame: name of the frame.
    """
    return {"stamp": time_of(stamp), "frame_id": frame}


def time_of(stamp: int) -> dict[str, int]:
    """Return a ``builtin_interfaces/Time``.

    Args:
        stamp: time stamp [ns].
    """
    return {"sec": stamp // 10**9, "nanosec": stamp % 10**9}


def pose_message(T: Transforms, covariance: Covariances, stamp: int, frame: str) -> dict[str, Any]:
    """Return a ``geometry_msgs/PoseWithCovarianceStamped``.

    Args:
        T: ``T_world_part`` ``(4, 4)`` [m].
        covariance: pose covariance ``(6, 6)``, order x y z rx ry rz, part frame, right perturbation [m, rad].
        stamp: time stamp [ns].
        frame: name of the world frame.

    Example:
        >>> import numpy as np
        >>> message = pose_message(np.eye(4), 1e-6 * np.eye(6), 0, "base")
        >>> message["pose"]["covariance"][:2]
        [1e-06, 0.0]
    """
    numbers = as_ros_covariance(UncertainFrame(T, covariance)).tolist()
    return {"header": ros_header(stamp, frame), "pose": {"pose": pose(T), "covariance": numbers}}


def pose(T: Transforms) -> dict[str, Any]:
    """Return a ``geometry_msgs/Pose``.

    Args:
        T: pose ``(4, 4)`` [m].
    """
    values = pose_as_brand("ros", T).tolist()
    return {"position": _named("xyz", values[:3]), "orientation": _named("xyzw", values[3:])}


def transform(T: Transforms, parent: str, child: str, stamp: int) -> dict[str, Any]:
    """Return a ``tf2_msgs/TFMessage`` with one transform.

    Args:
        T: ``T_parent_child`` ``(4, 4)`` [m].
        parent: name of the parent frame.
        child: name of the child frame.
        stamp: time stamp [ns].
    """
    placed = pose(T)
    moved = {"translation": placed["position"], "rotation": placed["orientation"]}
    return {"transforms": [{"header": ros_header(stamp, parent), "child_frame_id": child, "transform": moved}]}


def point_message(p_world: Vectors, stamp: int, frame: str) -> dict[str, Any]:
    """Return a ``geometry_msgs/PointStamped``.

    Args:
        p_world: point ``(3,)`` [m].
        stamp: time stamp [ns].
        frame: name of the point's frame.
    """
    return {"header": ros_header(stamp, frame), "point": _named("xyz", np.asarray(p_world).tolist())}


def range_message(distance: float, most: float, sd: float, stamp: int, frame: str) -> dict[str, Any]:
    """Return a ``sensor_msgs/Range``.

    Args:
        distance: range [m]; infinite if the beam hit nothing.
        most: largest range of the sensor [m].
        sd: standard deviation [m]; NaN if unknown.
        stamp: time stamp [ns].
        frame: name of the sensor's frame.
    """
    variance = {} if np.isnan(sd) else {"variance": sd * sd}
    return {"header": ros_header(stamp, frame), "range": distance, "max_range": most, **variance}


def marker_message(
    placed: Sequence[Placed], points: Vectors | None, stamp: int, frame: str, size: float = 2e-3
) -> dict[str, Any]:
    """Return a ``visualization_msgs/MarkerArray``: hypotheses as edges with names, readings as points.

    Args:
        placed: hypotheses, best first; less probable ones are more transparent.
        points: points of the readings, world frame ``(n, 3)`` [m]; None for none.
        stamp: time stamp [ns].
        frame: name of the world frame.
        size: diameter of a drawn point [m].
    """
    common = {"header": ros_header(stamp, frame), "ns": "tanteo", "pose": pose(np.eye(4))}
    markers: list[dict[str, Any]] = [{**common, "action": _DELETE_ALL}]
    for k, one in enumerate(placed):
        faint = _color(_COLORS[k % len(_COLORS)], 0.25 + 0.75 * one.probability)
        lines = [_named("xyz", p) for p in edges(one.part).reshape(-1, 3).tolist()]
        markers.append({
            **common, "id": 2 * k, "type": _LINES, "pose": pose(one.T), "scale": {"x": 0.4 * size}, "color": faint,
            "points": lines,
        })  # fmt: skip
        above = one.T @ np.append(one.part.centroid + np.array([0.0, 0.0, one.part.radius]), 1.0)
        markers.append({
            **common, "id": 2 * k + 1, "type": _TEXT, "scale": {"z": max(5 * size, 0.2 * one.part.radius)},
            "color": faint, "text": f"{one.part.name} {one.probability:.1%}",
            "pose": {"position": _named("xyz", above[:3].tolist()), "orientation": {"w": 1.0}},
        })  # fmt: skip
    if points is not None and len(points):
        markers.append({
            **common, "ns": "tanteo readings", "type": _SPHERES, "scale": _named("xyz", [size] * 3),
            "color": _color((0.85, 0.1, 0.1), 1.0), "points": [_named("xyz", p) for p in np.asarray(points).tolist()],
        })  # fmt: skip
    return {"markers": markers}


def edges(part: Part) -> FloatArray:
    """Return line segments ``(n, 2, 3)`` [m] that draw a part: its straight edges, or its bounding box.

    Args:
        part: the part.
    """
    ends = part.edges.ends
    if 0 < len(ends) <= _MANY:
        return ends
    corners = np.array(
        [[part.box[i, 0], part.box[j, 1], part.box[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    )
    return corners[np.array(_BOX)]


def diagnostics_message(
    level: int, message: str, values: Mapping[str, object], stamp: int, name: str = "tanteo"
) -> dict[str, Any]:
    """Return a ``diagnostic_msgs/DiagnosticArray`` with one status.

    Args:
        level: one of ``OK``, ``WARN``, ``ERROR``, ``STALE``.
        message: summary of the status.
        values: details by name.
        stamp: time stamp [ns].
        name: name of the component.
    """
    pairs = [{"key": key, "value": str(value)} for key, value in values.items()]
    status = {"level": level, "name": name, "message": message, "hardware_id": "", "values": pairs}
    return {"header": ros_header(stamp, ""), "status": [status]}


def _named(names: str, values: Sequence[float]) -> dict[str, float]:
    return dict(zip(names, map(float, values), strict=True))


def _color(rgb: Sequence[float], alpha: float) -> dict[str, float]:
    return _named("rgba", [*rgb, min(alpha, 1.0)])
