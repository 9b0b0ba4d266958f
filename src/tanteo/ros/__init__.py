"""Provide a ROS 2 node for recognition and localization: it reads ranges and touches and publishes poses.

:class:`Intake` converts messages into readings, and a :class:`Knowledge` converts readings into an answer. Only
``network`` and ``node`` import rclpy. :mod:`tanteo.io` defines the meaning of messages, because recordings need it too.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.ros.intake import Intake, Patience
    from tanteo.ros.knowledge import Anywhere, Knowledge, Prior
    from tanteo.ros.latency import STEP, Latency, estimate_latency
    from tanteo.ros.network import Settings, opened
    from tanteo.ros.node import RosNode
    from tanteo.ros.said import next_document, next_pose, state_message
    from tanteo.ros.types import NEEDS_ROS, filled

__all__ = [
    "NEEDS_ROS", "STEP", "Anywhere", "Intake", "Knowledge", "Latency", "Patience", "Prior", "RosNode", "Settings",
    "estimate_latency", "filled", "next_document", "next_pose", "opened", "state_message",
]  # fmt: skip

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {
        "intake": "Intake Patience",
        "knowledge": "Anywhere Knowledge Prior",
        "latency": "STEP Latency estimate_latency",
        "network": "Settings opened",
        "node": "RosNode",
        "said": "next_document next_pose state_message",
        "types": "NEEDS_ROS filled",
    },
)
