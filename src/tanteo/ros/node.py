"""ROS node that receives messages and publishes answers; the other packages do not need rclpy."""

from __future__ import annotations

import json
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tanteo import io
from tanteo.errors import InputError, MissingExtraError, TanteoError
from tanteo.parts import Part
from tanteo.planning import Done
from tanteo.posterior import Answer
from tanteo.ros.estimators import Estimator
from tanteo.ros.intake import Intake
from tanteo.ros.messages import next_document, next_pose, part_transform, state_message
from tanteo.ros.network import Settings, spin
from tanteo.ros.types import filled, type_named
from tanteo.sensors import Readings
from tanteo.words.findings import Stated

_DISCOVERY, _PROCESSING, _DIAGNOSTICS = 0.5, 0.05, 1.0
"""Intervals of topic discovery, of processing of readings, and of diagnostics [s]."""
_SOURCES = io.documents.RANGE, io.documents.POINT
"""Types of messages that the node takes readings from; scans are read from recordings."""
_TF = "tf2_msgs/msg/TFMessage"
_DEPTH = 1000
"""Depth of the subscription queues [messages]."""


@dataclass(slots=True, eq=False)
class RosNode:
    """ROS node that subscribes to readings, updates the estimate, and publishes answers.

    Attributes:
        node: rclpy node.
        intake: queue that converts messages into readings.
        estimator: estimator of the part and its pose.
        parts: candidate parts by name.
        settings: settings of the node.
        notify: callback for messages to the user.
        on_answer: callback for every answer.
        answer: latest answer; None before the first.
        ended: event that ends :meth:`run`.
        active: whether readings are received.
    """

    node: Any
    intake: Intake
    estimator: Estimator
    parts: dict[str, Part]
    settings: Settings
    notify: Callable[[str], None]
    on_answer: Callable[[Answer], None] = lambda answer: None
    answer: Answer | None = None
    ended: threading.Event = field(default_factory=threading.Event)
    active: bool = False
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _updating: threading.Lock = field(default_factory=threading.Lock)
    _switching: threading.Lock = field(default_factory=threading.Lock)
    _stopped: threading.Event = field(default_factory=threading.Event)
    _worker: threading.Thread | None = None
    _discovered: float = -np.inf
    _subscribed: dict[str, Any] = field(default_factory=dict)
    _services: list[Any] = field(default_factory=list)
    _out: dict[str, Any] = field(default_factory=dict)
    _delays: deque[float] = field(default_factory=lambda: deque(maxlen=200))
    _notified: int = 0
    _failed: BaseException | None = None

    def run(self) -> Answer | None:
        """Process messages until :attr:`ended` is set, and return the last answer.

        Raises:
            TanteoError: The messages lack information that must be stated in the options.
        """
        self.offer()
        self.start()
        try:
            spin(self.node, self.ended, self.step, _PROCESSING)
        finally:
            self.stop()
        return self.answer

    def offer(self) -> None:
        """Create the publishers of the node."""
        from rclpy.qos import DurabilityPolicy, QoSProfile

        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for topic, kind, profile in (
            ("~/pose", io.documents.POSE_COVARIANCE, kept), ("~/hypotheses", io.documents.MARKERS, kept),
            ("~/next_reading", io.documents.POSE, kept), ("/diagnostics", io.documents.DIAGNOSTICS, 10),
        ):  # fmt: skip
            self._out[topic] = self.node.create_publisher(type_named(kind), topic, profile), kind
        if self.settings.part_frame:
            self._out["/tf"] = self.node.create_publisher(type_named(_TF), "/tf", _DEPTH), _TF

    def withdraw(self) -> None:
        """Destroy the publishers of the node."""
        for publisher, _ in self._out.values():
            self.node.destroy_publisher(publisher)
        self._out.clear()

    def start(self) -> None:
        """Offer the services, and receive readings from the next :meth:`step` on.

        Raises:
            MissingExtraError: the package of the services is not installed.
        """
        from rclpy.callback_groups import MutuallyExclusiveCallbackGroup

        try:
            from std_srvs.srv import Trigger
        except ImportError:
            raise MissingExtraError("std_srvs/srv/Trigger: expected the ROS package std_srvs, got none.") from None
        group = MutuallyExclusiveCallbackGroup()
        for name, callback in (("~/next", self._next), ("~/reset", self._reset)):
            self._services.append(self.node.create_service(Trigger, name, callback, callback_group=group))
        self._stopped.clear()
        self._failed, self._discovered = None, -np.inf
        self._worker = threading.Thread(target=self._work, name="tanteo", daemon=True)
        self._worker.start()
        self.active = True

    def stop(self) -> None:
        """Receive no further readings and offer no services, after the answer in progress; the readings are kept."""
        with self._switching:
            self.active = False
            for subscription in self._subscribed.values():
                if subscription is not None:
                    self.node.destroy_subscription(subscription)
            self._subscribed.clear()
            for service in self._services:
                self.node.destroy_service(service)
            self._services.clear()
        self._stopped.set()
        if self._worker is not None:
            self._worker.join()
            self._worker = None

    def step(self) -> None:
        """Subscribe to new relevant topics; called between the callbacks of the node.

        Raises:
            TanteoError: The messages lack information that must be stated in the options.
        """
        if self._failed is not None:
            raise self._failed
        with self._switching:
            if not self.active or time.monotonic() - self._discovered < _DISCOVERY:
                return
            self._discovered = time.monotonic()
            own, topics = f"{self.node.get_fully_qualified_name()}/", self.node.get_topic_names_and_types()
            there = {topic: kinds[0] for topic, kinds in topics if not topic.startswith(own)}
            for topic, kind in io.documents.wanted_topics(there, self.intake.options, _SOURCES).items():
                if topic not in self._subscribed:
                    self._subscribed[topic] = None
                    self._subscribe(topic, kind)

    def _subscribe(self, topic: str, kind: str) -> None:
        from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

        try:
            message = type_named(kind)
        except MissingExtraError as error:
            self._note(f"{topic} cannot be read. {error}")
            return
        static = topic.endswith("tf_static")
        # a best-effort reader matches both kinds of publishers; latched messages need a reliable reader
        profile = QoSProfile(
            depth=_DEPTH,
            reliability=ReliabilityPolicy.RELIABLE if static else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if static else DurabilityPolicy.VOLATILE,
        )
        with self._lock:
            self.intake.register(topic, kind)
        self._subscribed[topic] = self.node.create_subscription(
            message, topic, lambda one, topic=topic: self._take(topic, one), profile
        )

    def _take(self, topic: str, message: Any) -> None:
        with self._lock:
            self.intake.take(topic, self._now(), message)

    def _now(self) -> float:
        return 1e-9 * float(self.node.get_clock().now().nanoseconds)

    def _note(self, words: str) -> None:
        with self._lock:
            self.intake.notify(words)

    def _work(self) -> None:
        """Process ready readings and publish results until the node stops."""
        reported = -np.inf
        try:
            while not self._stopped.wait(_PROCESSING):
                updated = self._update()
                self._notify_all()
                if updated or time.monotonic() - reported > _DIAGNOSTICS:
                    reported = time.monotonic()
                    self._diagnose()
        except BaseException as error:  # noqa: BLE001  raised again where the node runs
            self._failed = error

    def _update(self) -> bool:
        with self._lock:
            now = self._now()
            readings = self.intake.ready(now) if now > 0 else None  # 0: the simulated clock has not started
            stamp = self.intake.latest
        if readings is None:
            return False
        with self._updating:
            before = self.estimator.readings()
            remaining = self.settings.max_measurements - (0 if before is None else len(before))
            if len(readings) > remaining:
                self._note(
                    f"{self.settings.max_measurements} readings were used. Further ones are dropped until ~/reset."
                )
                self.intake.dropped["more than --max-measurements"] += len(readings) - max(remaining, 0)
                readings = readings.take(np.arange(max(remaining, 0)))
            answer = self._answer_to(readings)
        if answer is None:
            return False
        self.answer = answer
        self._publish(self.answer, round(1e9 * stamp))
        self._delays.append(self._now() - stamp)
        return True

    def _answer_to(self, readings: Readings) -> Answer | None:
        """Return the answer after the readings, without rejected ones; None if all are rejected."""
        if not len(readings):
            return None
        try:
            return self.estimator.tell(readings)
        except InputError as error:
            if len(readings) > 1:  # isolate the rejected reading
                answers = [self._answer_to(readings.take(np.array([k]))) for k in range(len(readings))]
                return next((answer for answer in reversed(answers) if answer is not None), None)
            self.intake.dropped["refused"] += 1
            if self.intake.dropped["refused"] == 1:
                self._note(f"A reading was dropped, and similar ones are only counted: {error}")
            return None

    def _publish(self, answer: Answer, stamp: int) -> None:
        world, readings = self.intake.world, self.estimator.readings()
        if answer.status == "recognized" and answer.best is not None:
            pose = io.documents.pose_message(answer.best.T_world_part, answer.best.covariance, stamp, world)
            self._send("~/pose", pose)
            if self.settings.part_frame:
                self._send("/tf", part_transform(pose, self.settings.part_frame))
        placed = [io.documents.Placed(self.parts[h.part], h.T_world_part, h.probability) for h in answer.hypotheses]
        points = None if readings is None else readings.points.values
        self._send("~/hypotheses", io.documents.marker_message(placed, points, stamp, world))
        self.on_answer(answer)
        if self.settings.once and answer.status == "recognized":
            self.ended.set()

    def _diagnose(self) -> None:
        with self._lock:
            dropped, taken = dict(self.intake.drop_counts()), self.intake.taken
        state = state_message(self.answer, taken, dropped, list(self._delays), self.node.get_clock().now().nanoseconds)
        self._send("/diagnostics", state)

    def _notify_all(self) -> None:
        with self._lock:
            fresh, self._notified = self.intake.notes[self._notified :], len(self.intake.notes)
        for note in fresh:
            self.notify(note)

    def _send(self, topic: str, fields: dict[str, Any]) -> None:
        publisher, kind = self._out[topic]
        publisher.publish(filled(kind, fields))

    def _next(self, request: Any, response: Any) -> Any:
        """Answer the service ``~/next`` with the next reading as JSON."""
        with self._updating:
            try:
                action = self.estimator.ask()
            except TanteoError as error:
                action = Done(False, (Stated(str(error)),))
        frame = self.intake.world or self.intake.options.world or ""
        document = next_document(action, frame)
        response.success = document["status"] == "ask"
        response.message = json.dumps(document)
        if response.success:
            stamp = self.node.get_clock().now().nanoseconds
            self._send("~/next_reading", next_pose(action, stamp, frame))
        return response

    def _reset(self, request: Any, response: Any) -> Any:
        """Answer the service ``~/reset`` by discarding all readings."""
        with self._updating:
            self.estimator.reset()
            self.answer = None
        response.success, response.message = True, "All readings were discarded."
        return response
