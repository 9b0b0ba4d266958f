"""Find the limit of the probe that prevents every candidate reading."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from tanteo.planning.candidates import propose
from tanteo.planning.probe import Probe
from tanteo.planning.state import SensingState
from tanteo.words.findings import NoPlaceReached

_TRIED = 0.5, 0.25, 0.1, 2.0, 4.0
"""Stand-offs and smaller clearances to try, as multiples of the present one."""

_BEYOND = 1e-3
"""Length by which a tried stand-off or clearance exceeds the radius of the ball [m]."""


def no_place(
    state: SensingState, probe: Probe, seed: int, parts: tuple[str, ...] = (), *, anywhere: bool = False
) -> NoPlaceReached:
    """Return the finding that the probe reaches no place, with a limit that alone prevents it if there is one.

    Lengths that the user chooses freely come first, then limits that stand for real obstacles.

    Args:
        state: posterior, or prior poses.
        probe: sensor model without a candidate.
        seed: seed of the random surface points.
        parts: names of the parts of the message; empty for all parts of a session.
        anywhere: whether approaches must be clear of sampled poses of each mode, as those of a session.
    """
    for name, least, most in (("standoff", probe.min_range, probe.max_range), ("clearance", 0.0, probe.clearance)):
        own = getattr(probe, name)
        for other in (float(f"{share * own:.2g}") for share in _TRIED):
            changed: dict[str, Any] = {name: other}
            allowed = max(least, probe.radius + _BEYOND) <= other < most
            if allowed and _reaches(state, replace(probe, **changed), seed, anywhere):
                return NoPlaceReached(parts, name, own, other)
    free: dict[str, dict[str, Any]] = {
        "workspace": {"workspace": type(probe.workspace).everywhere()},
        "obstacles": {"obstacles": ()},
        "tool": {"body": None},
        "directions": {"approach": None, "cone": np.pi, "tilt": np.pi, "axis_parallel": False},
    }
    for name, values in free.items():
        if _reaches(state, replace(probe, **values), seed, anywhere):
            return NoPlaceReached(parts, name)
    return NoPlaceReached(parts)


def _reaches(state: SensingState, probe: Probe, seed: int, anywhere: bool) -> bool:
    """Return whether a probe has a candidate."""
    return bool(len(propose(state, probe, seed=seed, anywhere=anywhere)))
