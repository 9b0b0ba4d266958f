"""Check a rig for implausible positions, directions and duplicate sensors."""

from __future__ import annotations

import numpy as np

from tanteo.errors import InputError, UnitError
from tanteo.sensors import Rig, RigSensor

_FARTHEST = 2.0
"""Largest accepted distance of a sensor from the hand's origin [m]; larger values indicate a wrong unit."""

_NEAREST = 0.5e-3
"""Distance from the hand's origin [m] below which a sensor's position may have been written in metres."""

_WIDEST = np.pi / 3
"""Largest accepted half angle of a beam [rad]; larger values indicate a wrong unit."""

_INTO = 0.5
"""Fraction of the sensor's distance from the hand's origin within which a beam counts as running into the hand."""

_SAME = 1e-6


def check_beam(sensor: RigSensor, place: str) -> None:
    """Check that a beam starts near the hand and does not run into it.

    Args:
        sensor: sensor to check.
        place: file and sensor for messages.

    Raises:
        UnitError: the distance or the beam's width indicates a wrong unit.
        InputError: the beam passes through the middle of the hand.
    """
    origin, beam = sensor.T_hand_sensor[:3, 3], sensor.T_hand_sensor[:3, 2]
    away = float(np.linalg.norm(origin))
    if away > _FARTHEST:
        raise UnitError(
            f"{place}, position: expected within {_FARTHEST:g} m of the hand's origin, got {away:g} m. Check the unit "
            "in the key."
        )
    if sensor.beam_half_angle > _WIDEST:
        got = np.degrees(sensor.beam_half_angle)
        raise UnitError(
            f"{place}, beam_half_angle: expected 60 degrees or less, got {got:g}. Check the unit in the key."
        )
    ahead = max(-float(origin @ beam), 0.0)
    nearest = float(np.linalg.norm(origin + ahead * beam))
    if nearest < _INTO * away and ahead < _reach(sensor):
        raise InputError(
            f"{place}, direction: expected the beam to lead away from the hand, got one that passes its origin within "
            f"{1e3 * nearest:.3g} mm. Turn it around, or move the hand's origin out of its way."
        )


def suspect_metres(rig: Rig) -> str:
    """Return a question if a sensor is so close to the hand's origin that its unit is doubtful; otherwise empty.

    Args:
        rig: rig to check.
    """
    for sensor in rig.sensors:
        away = float(np.linalg.norm(sensor.T_hand_sensor[:3, 3]))
        if 0 < away < _NEAREST:
            return (
                f"{rig.source}, sensors.{sensor.name}: it sits {1e3 * away:.2g} mm from the origin of the hand's "
                "frame. Is its position in metres? Then call it position_m."
            )
    return ""


def _reach(sensor: RigSensor) -> float:
    """Return the largest range of a sensor [m]; infinite if unknown."""
    return float(np.nan_to_num(sensor.max_range, nan=np.inf))


def check_duplicates(rig: Rig, place: str) -> None:
    """Check that no two sensors have the same beam.

    Args:
        rig: rig to check.
        place: file name for messages.

    Raises:
        InputError: two sensors have the same beam; the message names them.
    """
    for i, one in enumerate(rig.sensors):
        for other in rig.sensors[:i]:
            difference = one.T_hand_sensor[:3, 2:] - other.T_hand_sensor[:3, 2:]
            if np.abs(difference).max() < _SAME:
                raise InputError(
                    f"{place}: expected every sensor at a place or with a direction of its own, got '{other.name}' and "
                    f"'{one.name}' with the same. Correct one."
                )
