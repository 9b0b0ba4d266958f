"""A node of ROS 2 that recognises and locates: ranges and touches from topics, poses with covariance to topics.

Messages become readings in :class:`Intake`, readings an answer in a :class:`Knowledge`; only ``network`` and
``node`` know rclpy. What messages mean, and what answers are as messages, is in :mod:`tanteo.io`, as recordings need
it too.
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
