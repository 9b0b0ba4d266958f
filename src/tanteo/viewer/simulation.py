"""A bare laser in the simulator: exact rays on what is there, and noise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tanteo.active import Probe
from tanteo.hand import Workspace
from tanteo.sensors import NoiseLaw, Readings
from tanteo.session import Action, Sensing
from tanteo.shapes import Surface

NOISE = 3e-4
"""Of a reading [m]."""

_STANDOFF, _REACH, _CONE = 0.10, 0.30, float(np.radians(80.0))
_SHORT = 5e-3
"""A beam that ends on furniture was free up to so much before it [m]."""


def laser(workspace: Workspace) -> tuple[Probe, Sensing]:
    """A thin beam of 0.3 mm from 100 mm, from above, and how its readings become measurements."""
    probe = Probe(
        "laser", NoiseLaw.of(NOISE), max_range=_REACH, standoff=_STANDOFF, clearance=0.01,
        approach=np.array([0.0, 0.0, -1.0]), cone=_CONE, workspace=workspace,
    )  # fmt: skip
    return probe, Sensing(sd=NOISE)


def simulated(truth: Surface, furniture: Surface | None, seed: int) -> Callable[[Action], Readings]:
    """What the laser reads: of the part, or nothing as far as what is known to stand there.

    The k-th reading has the k-th draw of the noise, whoever chose it.

    Args:
        truth: what lies there, in the world.
        furniture: what is known to stand there.
        seed: of the noise.
    """
    rng = np.random.default_rng((1991, seed))

    def read(action: Action) -> Readings:
        noise = NOISE * rng.normal()
        start, along = action.origin[None], action.direction[None]
        met = float(truth.cast(start, along).distances[0])
        ends = np.inf if furniture is None else float(furniture.cast(start, along).distances[0])
        if met <= min(ends, action.max_range):
            return action.read(max(met + noise, 1e-6))
        free = max(min(ends - _SHORT, action.max_range), 1e-3)
        return Readings.from_columns(
            start, ids=[f"a{action.number}"], directions=along, is_free=np.array([True]), max_ranges=np.array([free])
        )

    return read
