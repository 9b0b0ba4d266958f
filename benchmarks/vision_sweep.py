"""Answer rendered images with several values of one setting of vision.

``python benchmarks/sweep.py vision.search.kept 24 48`` calls it. Every value runs in a process of its own, because
modules of vision read the settings at import.
The images are those of ``vision.py step_12mm,step_15mm`` with 30 % of the part hidden, and those of single parts in
any pose without a table.
"""

from __future__ import annotations

import time
from multiprocessing import get_context

import numpy as np
from common import Table

from tanteo.posterior.settings import Settings

PARTS = "step_12mm,step_15mm"
SEED = 501


def choose(name: str, value: float) -> None:
    """Replace one setting, before another module of vision is imported."""
    from tanteo.vision import settings

    changed = Settings.changed(settings.VISION, name, value)
    settings.VISION = changed
    settings.EDGES, settings.EVIDENCE, settings.SEARCH = changed.edges, changed.evidence, changed.search


def on_table(image: int) -> list[tuple]:
    """Return the rows of ``vision.run_image`` for one image of either part."""
    from vision import run_image

    return [row for k in range(2) if (row := run_image(PARTS, k, image, 0.3, SEED)) is not None]


def anywhere(image: int) -> tuple[bool, float]:
    """Return whether the pose of a part is among the answers without a table, and the CPU time [s]."""
    from tanteo.geometry import SE3
    from tanteo.vision.solid import see_anywhere
    from vision import models_of
    from vision_scenes import in_camera, random_shot

    models, _ = models_of(PARTS)
    model = models[image % 2]
    shot = random_shot([model], np.random.default_rng([SEED, image]), 0.0, None)
    start = time.process_time()
    objects = see_anywhere(shot.image, shot.camera, [model]).objects
    spent = time.process_time() - start
    T_camera_world = in_camera(shot) @ SE3.inverse(shot.T_world_part)
    found = [T_camera_world @ h.T_world_part for seen in objects for h in seen.answer.hypotheses]
    images = in_camera(shot) @ model.part.symmetry.Ts
    off = [SE3.apply(T, model.part.vertices) - SE3.apply(images[:, None], model.part.vertices) for T in found]
    return any(np.abs(gap).max(axis=(1, 2)).min() < 0.02 * model.part.diagonal for gap in off), spent


def line(value: float, rows: list[tuple], other: list[tuple[bool, float]]) -> tuple[str, ...]:
    """Return one line of the table."""
    known, rank, _, right, nees, _, spent, _, truly = (np.array(column) for column in zip(*rows, strict=True))
    good = nees[np.isfinite(nees)]
    return (
        f"{value:g}", f"{np.mean(rank[known.astype(bool)] == 0):.2f}", f"{np.mean(right):.2f}",
        f"{np.mean(np.log(np.maximum(truly, 1e-4))):.3f}", f"{np.mean(good) / 3:.2f}" if len(good) else "",
        f"{np.median(spent):.1f}", f"{sum(found for found, _ in other)}/{len(other)}",
        f"{np.median([spent for _, spent in other]):.1f}" if other else "",
    )  # fmt: skip


def sweep(setting: str, values: list[float], images: int, free: int) -> Table:
    """Return a table with one line for each value.

    Args:
        setting: group and field, such as ``search.kept``.
        values: values of the setting.
        images: number of images of each part on a table.
        free: number of images without a table.
    """
    lines = []
    for value in values:
        with get_context("spawn").Pool(1, choose, (setting, value)) as pool:
            rows = [row for found in pool.map(on_table, range(images)) for row in found]
            other = pool.map(anywhere, range(free))
        lines.append(line(value, rows, other))
    columns = (
        setting, "true part first", "answer right", "mean log probability", "NEES / dof", "s",
        "found without a table", "s",
    )  # fmt: skip
    text = f"{2 * images} images of {PARTS}, 30 % hidden, seed {SEED}. The default is in `vision/settings.py`."
    return Table(f"Sweep of vision.{setting}", text, columns, lines)
