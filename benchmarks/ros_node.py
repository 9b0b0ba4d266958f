"""How fast the node is: messages a second that become readings, and the time from a stamp to an answer.

    python benchmarks/ros_node.py            # without ROS: frames at 100 Hz and ranges at 50 Hz
    .venv/ros/bin/python benchmarks/ros_node.py --loopback   # with it (make ros): from one process to another and back

Prints the table of docs/ros.md.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from tanteo import io
from tanteo.geometry import SE3, SO3
from tanteo.ros import Intake, Patience

ROOT = Path(__file__).parents[1]
SECONDS, FRAMES, RANGES = 20.0, 100.0, 50.0


def objects(fields):
    if isinstance(fields, dict):
        return SimpleNamespace(**{name: objects(value) for name, value in fields.items()})
    return [objects(one) for one in fields] if isinstance(fields, list) else fields


def stream(rate):
    """Topic, time and message, in their order: a chain of two moving frames, a sensor on it."""
    out = [("/tf_static", 0.0, objects(io.documents.transform(np.eye(4), "hand", "sensor", 0)))]
    for t in np.arange(0, SECONDS, 1 / FRAMES):
        for parent, child in (("base", "arm"), ("arm", "hand")):
            T = SE3.from_parts(SO3.axis_rotation(2, 0.1 * t), np.array([0.1, 0.01 * t, 0.2]))
            out.append(("/tf", t, objects(io.documents.transform(T, parent, child, round(1e9 * t)))))
    for t in np.arange(0.005, SECONDS, 1 / rate):
        fields = {
            "header": io.documents.ros_header(round(1e9 * t), "sensor"),
            "range": 0.2,
            "min_range": 0.0,
            "max_range": 1.0,
        }
        out.append(("/range", t, objects(fields)))
    return sorted(out, key=lambda one: one[1])


def intake(rate):
    """Convert messages to readings, every 50 ms of the stream."""
    messages = stream(rate)
    taken = Intake(io.RosOptions(), io.readings.Stated(), Patience(start=0.0))
    for topic, kind in (
        ("/tf", io.documents.TF[0]),
        ("/tf_static", io.documents.TF[0]),
        ("/range", io.documents.RANGE),
    ):
        taken.register(topic, kind)
    begun, last, worst = time.process_time(), 0.0, 0.0
    for topic, t, message in messages:
        taken.take(topic, t, message)
        if t - last >= 0.05:
            last, before = t, time.perf_counter()
            taken.ready(t)
            worst = max(worst, time.perf_counter() - before)
    spent = time.process_time() - begun
    print(
        f"{len(messages)} messages, {taken.taken} readings: {len(messages) / spent:.0f} messages a second on one core,"
    )
    print(f"{spent:.2f} s, {spent / SECONDS:.0%} of the run; at most {1e3 * worst:.0f} ms from a call to its readings")


def loopback():
    """Touches of the example at 10 Hz from this process; the node answers in another."""
    import rclpy
    from diagnostic_msgs.msg import DiagnosticArray
    from geometry_msgs.msg import PointStamped

    from tanteo.ros import filled

    part = ROOT / "examples/parts/bracket_left.step"
    readings = io.read_readings(ROOT / "examples/readings/bracket_left.csv")
    near = "421,-131,35mm 0,0,34deg +- 3mm 3deg"
    for name, more in (("with --pose-prior", ["--pose-prior", near]), ("anywhere", [])):
        words = ["-m", "tanteo", "ros", "--parts", str(part), "--sd", "0.1mm", *more]
        with subprocess.Popen([sys.executable, *words], stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL) as node:
            rclpy.init()
            me, states = rclpy.create_node("bench"), []
            me.create_subscription(DiagnosticArray, "/diagnostics", states.append, 10)
            touch = me.create_publisher(PointStamped, "/touch", 100)
            while touch.get_subscription_count() == 0:
                rclpy.spin_once(me, timeout_sec=0.1)
            for point in readings.points:
                stamp = me.get_clock().now().nanoseconds
                header, at = io.documents.ros_header(stamp, "base"), dict(zip("xyz", map(float, point), strict=True))
                touch.publish(filled(io.documents.POINT, {"header": header, "point": at}))
                end = time.monotonic() + 0.11
                while time.monotonic() < end:
                    rclpy.spin_once(me, timeout_sec=0.01)
            end = time.monotonic() + 5
            while time.monotonic() < end:
                rclpy.spin_once(me, timeout_sec=0.1)
            values = {pair.key: pair.value for pair in states[-1].status[0].values}
            print(f"{name}: {values['readings']} readings at 10 Hz, {states[-1].status[0].message.split(':')[0]};")
            print(f"  from stamp to answer {values['stamp to answer, median [ms]']} ms (median of the answers)")
            me.destroy_node()
            rclpy.shutdown()
            node.terminate()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--loopback", action="store_true", help="from one process to another, with rclpy")
    parser.add_argument("--ranges", type=float, default=RANGES, help="ranges a second [Hz], over 20 s")
    arguments = parser.parse_args()
    if arguments.loopback:
        os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        loopback()
    else:
        intake(arguments.ranges)
