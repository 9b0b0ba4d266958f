"""Acquisition functions by the kind of feature."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from tanteo.hand.acquisition.circle import sense_circle
from tanteo.hand.acquisition.cylinder import sense_cylinder
from tanteo.hand.acquisition.edge import sense_edge
from tanteo.hand.acquisition.plane import sense_plane
from tanteo.hand.acquisition.run import Acquired
from tanteo.hand.acquisition.vertex import sense_vertex

SENSE: Mapping[str, Callable[..., Acquired]] = MappingProxyType({
    "plane": sense_plane, "edge": sense_edge, "vertex": sense_vertex, "circle": sense_circle,
    "cylinder": sense_cylinder,
})  # fmt: skip
"""Functions that acquire a feature from a robot and a guess, by kind."""
