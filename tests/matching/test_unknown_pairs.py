"""Planes of a part that nobody modelled, beside those met before: against what the catalogue's parts are like."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenes import points_on_plane, touch
from tanteo.answers import Priors
from tanteo.matching.freedom import NOTHING
from tanteo.matching.sensed import sense
from tanteo.matching.unknown import right_angled_family
from tanteo.matching.unknown_pairs import _anywhere, pair_gains, pairs_of


@pytest.mark.parametrize("name", ["block", "step_12mm"])
def test_two_touches_are_of_one_face_as_often_as_two_of_the_surface_are(models, name):
    """Of parts like this one, where the touches run along no axis: the sum of the squared shares of the faces."""
    model, rng = models[name], np.random.default_rng(10)
    part = model.part
    sensed = sense([touch(p, part.planes.normals[0], rng) for p in points_on_plane(part, 0, 2, rng)])
    pairs = pairs_of(sensed, [model], Priors(radius=model.radius))
    family, strays = right_angled_family(model.radius), np.full((1, 2), NOTHING)
    level, apart = (pair_gains(sensed, family, strays, p) for p in (pairs, replace(pairs, level=np.zeros((2, 2)))))
    more = np.exp(level - apart)[0] - 1  # what being level makes of one face or two, over two alone
    ratio = pairs.level[0, 1] * pairs.beam[0, 1]
    share = part.planes.areas / part.planes.areas.sum()
    assert ratio > 10
    assert more / (ratio + more) == pytest.approx(np.sum(share**2), rel=1e-9)


def test_one_plane_alone_is_as_likely_as_anywhere(models):
    """Whether it belongs to an axis of the part or to none; a second one that is level with it is more likely."""
    model, rng = models["block"], np.random.default_rng(10)
    sensed = sense([touch(p, model.part.planes.normals[0], rng) for p in points_on_plane(model.part, 0, 2, rng)])
    pairs = pairs_of(sensed, [model], Priors(radius=model.radius))
    family = right_angled_family(model.radius)
    alone = replace(sensed, kinds=("plane", "point"))
    assert pair_gains(alone, family, np.full((1, 2), NOTHING), pairs)[0] == 0.0
    assert pair_gains(sensed, family, np.full((1, 2), NOTHING), pairs)[0] > 1


def test_distances_of_faces_anywhere_are_a_density(models):
    model = models["block"]
    d = np.linspace(-2, 2, 20_001) * model.radius
    for same in (True, False):
        values = np.array([_anywhere(model, same, x, 1e-4) for x in d]) - 1e-3 / model.radius
        assert np.sum(values) * (d[1] - d[0]) == pytest.approx(1, abs=0.01)
        # faces that look opposite ways have the material between them: the second is behind the first
        assert np.sum(values * d) * (d[1] - d[0]) == pytest.approx(0 if same else -2 * model.sizes.height, abs=1e-3)
