"""Creation and shutdown of the rclpy node."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from tanteo.errors import InputError, MissingExtraError
from tanteo.ros.types import NEEDS_ROS


@dataclass(slots=True, eq=False)
class Settings:
    """Settings of the ROS node.

    Attributes:
        name: name of the node.
        simulated: whether time is taken from ``/clock``.
        max_measurements: largest number of used readings; later ones are dropped until a reset.
        once: whether the node ends when a part is recognized.
        part_frame: frame of the part that is sent to ``/tf``; empty to send none.
        ros_args: arguments of ROS: namespace, remappings, log level.
        parameters: parameters of the node with their descriptions: values of the options in SI units.
        managed: whether the node has a lifecycle; only then its parameters can be set.
    """

    name: str = "tanteo"
    simulated: bool = False
    max_measurements: int = 300
    once: bool = False
    part_frame: str = ""
    ros_args: tuple[str, ...] = ()
    parameters: Mapping[str, tuple[Any, str]] = field(default_factory=dict)
    managed: bool = False


@contextmanager
def opened(settings: Settings) -> Iterator[Any]:
    """Create an rclpy node and shut it down at the end of the context.

    Args:
        settings: settings of the node.

    Raises:
        MissingExtraError: rclpy or a message package is missing.
        InputError: rclpy cannot create the node.
    """
    try:
        import rclpy
        from rcl_interfaces.msg import ParameterDescriptor
        from rclpy.lifecycle import LifecycleNode
        from rclpy.parameter import Parameter
        from rclpy.signals import SignalHandlerOptions
    except ImportError:
        raise MissingExtraError(NEEDS_ROS) from None
    sim = Parameter("use_sim_time", Parameter.Type.BOOL, settings.simulated)
    try:
        rclpy.init(args=["--ros-args", *settings.ros_args], signal_handler_options=SignalHandlerOptions.NO)
        made = LifecycleNode if settings.managed else rclpy.create_node
        node = made(settings.name, parameter_overrides=[sim])
        rights = {"read_only": not settings.managed, "dynamic_typing": settings.managed}
        for name, (value, words) in settings.parameters.items():
            node.declare_parameter(name, value, ParameterDescriptor(description=words, **rights))
    except RuntimeError as error:  # base class of all errors of rclpy
        rclpy.try_shutdown()
        raise InputError(
            f"ROS 2: expected a node on its network, got: {str(error).splitlines()[0]}. Check RMW_IMPLEMENTATION, "
            "ROS_DOMAIN_ID, ROS_LOG_DIR and --ros-args."
        ) from None
    try:
        yield node
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def spin(node: Any, ended: threading.Event, step: Callable[[], None], interval: float) -> None:
    """Run the callbacks of a node until an event is set.

    Args:
        node: rclpy node.
        ended: event that ends the callbacks.
        step: function that is called between callbacks.
        interval: longest time between two of its calls [s].
    """
    from rclpy.executors import MultiThreadedExecutor

    executor = MultiThreadedExecutor(num_threads=2)
    executor.add_node(node)
    try:
        while not ended.is_set():
            step()
            executor.spin_once(timeout_sec=interval)
    finally:
        ended.set()
        executor.shutdown()
