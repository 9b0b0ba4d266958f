"""Edge points: where a blurred step is, how sure, and nothing where there is none."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.special import ndtr

from tanteo.errors import InputError
from tanteo.vision import find_edges
from tanteo.vision.edges import image_noise, map_edges, noise_by_level
from tanteo.vision.settings import EDGES


def step_image(angle, offset, rng=None, noise=0.0, contrast=80.0, blur=0.8, size=96):
    """Return an image of a straight step at ``normal (p - middle) = offset``, blurred and integrated over pixels."""
    fine = 4
    at = (np.arange(size * fine) + 0.5) / fine - 0.5
    x, y = np.meshgrid(at, at)
    n = np.array([np.cos(angle), np.sin(angle)])
    far = (x - size / 2) * n[0] + (y - size / 2) * n[1] - offset
    smooth = ndtr(far / blur).reshape(size, fine, size, fine).mean(axis=(1, 3))
    image = 90 + contrast * smooth
    return (image if rng is None else image + rng.normal(0, noise, image.shape)), n


def offsets(image, n, offset, size=96, margin=8):
    edges = find_edges(image)
    inner = np.all((edges.pixels > margin) & (edges.pixels < size - margin), axis=1)
    return (edges.pixels[inner] - size / 2) @ n - offset, edges.normals[inner] @ n, edges.sds[inner]


@pytest.mark.parametrize("angle", np.linspace(0, 2 * np.pi, 13)[:-1] + 0.1)
@pytest.mark.parametrize("offset", [0.0, 0.27, -0.4])
def test_a_step_is_found_where_it_is(angle, offset):
    image, n = step_image(angle, offset)
    off, aligned, _ = offsets(image, n, offset)
    assert len(off) > 60
    assert np.abs(off).max() < 0.002
    assert aligned.min() > 0.995


@pytest.mark.parametrize(("noise", "contrast"), [(2.0, 80.0), (4.0, 60.0), (5.0, 35.0)])
def test_the_spread_is_as_stated(noise, contrast):
    rng = np.random.default_rng(5)
    squares, count, blocks = 0.0, 0, []
    for _ in range(30):
        offset = rng.uniform(-0.5, 0.5)
        image, n = step_image(rng.uniform(0, np.pi), offset, rng, noise, contrast)
        off, aligned, sd = offsets(image, n, offset)
        good = aligned > 0.9
        z = off[good] / sd[good]
        squares += float(np.sum(np.clip(z, -4, 4) ** 2))
        count += int(good.sum())
        blocks.append(float(np.mean(np.clip(z, -4, 4) ** 2)))
    # neighbours share noise: the images are the independent draws
    spread = np.std(blocks) / np.sqrt(len(blocks))
    print(squares / count, spread)
    assert 0.8 - 3 * spread < squares / count < 1.2 + 3 * spread


@pytest.mark.parametrize("gap", [4.0, 4.5, 5.0])
def test_an_edge_drifts_where_a_neighbour_pulls_it(gap):
    alone, n = step_image(0.3, 0.2)
    beside = alone + 0.6 * (step_image(0.3, 0.2 + gap)[0] - 90)
    for image, pulled in ((alone, False), (beside, True)):
        edges = find_edges(image)
        inner = np.all((edges.pixels > 8) & (edges.pixels < 88), axis=1)
        off = (edges.pixels[inner] - 48) @ n - 0.2
        own = np.abs(off) < 1.5
        off, drifts = np.abs(off[own]), np.abs(edges.drifts[inner][own])
        assert len(off) > 60
        if pulled:
            assert np.median(drifts) > 2 * np.median(off)
            assert np.median(off) > 0.002
        else:
            assert drifts.max() < 0.02


@pytest.mark.parametrize(("slope", "bright"), [(4.0, True), (4.0, False), (8.0, True), (8.0, False)])
def test_shading_displaces_an_edge_by_its_drift(slope, bright):
    """A surface that gets brighter, or darker, away from the edge displaces it; the drift extrapolates to its place."""
    image, n = step_image(0.3, 0.2, blur=EDGES.blur)
    row, column = np.indices(image.shape)
    far = (column - 48) * n[0] + (row - 48) * n[1] - 0.2
    image = image + slope * np.clip(far if bright else -far, 0, 6) * (1 if bright else -1)
    edges = find_edges(image)
    own = np.all((edges.pixels > 12) & (edges.pixels < 84), axis=1) & (np.abs((edges.pixels - 48) @ n - 0.2) < 1)
    off = ((edges.pixels[own] - 48) @ n - 0.2) * (1 if bright else -1)
    drifts = edges.drifts[own] * (1 if bright else -1)
    assert own.sum() > 60
    assert off.mean() > 0.05
    assert np.abs(off - EDGES.extrapolation * drifts).mean() < 0.4 * off.mean()


@pytest.mark.parametrize("levels", [(40.0, 60.0), (40.0, 80.0), (40.0, 160.0), (20.0, 220.0)])
def test_a_response_curve_moves_an_edge_to_the_dark(levels):
    linear, n = step_image(0.3, 0.2, blur=EDGES.blur)
    dark, bright = np.array(levels) ** 2.2
    image = (dark + (linear - 90) / 80 * (bright - dark)) ** (1 / 2.2)
    off, _, _ = offsets(image, n, 0.2)
    edges = find_edges(image)
    inner = np.all((edges.pixels > 8) & (edges.pixels < 88), axis=1)
    assert off.mean() < -0.03
    assert edges.responses[inner].mean() == pytest.approx(off.mean(), rel=0.3)


def test_the_mean_along_an_edge_has_its_correlated_error():
    rng, noise, z = np.random.default_rng(6), 4.0, []
    for _ in range(150):
        angle, offset = rng.uniform(0, np.pi), rng.uniform(-0.5, 0.5)
        image, n = step_image(angle, offset, rng, noise, 60.0)
        off, _, sd = offsets(image, n, offset)
        length = 96 - 16
        z.append(off.mean() / (np.sqrt(np.mean(sd**2)) / np.sqrt(length / EDGES.correlation)))
    # the factor of two on either side of one covers edges that run aslant and are longer than the window
    print(np.mean(np.square(z)))
    assert 0.5 < np.mean(np.square(z)) < 1.6


def test_noise_is_measured_beside_texture_and_slopes():
    rng = np.random.default_rng(7)
    y, x = np.mgrid[0:200, 0:200]
    image = 100 + 0.2 * x - 0.1 * y + rng.normal(0, 3.0, (200, 200))
    assert image_noise(image) == pytest.approx(3.0, rel=0.03)
    image[60:120, 60:120] += 40 * (((x + y) // 4) % 2)[60:120, 60:120]
    assert image_noise(image) == pytest.approx(3.0, rel=0.15)


def test_bright_surfaces_with_more_noise_have_no_more_edges():
    rng = np.random.default_rng(9)
    level = np.full((240, 320), 70.0)
    level[60:180, 80:220] = 180.0
    noise = np.where(level > 100, 5.0, 1.5) * rng.normal(size=level.shape)
    # the noise of cameras is shared by neighbours, by the interpolation of colours
    image = cv2.GaussianBlur(level, (0, 0), 0.7) + cv2.GaussianBlur(noise, (0, 0), 0.6)
    edges = find_edges(np.rint(image))
    inside = np.all((edges.pixels > [90, 70]) & (edges.pixels < [210, 170]), axis=1)
    assert inside.sum() < 5
    outline = np.abs(np.abs(edges.pixels - [149.5, 119.5]) - [70, 60]).min(axis=1) < 1
    assert 500 < outline.sum() < 540


def test_noise_by_brightness_is_one_if_it_is_constant():
    rng = np.random.default_rng(10)
    image = np.linspace(60, 200, 320) + rng.normal(0, 2.0, (240, 320))
    ratio = noise_by_level(image, np.ones(image.shape, dtype=bool))
    assert np.abs(ratio - 1).max() < 0.2


@pytest.mark.parametrize("noise", [0.0, 1.0, 6.0])
def test_an_empty_image_has_next_to_no_edges(noise):
    rng = np.random.default_rng(8)
    y, x = np.mgrid[0:200, 0:200]
    image = np.rint(100 + 0.15 * x + 0.05 * y + rng.normal(0, noise, (200, 200)))
    assert len(find_edges(image)) < 40


def test_what_is_no_grey_image_is_refused():
    for image in (np.zeros((4, 4)), np.zeros((40, 40, 3)), np.full((40, 40), np.nan)):
        with pytest.raises(InputError, match="image"):
            find_edges(image)


def test_the_map_has_the_nearest_edge_of_a_direction():
    image = np.full((120, 120), 60.0)
    image[30:90, 40:100] = 180.0
    edges = find_edges(cv2.GaussianBlur(image, (0, 0), 0.8))
    found = map_edges(edges)
    upright, level = 0, EDGES.channels // 2  # channels are of normals
    point = edges.pixels[found.nearest[upright, 60, 50]]
    assert point[0] == pytest.approx(39.5, abs=0.1)
    assert found.distances[upright, 60, 50] == pytest.approx(10.5, abs=1.0)
    assert edges.pixels[found.nearest[level, 60, 50]][1] in (pytest.approx(29.5, abs=0.1), pytest.approx(89.5, abs=0.1))
    assert found.nearest[2, 60, 50] == -1 or found.distances[2, 60, 50] > 9


def test_an_image_without_edges_has_an_empty_map():
    found = map_edges(find_edges(np.full((64, 64), 100.0)))
    assert (found.nearest == -1).all()
