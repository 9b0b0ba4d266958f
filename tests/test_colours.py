"""Colours that can be read and distinguished, also with colour-deficient vision."""

from __future__ import annotations

import itertools
import re
from importlib import resources

import numpy as np
import pytest

from tanteo.render import image_picture, pictures
from tanteo.render.live import colors

CSS = resources.files("tanteo.render.html").joinpath("page.css").read_text(encoding="utf-8")
LIGHT, DARK = (dict(re.findall(r"--(\w+): (#\w{6})", block)) for block in CSS.split("@media")[:2])

# Machado, Oliveira and Fernandes (2009), severity 1, on linear light
SEEN = {
    "normal": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.3039]],
}
MARKS = ("good", "bad", "overlay", "free", "edge", "feature")
FILLS = ("part", "differs")
LIVE = {
    name: colors.css(getattr(colors, name))
    for name in ("GOOD", "BAD", "OVERLAY", "FREE", "EDGE", "INK", "PLANNER", "FEATURE")
}
LIVE |= {f"rival {k}": colors.css(hue) for k, hue in enumerate(colors.RIVALS)}
SEEN_IMAGE = {name: colors.css(getattr(image_picture, name)) for name in ("FOUND", "MISSED", "OUTLINE")}


def linear(hue):
    rgb = np.array([int(hue[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def lab(light):
    M = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    t = M @ light / [0.9505, 1.0, 1.089]
    f = np.where(t > 0.008856, np.cbrt(t), 7.787 * t + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def contrast(a, b):
    high, low = sorted((linear(h) @ [0.2126, 0.7152, 0.0722] for h in (a, b)), reverse=True)
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
@pytest.mark.parametrize("paper", ["paper", "panel"])
def test_words_can_be_read(theme, paper):
    for ink in ("ink", "soft", "good", "bad"):
        assert contrast(theme[ink], theme[paper]) >= 4.5, ink


def apart(one, other, eyes):
    """Return the difference of two colours for such eyes (CIE 1976; 2 is just noticeable)."""
    seen = [lab(np.clip(SEEN[eyes] @ linear(hue), 0, 1)) for hue in (one, other)]
    return np.linalg.norm(seen[0] - seen[1])


PALETTES = {
    "report by day": {name: LIGHT[name] for name in MARKS},
    "report by night": {name: DARK[name] for name in MARKS},
    "faces by day": {name: LIGHT[name] for name in FILLS},
    "faces by night": {name: DARK[name] for name in FILLS},
    "live page": LIVE,
    "picture of an image": SEEN_IMAGE,
    "pictures of sensors": {hue: hue for hue in pictures.COLORS},
}


@pytest.mark.parametrize("eyes", SEEN)
@pytest.mark.parametrize("palette", PALETTES)
def test_marks_can_be_distinguished(palette, eyes):
    for one, other in itertools.combinations(PALETTES[palette], 2):
        assert apart(PALETTES[palette][one], PALETTES[palette][other], eyes) > 15, (one, other)


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
@pytest.mark.parametrize("eyes", SEEN)
def test_beams_are_no_ghosts_and_no_readings(theme, eyes):
    for mark in ("good", "bad", "overlay", "free"):
        assert apart(theme["beam"], theme[mark], eyes) > 15, mark


def test_the_live_page_has_the_colours_of_the_report():
    for name in ("part", "edge", "ink", "soft", "good", "bad", "beam", "free", "overlay", "feature"):
        assert colors.css(getattr(colors, name.upper())) == LIGHT[name], name


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
def test_marks_stand_out_from_the_part(theme):
    for mark in ("good", "bad", "overlay"):
        assert np.linalg.norm(lab(linear(theme[mark])) - lab(linear(theme["part"]))) > 25, mark
