"""How near the hand came to anything: for those who judge a run, never for those who steer it."""

from __future__ import annotations

import numpy as np

from tanteo.hand import Body
from tanteo.simulator.scene import Scene
from tanteo.typing import FloatArray, IntArray, Transforms


def clearances(scene: Scene, body: Body, Ts_world_hand: Transforms) -> FloatArray:
    """Least distance of the hand's body from every solid of the scene, zero or less at contact.

    A sphere whose centre is in the material has a clearance below minus its radius; a path that is sampled finer
    than the smallest radius cannot get there without a contact before.

    Args:
        scene: What stands there.
        body: The hand's spheres.
        Ts_world_hand: True poses of the hand ``(*batch, 4, 4)``.

    Returns:
        ``(*batch,)`` [m].
    """
    centres = body.placed(np.asarray(Ts_world_hand))
    return np.asarray((scene.surface.closest(centres).distances - body.radii).min(axis=-1))


def nearest_solids(scene: Scene, points: FloatArray) -> IntArray:
    """Number of the solid nearest to each point ``(*batch, 3)``."""
    return np.asarray(scene.owner[scene.surface.closest(points).triangles])
