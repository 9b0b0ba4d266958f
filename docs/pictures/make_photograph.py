"""Draw ``photograph_seen.jpg`` of ``docs/vision.md``: an answer on a path-traced photograph (extra ``benchmarks``).

``python docs/pictures/make_photograph.py [folder]``
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

from photographs import models, shot

from tanteo import io
from tanteo.render.image_picture import draw_sight
from tanteo.vision import see_table


def main() -> None:
    """Write the picture to a folder, or beside this script."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent
    pixels, camera, *_ = shot("cluttered", 0, 58)
    sight = see_table(pixels, camera, models()[0], top=20)
    drawn = draw_sight(pixels, camera, sight)
    rows, columns = (n // 2 * 2 for n in drawn.shape[:2])
    half = drawn[:rows, :columns].reshape(rows // 2, 2, columns // 2, 2, 3).mean(axis=(1, 3))
    io.write_image(str(folder / "photograph_seen.jpg"), half.round().astype(np.uint8))


if __name__ == "__main__":
    main()
