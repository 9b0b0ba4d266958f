"""Very many parts and an image of a table: the outline prunes them, and the answer reports the pruned ones."""

from __future__ import annotations

import numpy as np
import pytest

from random_parts import random_part
from rendered import table_camera
from tanteo.catalogue import build_catalogue, open_catalogue
from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.posterior import DEFAULTS
from tanteo.vision import find_edges, outline_of_readings, outlines, prepare_vision, render, see_table
from tanteo.vision.outlines import Narrowed, narrowed, seen_outline
from tanteo.vision.regions import find_regions
from tanteo.vision.rendering import Stage, rendered_part
from tanteo.vision.solid import see_anywhere
from vision_scenes import random_shot

COUNT = 24


@pytest.fixture(scope="module")
def catalogue(tmp_path_factory):
    folder, rng = tmp_path_factory.mktemp("parts"), np.random.default_rng(12)
    for k in range(COUNT):
        random_part(folder / f"part{k:02d}.off", rng)
    out = tmp_path_factory.mktemp("catalogue")
    build_catalogue(folder, out, unit="mm", workers=0)
    return open_catalogue(out)


@pytest.fixture(scope="module")
def shots(catalogue):
    """Rendered images of parts of the catalogue, with their number."""
    rng = np.random.default_rng(5)
    rows = rng.integers(COUNT, size=10)
    return [(int(row), random_shot([prepare_vision(catalogue[int(row)])], rng)) for row in rows]


@pytest.fixture
def many(monkeypatch):
    """Outlines select among more than four parts."""
    monkeypatch.setattr(outlines, "DEFAULTS", DEFAULTS.changed("pruning.budget", 4))


def whole(shots):
    """Yield the scenes whose part is completely in the image, with its region."""
    for row, shot in shots:
        for region in find_regions(shot.image, find_edges(shot.image))[:1]:
            outline = seen_outline(shot.camera, region, SE3.inverse(shot.camera.T_world_camera))
            if outline is not None:
                yield row, shot, outline


@pytest.mark.slow
def test_the_part_of_an_image_is_searched(catalogue, shots, many):
    left, seen = [], 0
    for row, _, outline in whole(shots):
        chosen = narrowed(outline, catalogue)
        assert row in chosen.rows
        assert outline.log_odds(catalogue)[row] > 0
        left.append(len(chosen.rows))
        seen += 1
    assert seen >= 7
    assert np.median(left) < COUNT / 3


@pytest.mark.slow
def test_an_image_is_answered_of_a_catalogue(catalogue, shots, many):
    row, shot, _ = next(whole(shots))
    (seen, *_) = see_table(shot.image, shot.camera, catalogue).objects
    assert seen.answer.hypotheses[0].part == catalogue[row].name
    assert seen.similar[0] in catalogue.names
    shares = sum(h.probability for h in seen.answer.hypotheses)
    assert shares + seen.answer.unknown_probability <= 1 + 1e-9


@pytest.mark.slow
def test_unsearched_parts_are_reported(catalogue, shots, many, monkeypatch):
    """If not all similar parts can be kept, the pruned ones are as probable as the kept ones."""
    monkeypatch.setattr(outlines, "DEFAULTS", DEFAULTS.changed("pruning.budget", 4).changed("pruning.least", 1))
    monkeypatch.setattr("tanteo.posterior.answers.seen_outline._TOGETHER", 1e4)  # any outline is any part's
    _, shot, _ = next(whole(shots))
    (seen, *_) = see_table(shot.image, shot.camera, catalogue).objects
    assert seen.answer.status == "ambiguous"
    assert f"one of {COUNT - 1} parts with similar outlines that were not searched" in seen.answer.message
    assert seen.answer.unknown_probability > 0.9


def test_what_is_left_out_counts_by_its_outline():
    """As the less promising half does; and where outlines mislead, as an unknown object."""
    chosen = Narrowed(np.arange(4), np.zeros(0, int), (), 96, np.array([1.0, 0.5, 0.2, 0.2]), 0.1, 0.05)
    evidence = np.log([1.0, 0.5, 0.2, 0.2])
    assert chosen.log_left_out(evidence, -np.inf) == pytest.approx(np.log(0.1))
    assert chosen.log_left_out(np.full(4, -np.inf), -2.0) == pytest.approx(-2.0 + np.log(0.05))
    assert Narrowed(np.arange(4), np.zeros(0, int)).log_left_out(evidence, 0.0) == -np.inf


def test_an_object_that_leaves_the_image_is_not_narrowed(catalogue, many):
    camera, part = table_camera(), catalogue[3]
    T = SE3.from_parts(np.eye(3), np.array([0.24, 0.1, 0.0])) @ prepare_vision(part).rests[0].T_table_part
    image, _ = render(Stage(camera, [rendered_part(part, T)]), np.random.default_rng(1))
    (region, *_) = find_regions(image, find_edges(image))
    assert region.cut
    (seen, *_) = see_table(image, camera, catalogue).objects
    assert seen.answer.status == "insufficient"
    assert f"does not select among the {COUNT} parts. Move it into the image" in seen.answer.message


def test_many_parts_need_a_table(catalogue, monkeypatch):
    monkeypatch.setattr("tanteo.vision.solid.DEFAULTS", DEFAULTS.changed("pruning.least", 10))
    with pytest.raises(InputError, match=r"at most 10 where the pose of the camera is unknown.*got 24.*--marks"):
        see_anywhere(np.zeros((480, 640)), table_camera(), catalogue)


def test_readings_choose_their_object(catalogue):
    camera, rng = table_camera(), np.random.default_rng(2)
    places = np.array([[-0.12, 0.0, 0.0], [0.09, 0.04, 0.0]])
    laid = [
        SE3.from_parts(np.eye(3), place) @ prepare_vision(catalogue[k]).rests[0].T_table_part
        for k, place in zip((5, 9), places, strict=True)
    ]
    image, _ = render(Stage(camera, [rendered_part(catalogue[k], T) for k, T in zip((5, 9), laid, strict=True)]), rng)
    for k, T in zip((5, 9), laid, strict=True):
        points = SE3.apply(T, catalogue[k].vertices)
        found = outline_of_readings(image, camera, points)
        assert (found.regions, found.beside) == (2, 0)
        assert found.outline.log_odds(catalogue)[k] > 0
    mixed = np.concatenate([points, SE3.apply(laid[0], catalogue[5].vertices[:2])])
    assert outline_of_readings(image, camera, mixed).beside == 2
    with pytest.raises(InputError, match=r"expected the places of the readings in it, got 0 of"):
        outline_of_readings(image, camera, points + np.array([5.0, 0, 0]))
    with pytest.raises(InputError, match=r"expected an object where the readings are, got 2 elsewhere"):
        outline_of_readings(image, camera, np.array([[-0.02, -0.14, 0.0]] * 3))
    with pytest.raises(InputError, match=r"expected an object where the readings are, got 0 elsewhere"):
        outline_of_readings(np.full_like(image, 180.0), camera, points)
    with pytest.raises(InputError, match="rows x"):
        outline_of_readings(image[1:], camera, points)
