"""Real readings without a stated noise: ``python benchmarks/unstated.py [draws]``.

Each set of the folder of real measurements beside the checkout is located with no standard deviation stated. The table
has the estimated noise beside its known value, and the pose beside a reference: of the block from its other placement,
of the castle from all pixels, of the fixture from the other person's touches.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "real"))

import test_cmm_bare as cmm
from common import Table
from fingertips import FOLDER as FINGERTIPS
from fingertips import points_of

import fixture_sets
import tanteo
from bare_scenes import nees, off
from castle_scene import FRAMES, castle, dense_fit, first_pose, pixels_of
from tanteo.geometry import SE3

PIXELS = 24


def located(part, points, **columns):
    """Return the answer from readings without a standard deviation."""
    return tanteo.locate(tanteo.Readings.from_columns(points=points, **columns), part)


def estimated_sd(answer):
    """Return the standard deviation that the answer states [m], and its bounds, from a starting value of 0.1 mm."""
    return tuple(1e-4 * factor for factor in answer.hypotheses[0].noise_scale)


def row(name, answer, known, against, part=None, truth=None):
    """Return one line of the table; ``known`` is the known value of the noise."""
    if not answer.hypotheses:
        return (name, answer.status, "", known, "", against)
    middle, low, high = (f"{1e3 * sd:.2g}" for sd in estimated_sd(answer))
    if truth is not None:
        h = answer.hypotheses[0]
        moved, turned = off(part, h.T_world_part, truth)
        value, dof = nees(part, h.T_world_part, h.covariance, truth)
        against = f"{1e3 * moved:.2f} mm, {np.degrees(turned):.2f} deg off; NEES {value:.1f} of {dof} ({against})"
    return (
        name,
        answer.status,
        f"{middle} ({low} to {high}) mm",
        known,
        f"{1e3 * answer.hypotheses[0].corner_sd:.2f} mm",
        against,
    )


def block_rows():
    """Return the rows of a block in two placements, touched without labels.

    The frame that its dimples name is rotated against the drawing's by 13 mrad, equally in both placements.
    """
    part = tanteo.read_part(cmm.FOLDER / "calibration_block_from_drawing.stl", unit="mm", name="block")
    answers, gaps = {}, []
    for placement in cmm.PLACEMENTS:
        points = cmm.bare_touches(placement)
        answers[placement] = located(part, points.points, radii=points.radii)
        images = answers[placement].hypotheses[0].T_world_part @ part.symmetry.Ts
        each = SE3.log(SE3.inverse(images) @ cmm.labelled_pose(placement))
        gaps.append(each[np.argmin(np.linalg.norm(each[:, 3:], axis=1))])
    apart = gaps[0] - gaps[1]
    value = apart @ np.linalg.solve(sum(a.hypotheses[0].covariance for a in answers.values()), apart)
    for placement, answer in answers.items():
        yield row(f"block, {placement}", answer, "0.05 to 0.16 mm", f"NEES {value:.1f} of 6 (the other placement)")


def fixture_rows():
    """Touches of one fixture by two people."""
    part = fixture_sets.fixture().part
    answers = {}
    for name in fixture_sets.SETS:
        readings = tanteo.read_readings(fixture_sets.FOLDER / f"{name}.csv")
        answers[name] = tanteo.locate(readings, part)
    for name, other in zip(fixture_sets.SETS, reversed(fixture_sets.SETS), strict=True):
        truth = answers[other].hypotheses[0].T_world_part
        yield row(f"fixture, {name}", answers[name], "0.3 mm, and a tip 1.5 mm off", "the other person", part, truth)


FINGERS = {
    "measCylinder_exp": "cylinder", "measCleaner_exp": "cleaner", "measTetra9_sim": "tetrahedron",
    "measBox15_sim": "box",
}  # fmt: skip


def fingertip_rows():
    """Fingertips on hand-held objects, and simulated sets."""
    for name, mesh in FINGERS.items():
        part = tanteo.read_part(FINGERTIPS / "models" / f"{mesh}.off", unit="m")
        known = "5 to 7 mm" if name.endswith("exp") else "0.1 mm or less"
        yield row(name, located(part, points_of(name)), known, "")


def castle_rows(draws):
    """Pixels of depth frames."""
    with tempfile.TemporaryDirectory() as folder:
        target = tanteo.posterior.prepare(castle(folder))
    T = first_pose()
    for frame in FRAMES:
        T = dense_fit(target.surface, frame, T)
        pixels = pixels_of(target.part, target.surface, frame, T)
        for k in range(draws):
            rows = pixels.choose(PIXELS, np.random.default_rng((frame, k)))
            answer = located(target.part, pixels.points[rows], directions=pixels.directions[rows])
            known = f"{1e3 * pixels.sd:.1f} mm, {1e3 * pixels.tolerance:.1f} a face"
            yield row(f"castle, frame {frame}", answer, known, "all pixels", target.part, T)


def main():
    """Print the table."""
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 2
    rows = [*block_rows(), *fixture_rows(), *fingertip_rows(), *castle_rows(draws)]
    columns = ("set", "status", "noise estimated (95 %)", "known of it", "sd of the worst corner", "beside")
    print(Table("No noise stated", f"Real sets; {PIXELS} pixels a draw.", columns, rows).markdown())


if __name__ == "__main__":
    main()
