"""What a shell is offered for the value of an option."""

from __future__ import annotations


def sensor_names(incomplete: str) -> list[str]:
    """Presets of sensors that begin so."""
    from tanteo.sensors import sensor_presets

    return [name for name in sensor_presets() if name.startswith(incomplete)]


def robot_names(incomplete: str) -> list[str]:
    """Presets of robots that begin so."""
    from tanteo.sensors import robot_presets

    return [name for name in robot_presets() if name.startswith(incomplete)]


def preset_names(incomplete: str) -> list[str]:
    """Presets of sensors and of robots that begin so."""
    return [*sensor_names(incomplete), *robot_names(incomplete)]


def policy_names(incomplete: str) -> list[str]:
    """Policies that begin so."""
    from tanteo.active import POLICIES

    return [name for name in POLICIES if name.startswith(incomplete)]
