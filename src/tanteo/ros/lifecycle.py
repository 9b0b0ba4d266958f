"""Lifecycle of the ROS node: unconfigured, inactive, active, finalized (https://design.ros2.org/articles/node_lifecycle.html)."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from tanteo.errors import TanteoError
from tanteo.posterior import Answer
from tanteo.ros.network import Settings, spin
from tanteo.ros.node import RosNode

_INTERVAL = 0.05
"""Largest time until a new topic or a failure is noticed [s]."""


@dataclass(slots=True, eq=False)
class ManagedNode:
    """Node with a lifecycle, which another node controls.

    ``configure`` reads parameters and parts, ``activate`` subscribes and offers the services, ``deactivate`` ends both
    and keeps the readings, ``cleanup`` discards them, ``shutdown`` ends the process. A transition that fails is logged
    with a sentence, and the node stays in its state.

    Attributes:
        node: lifecycle node of rclpy.
        settings: settings of the node, with the declared parameters.
        build: function that creates the server from the parameters that have changed since.
        ended: event that ends :meth:`run`.
        server: server of the configured node; None while it is unconfigured.
        answer: latest answer of a server that was discarded.
    """

    node: Any
    settings: Settings
    build: Callable[[Mapping[str, Any]], RosNode]
    ended: threading.Event
    server: RosNode | None = None
    answer: Answer | None = None
    _failed: TanteoError | None = None
    _shut: bool = False

    def run(self) -> Answer | None:
        """Carry out transitions and process messages until the node is shut down, and return the last answer."""
        from rclpy.lifecycle import ManagedEntity
        from rclpy.lifecycle.node import TransitionCallbackReturn as Outcome

        def carried_out(action: Callable[[], None], failed: Any, state: Any) -> Any:
            try:
                action()
            except TanteoError as error:
                self.node.get_logger().error(str(error))
                return failed
            return Outcome.SUCCESS

        entity = ManagedEntity()
        entity.on_configure = partial(carried_out, self._configure, Outcome.FAILURE)
        entity.on_activate = partial(carried_out, self._activate, Outcome.FAILURE)
        entity.on_deactivate = partial(carried_out, self._deactivate, Outcome.ERROR)
        entity.on_cleanup = entity.on_error = partial(carried_out, self._discard, Outcome.FAILURE)
        entity.on_shutdown = partial(carried_out, self._shut_down, Outcome.FAILURE)
        self.node.add_managed_entity(entity)
        try:
            spin(self.node, self.ended, self._step, _INTERVAL)
        finally:
            if not self._shut:
                self.node.trigger_shutdown()
        return self.answer

    def _step(self) -> None:
        """Let the active server subscribe; a server that failed is deactivated with an error, and discarded."""
        if self.server is None or not self.server.active:
            return
        try:
            self.server.step()
        except TanteoError as error:
            self._failed = error
            self.node.trigger_deactivate()

    def _configure(self) -> None:
        declared = self.settings.parameters
        values = {name: self.node.get_parameter(name).value for name in declared}
        changed = {name: value for name, value in values.items() if value is not None and value != declared[name][0]}
        self.server = self.build(changed)
        self.server.offer()

    def _activate(self) -> None:
        if self.server is not None:
            self.server.start()

    def _deactivate(self) -> None:
        failed, self._failed = self._failed, None
        if self.server is not None:
            self.server.stop()
        if failed is not None:
            raise failed

    def _discard(self) -> None:
        """Discard the server with its readings."""
        server, self.server = self.server, None
        if server is not None:
            server.stop()
            server.withdraw()
            self.answer = server.answer or self.answer

    def _shut_down(self) -> None:
        self._shut = True
        self._discard()
        self.ended.set()
