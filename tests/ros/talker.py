"""Another process on the network of the node: a sensor on a hand that rests before each reading, and a listener.

``talker.py PLAN.json``: ``static`` is the sensor on the hand, ``steps`` are pairs of the hand's pose and a range. It
prints the messages of the node as one JSON document.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import Range
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from tanteo import io
from tanteo.ros import filled

WAIT = 20.0
KEPT = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Talker:
    def __init__(self) -> None:
        self.node = rclpy.create_node("talker")
        self.tf = self.node.create_publisher(TFMessage, "/tf", 100)
        self.fixed = self.node.create_publisher(TFMessage, "/tf_static", KEPT)
        self.range = self.node.create_publisher(Range, "/range", 100)
        self.poses, self.markers, self.states = [], [], []
        self.node.create_subscription(PoseWithCovarianceStamped, "/tanteo/pose", self.poses.append, KEPT)
        self.node.create_subscription(MarkerArray, "/tanteo/hypotheses", self.markers.append, KEPT)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self.states.append, 10)

    def now(self) -> int:
        return self.node.get_clock().now().nanoseconds

    def until(self, done, seconds: float = WAIT) -> bool:
        end = time.monotonic() + seconds
        while not done() and time.monotonic() < end:
            rclpy.spin_once(self.node, timeout_sec=0.005)
        return done()

    def rest(self, T: np.ndarray) -> None:
        self.tf.publish(filled("tf2_msgs/msg/TFMessage", io.documents.transform(T, "base", "hand", self.now())))
        self.until(lambda: False, 0.02)

    def sense(self, T: np.ndarray, distance: float) -> None:
        self.rest(T)
        header = io.documents.ros_header(self.now(), "sensor")
        fields = {"header": header, "range": distance, "min_range": 0.01, "max_range": 0.5}
        self.range.publish(filled("sensor_msgs/msg/Range", fields))
        self.until(lambda: False, 0.02)
        self.rest(T)

    def reply(self, service: str) -> dict:
        client = self.node.create_client(Trigger, service)
        client.wait_for_service(WAIT)
        future = client.call_async(Trigger.Request())
        rclpy.spin_until_future_complete(self.node, future, timeout_sec=WAIT)
        return {"success": future.result().success, "message": future.result().message}


def main(plan: dict) -> dict:
    rclpy.init()
    talker = Talker()
    static = io.documents.transform(np.array(plan["static"]), "hand", "sensor", 0)
    talker.fixed.publish(filled("tf2_msgs/msg/TFMessage", static))
    heard = talker.until(lambda: talker.range.get_subscription_count() and talker.tf.get_subscription_count())
    reset = talker.reply("/tanteo/reset")
    for T, distance in plan["steps"]:
        talker.sense(np.array(T), distance)
    count = len(plan["steps"])
    enough = talker.until(lambda: bool(talker.states) and f"'{count}'" in str(talker.states[-1]), 10.0)
    talker.until(lambda: False, 0.2)
    pose = talker.poses[-1] if talker.poses else None
    out = {
        "heard": heard, "reset": reset, "enough": enough, "next": talker.reply("/tanteo/next"),
        "state": str(talker.states[-1]), "markers": len(talker.markers[-1].markers), "poses": len(talker.poses),
    }  # fmt: skip
    if pose is not None:
        p, q = pose.pose.pose.position, pose.pose.pose.orientation
        out |= {"frame": pose.header.frame_id, "pose": [p.x, p.y, p.z, q.x, q.y, q.z, q.w]}
        out["covariance"] = pose.pose.covariance.tolist()
    talker.node.destroy_node()
    rclpy.shutdown()
    return out


if __name__ == "__main__":
    print(json.dumps(main(json.loads(Path(sys.argv[1]).read_text()))))
