"""Plates with holes and bosses for tests: made with the kernel, and what is sensed of them."""

from __future__ import annotations

import numpy as np
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCone, BRepPrimAPI_MakeCylinder
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer

from tanteo import Readings, read_part
from tanteo.geometry import SE3

SD = 2e-5
HALF, THICK = (50, 35), 12
HOLES = ((-38, -22, 4), (35, -24, 4), (-33, 25, 4), (10, 20, 3))
HUB = (5, -5, 12)


def pin(x, y, low, high, radius):
    return BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(x, y, low), gp_Dir(0, 0, 1)), radius, high - low).Shape()


def tip(x, y, low, high, radius):
    """Return the cone that a drill leaves; it widens upwards."""
    return BRepPrimAPI_MakeCone(gp_Ax2(gp_Pnt(x, y, low), gp_Dir(0, 0, 1)), 0, radius, high - low).Shape()


def drilled(holes=HOLES, hub=HUB, more=()):
    """Return a plate from z = 0 to 12 mm with through holes and a hub of 30 mm; more shapes are subtracted."""
    body = BRepPrimAPI_MakeBox(gp_Pnt(-HALF[0], -HALF[1], 0), gp_Pnt(*HALF, THICK)).Shape()
    if hub:
        body = BRepAlgoAPI_Fuse(body, pin(*hub[:2], 0, 30, hub[2])).Shape()
    for x, y, radius in holes:
        body = BRepAlgoAPI_Cut(body, pin(x, y, -1, THICK + 1, radius)).Shape()
    for shape in more:
        body = BRepAlgoAPI_Cut(body, shape).Shape()
    return body


def as_part(shape, path):
    writer = STEPControl_Writer()
    writer.Transfer(shape, STEPControl_AsIs)
    writer.Write(str(path))
    return read_part(path)


T = SE3.exp(np.array([0.3, 0.2, 0.05, 0.4, -0.3, 1.2]))
"""Where the plate is."""

TOP = np.array([[-45, 0, 12], [45, 5, 12], [25, 30, 12], [-20, -30, 12], [45, -30, 12]]) * 1e-3


def sensed(centres, *, top=5, directed=True, seed=0, **columns):
    """Centres ``(n, 3)`` in the plate's frame [m], and points of its upper face, of one label."""
    rng, n, m = np.random.default_rng(seed), len(centres), top
    p = SE3.apply(T, np.concatenate([np.reshape(centres, (-1, 3)), TOP[:m]]))
    ways = np.full((n + m, 3), np.nan)
    if directed:
        ways[n:] = -T[:3, 2]
    return Readings.from_columns(
        points=p + SD * rng.normal(size=p.shape), sds=np.full(n + m, SD), directions=ways,
        kinds=["centre"] * n + ["plane" if m > 2 else "point"] * m, features=[""] * n + ["top" if m > 2 else ""] * m,
        **columns,
    )  # fmt: skip


def heights(holes, rng=None):
    """Centres of holes at any height ``(n, 3)`` [m]."""
    z = 6 * np.ones(len(holes)) if rng is None else rng.uniform(0, THICK, len(holes))
    return 1e-3 * np.column_stack([np.array(holes)[:, :2], z])
