"""Random parts as mills and lathes make them: plates, angles and octagons with bosses, bores, slots and pockets."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))

from make_parts import bore, box, cut, fuse, mirrored, prism, write

from random_parts import random_part
from tanteo.parts import read_part


def machined(rng, more=0.0):
    """Return a solid of 60 to 140 mm with one to three features; ``more`` adds to the height of the first one."""
    x, y, z = rng.uniform(60, 140), rng.uniform(40, 90), rng.uniform(10, 45)
    body, more = _body(int(rng.integers(3)), x, y, z, more, rng)
    for _ in range(int(rng.integers(1, 4))):
        what = int(rng.integers(5))
        u, v = rng.uniform(0.3, 0.75) * x, rng.uniform(0.3, 0.7) * y
        r, h = rng.uniform(0.1, 0.25) * min(x, y), rng.uniform(8, 45)
        if what == 0:
            body = cut(body, bore(u, v, r))
        elif what == 1:
            body, more = fuse(body, bore(u, v, r, z / 2, z + h + more)), 0.0
        elif what == 2:
            body, more = fuse(body, box((u - r, v - 0.7 * r, z / 2), (x, v + r, z + h + more))), 0.0
        elif what == 3:
            body = cut(body, box((u - 0.4 * r, -1, z - 0.5 * z), (u + 0.5 * r, y + 1, 200)))
        else:
            body = cut(body, box((u - r, v - r, 0.4 * z), (u + r, v + 1.3 * r, 200)))
    return body


def _body(kind, x, y, z, more, rng):
    """Return a plate, an angle or a plate with its corners cut off, and the features to add."""
    if kind == 0:
        return box((0, 0, 0), (x, y, z)), more
    if kind == 1:
        wall = box((0, 0, 0), (rng.uniform(10, 25), y, z + rng.uniform(20, 60) + more))
        return fuse(box((0, 0, 0), (x, y, z)), wall), 0.0
    a, b, c, d = rng.uniform(0.15, 0.4, 4) * min(x, y)
    outline = [(a, 0), (x - b, 0), (x, b), (x, y - c), (x - c, y), (d, y), (0, y - d), (0, a)]
    return prism([(*point, 0) for point in outline], (0, 0, z)), more


def mixed_parts(seed, folder):
    """Twenty parts: eight random workpieces and eight machined ones, two with a mirror image, two with a near twin."""
    rng, folder = np.random.default_rng(seed), Path(folder)
    parts = [random_part(folder / f"block{k}.off", rng) for k in range(8)]
    for k in range(8):
        own = rng.integers(1 << 30)
        solids = {"machined": machined(np.random.default_rng(own))}
        if k < 2:
            solids["mirrored"] = mirrored(solids["machined"])
        elif k < 4:
            solids["twin"] = machined(np.random.default_rng(own), 4.0)
        for name, solid in solids.items():
            write(solid, folder / f"{name}{k}.step")
            parts.append(read_part(folder / f"{name}{k}.step"))
    return parts
