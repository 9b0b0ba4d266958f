"""A manager of a node with a lifecycle, on its network: ``manager.py PLAN.json``.

It leads the node through its states, sends readings in each, and prints what it noticed as one JSON document.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import rclpy
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from talker import WAIT, Talker

from tanteo import io
from tanteo.ros import filled


class Manager(Talker):
    def call(self, kind, name, request):
        client = self.node.create_client(kind, f"/tanteo/{name}")
        assert client.wait_for_service(WAIT), name
        future = client.call_async(request)
        rclpy.spin_until_future_complete(self.node, future, timeout_sec=2 * WAIT)
        return future.result()

    def change(self, label: str) -> list:
        request = ChangeState.Request()
        request.transition.label = label
        success = self.call(ChangeState, "change_state", request).success
        if label == "shutdown":
            return [success, "finalized"]
        return [success, self.call(GetState, "get_state", GetState.Request()).current_state.label]

    def set(self, name: str, value) -> bool:
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        return self.call(SetParameters, "set_parameters", request).results[0].successful

    def is_heard(self, seconds: float = WAIT) -> bool:
        both = (self.range.get_subscription_count, self.tf.get_subscription_count)
        return self.until(lambda: all(count() for count in both), seconds)

    def offers(self, name: str) -> bool:
        return name in dict(self.node.get_service_names_and_types())

    def used(self) -> int:
        """Return the number of readings of the latest diagnostics."""
        values = {one.key: one.value for one in self.states[-1].status[0].values}
        return int(values["readings"])


def main(plan: dict) -> dict:
    rclpy.init()
    own = Manager()
    static = io.documents.transform(np.array(plan["static"]), "hand", "sensor", 0)
    own.fixed.publish(filled("tf2_msgs/msg/TFMessage", static))
    out = {"early": own.change("activate"), "nowhere": own.set("parts", ["/nowhere"])}
    out["refused"] = own.change("configure")
    out["parts"], out["sd"] = own.set("parts", [plan["parts"]]), own.set("sd", 1e-4)
    out["configured"] = own.change("configure")
    out["heard_inactive"] = own.is_heard(1.5)
    out["next_inactive"] = own.offers("/tanteo/next")
    out["activated"] = own.change("activate")
    out["heard_active"] = own.is_heard()
    own.until(lambda: own.offers("/tanteo/next"))
    out["next_active"] = own.offers("/tanteo/next")
    for T, distance in plan["steps"]:
        own.sense(np.array(T), distance)
    out["enough"] = own.until(lambda: bool(own.states) and own.used() >= len(plan["steps"]) // 2, 15.0)
    out["answered"] = own.until(lambda: bool(own.markers))
    out["frame"] = own.markers[-1].markers[-1].header.frame_id if own.markers else ""
    own.until(lambda: False, 2.5)  # messages on the way
    out["used"] = own.used()
    out["deactivated"] = own.change("deactivate")
    out["silent"] = own.until(lambda: not own.range.get_subscription_count(), 5.0)
    states = len(own.states)
    own.until(lambda: False, 2.5)
    out["diagnostics_inactive"] = len(own.states) - states
    out["again"] = own.change("activate")
    own.until(lambda: len(own.states) > states)
    out["kept"] = own.used()
    out["off"] = own.change("deactivate")
    out["cleaned"] = own.change("cleanup")
    out["reconfigured"] = own.change("configure")
    states = len(own.states)
    out["third"] = own.change("activate")
    own.until(lambda: len(own.states) > states)
    out["fresh"] = own.used()
    out["shutdown"] = own.change("shutdown")
    own.node.destroy_node()
    rclpy.shutdown()
    return out


if __name__ == "__main__":
    print(json.dumps(main(json.loads(Path(sys.argv[1]).read_text()))))
