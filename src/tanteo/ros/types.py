"""Conversion of plain dictionaries into rclpy messages; missing fields keep their defaults."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib import import_module
from typing import Any

from tanteo.errors import MissingExtraError, install_command

NEEDS_ROS = (
    "tanteo ros: expected ROS 2 for Python (rclpy), got none. Source your ROS 2 (/opt/ros/DISTRO/setup.bash) and start "
    f"tanteo with its Python, or install wheels of it: {install_command('ros')}."
)
"""Message to the user if rclpy is missing."""


def type_named(kind: str) -> Any:
    """Return the class of a message type.

    Args:
        kind: name of the type, such as ``sensor_msgs/msg/Range``.

    Raises:
        MissingExtraError: The package of the type is not installed.
    """
    package, _, name = kind.partition("/msg/")
    try:
        return getattr(import_module(f"{package}.msg"), name)
    except ImportError:
        raise MissingExtraError(f"{kind}: expected the ROS package {package}, got none. Install it.") from None


def filled(kind: str, fields: Mapping[str, Any]) -> Any:
    """Return a message with the given fields.

    Args:
        kind: name of the type, such as ``geometry_msgs/msg/Pose``.
        fields: values by field name; nested messages are dictionaries.
    """
    message = type_named(kind)()
    types = message.get_fields_and_field_types()
    for name, value in fields.items():
        setattr(message, name, _value(types[name], value))
    return message


def _value(kind: str, value: Any) -> Any:
    many = re.fullmatch(r"sequence<(.+?)(?:, \d+)?>|(.+?)\[\d+\]", kind)
    if many is not None and "/" in kind:
        return [_value(many[1] or many[2], one) for one in value]
    if "/" in kind:
        return filled(kind.replace("/", "/msg/", 1), value)
    return bytes([value]) if kind == "octet" else value
