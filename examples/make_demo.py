"""Make the files of `tanteo demo`: the example parts as meshes, and one image with its camera and true poses.

Run it after `make_parts.py` and `make_images.py`: ``python examples/make_demo.py``.
"""

import shutil
from pathlib import Path

import numpy as np

from tanteo import read_parts
from tanteo.bench.demo.stage import write_hypotheses

HERE = Path(__file__).parent
DEMO = HERE.parent / "src" / "tanteo" / "bench" / "demo"
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])

(DEMO / "parts").mkdir(exist_ok=True)
for part in read_parts([HERE / "parts"]).parts:
    facets = np.zeros(len(part.triangles), dtype=FACET)
    facets["corners"] = 1e3 * part.vertices[part.triangles]  # millimetres
    head = b"tanteo demo, millimetres".ljust(80, b" ") + np.uint32(len(facets)).tobytes()
    (DEMO / "parts" / f"{part.name}.stl").write_bytes(head + facets.tobytes())
for name in ("twins.png", "camera.yaml", "marks.csv", "truth.csv"):
    shutil.copy(HERE / "images" / name, DEMO / name)
write_hypotheses()
