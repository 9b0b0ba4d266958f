"""Creation and shutdown of the rclpy node."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
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
        parameters: read-only parameters of the node with their descriptions: values of the options in SI units.
    """

    name: str = "tanteo"
    simulated: bool = False
    max_measurements: int = 300
    once: bool = False
    part_frame: str = ""
    ros_args: tuple[str, ...] = ()
    parameters: Mapping[str, tuple[Any, str]] = field(default_factory=dict)


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
        from rclpy.parameter import Parameter
        from rclpy.signals import SignalHandlerOptions
    except ImportError:
        raise MissingExtraError(NEEDS_ROS) from None
    sim = Parameter("use_sim_time", Parameter.Type.BOOL, settings.simulated)
    try:
        rclpy.init(args=["--ros-args", *settings.ros_args], signal_handler_options=SignalHandlerOptions.NO)
        node = rclpy.create_node(settings.name, parameter_overrides=[sim])
        for name, (value, words) in settings.parameters.items():
            node.declare_parameter(name, value, ParameterDescriptor(description=words, read_only=True))
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
