"""A few pixels of real depth frames as beams, no first guess, against the fit of all pixels."""

import numpy as np
import pytest

from bare_scenes import nees, no_paths, off
from castle_scene import FOLDER, FRAMES, castle, dense_fit, first_pose, pixels_of
from tanteo.posterior import identify_points, prepare

pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason=f"no data at {FOLDER}")

RIGHT = 3e-3, np.radians(1.5)


@pytest.fixture(scope="module")
def target(tmp_path_factory):
    return prepare(castle(tmp_path_factory.mktemp("castle")))


@pytest.fixture(scope="module")
def frames(target):
    """Dense fit and pixels of two frames."""
    T, out = first_pose(), {}
    for frame in FRAMES[:2]:
        T = dense_fit(target.surface, frame, T)
        out[frame] = T, pixels_of(target.part, target.surface, frame, T)
    return out


def count(target, frames, n, draws):
    """Best right, truth in the region of some mode, and normalised errors of the right ones."""
    best, among, values = 0, 0, []
    for frame, (T, pixels) in frames.items():
        rng = np.random.default_rng((frame, n))
        for _ in range(draws):
            answer = identify_points(pixels.draw(n, rng), no_paths(), [target], top=10_000)
            gaps = [off(target.part, h.T_world_part, T) for h in answer.hypotheses]
            squares = [nees(target.part, h.T_world_part, h.covariance, T)[0] for h in answer.hypotheses]
            right = [moved < RIGHT[0] and angle < RIGHT[1] for moved, angle in gaps]
            best += bool(right and right[0])
            among += any(right) or min(squares, default=np.inf) < 22.5
            values += squares[:1] if right and right[0] else []
    return best, among, np.array(values)


def test_the_dense_fit_explains_the_frames(frames):
    for _, pixels in frames.values():
        assert 0.7e-3 < pixels.sd < 2.0e-3
        assert len(pixels.points) > 10_000


@pytest.mark.slow
def test_twenty_four_pixels(target, frames):
    """Aimed at 90 % of 50 draws a frame; ``benchmarks/castle.py`` counts them all."""
    best, among, values = count(target, frames, 24, 8)
    assert best >= 12
    assert among >= 14
    assert values.mean() < 12


@pytest.mark.slow
def test_twelve_pixels(target, frames):
    """Aimed at 65 % right; twelve pixels of this noise do not always fix the pose to 3 mm and 1.5 degrees."""
    best, among, values = count(target, frames, 12, 8)
    assert best >= 6
    assert among >= 14
    assert values.mean() < 12
