"""Information of a reading about a group, against the same sums of pairs written out in NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo import _core


def information(w, means, variances, groups):
    """Mutual information of group and reading by Bhattacharyya's overlaps of all pairs of samples."""
    some = w > 0
    w, m, v, groups = w[some], means[some], variances[some], groups[some]
    total = v[:, None] + v
    overlap = np.exp(-0.25 * (m[:, None] - m) ** 2 / total) * np.sqrt(2 * np.sqrt(v[:, None] * v) / total)
    same = groups[:, None] == groups
    own, whole = (overlap * same) @ w, overlap @ w
    return np.sum(w * np.log((own / (same @ w)) / (whole / w.sum())))


@pytest.mark.parametrize(("samples", "groups", "spread"), [(1, 1, 1e-3), (40, 2, 1e-4), (128, 10, 3e-3), (60, 60, 1.0)])
def test_it_is_the_sum_over_pairs(samples, groups, spread):
    rng = np.random.default_rng(samples)
    w = rng.random((50, samples)) * (rng.random((50, samples)) > 0.3)
    means, variances = 0.1 + spread * rng.normal(size=w.shape), (3e-4 * (1 + 5 * rng.random(w.shape))) ** 2
    of = rng.integers(groups, size=samples)
    expected = [information(*rows, of) if rows[0].any() else 0.0 for rows in zip(w, means, variances, strict=True)]
    found = _core.group_information(w, means, variances, of)
    np.testing.assert_allclose(found, expected, atol=2e-5 * w.sum(axis=1).max())


def test_readings_that_no_sample_gives_have_no_information():
    none = np.zeros((3, 5))
    np.testing.assert_array_equal(_core.group_information(none, none, none + 1, np.arange(5)), 0.0)
