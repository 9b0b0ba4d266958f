"""The node on the network of ROS: how it appears there, until it leaves."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from tanteo.errors import InputError, MissingExtraError
from tanteo.ros.types import NEEDS_ROS


@dataclass(slots=True, eq=False)
class Settings:
    """How the node appears.

    Attributes:
        name: of the node.
        simulated: the time is that of ``/clock``.
        max_measurements: readings that are told; later ones are left out until it is reset.
        once: end when the answer is decided.
    """

    name: str = "tanteo"
    simulated: bool = False
    max_measurements: int = 300
    once: bool = False


@contextmanager
def opened(settings: Settings) -> Iterator[Any]:
    """A node of rclpy, which leaves the network at the end.

    Raises:
        MissingExtraError: rclpy or a message package is missing.
    """
    try:
        import rclpy
        from rclpy.parameter import Parameter
        from rclpy.signals import SignalHandlerOptions
    except ImportError:
        raise MissingExtraError(NEEDS_ROS) from None
    sim = Parameter("use_sim_time", Parameter.Type.BOOL, settings.simulated)
    try:
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        node = rclpy.create_node(settings.name, parameter_overrides=[sim])
    except RuntimeError as error:  # of rclpy, all of them
        rclpy.try_shutdown()
        raise InputError(
            f"ROS 2: expected a node on its network, got: {str(error).splitlines()[0]}. Look at RMW_IMPLEMENTATION, "
            "ROS_DOMAIN_ID and ROS_LOG_DIR."
        ) from None
    try:
        yield node
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
